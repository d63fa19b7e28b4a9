"""The network file: found, checked and run."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.errors import SpfError
from spf.learned import layout

__all__ = ["Network", "NetworkError", "load_network"]


class NetworkError(SpfError):
    """The learned proposal cannot be used."""


class Network(NamedTuple):
    """A loaded network.

    Attributes:
        session: runs it on one thread; safe to call from several threads.
        about: how it was trained, from the JSON beside it.
    """

    session: Any
    about: dict[str, Any]

    def outputs(self, crops: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the numbers (N, OUTPUTS) of crops (N, S, S); see :mod:`spf.learned.layout`."""
        (raw,) = self.session.run(None, {"crops": np.ascontiguousarray(crops[:, None], dtype=np.float32)})
        return np.asarray(raw, dtype=np.float64)


def load_network(path: str | Path | None = None) -> Network:
    """Load a network; None for the one that comes with the project.

    Raises:
        NetworkError: the file is missing, damaged or no hand proposal, or onnxruntime is not installed.
    """
    if path is not None:
        return _load(Path(path))
    with as_file(files("spf.learned") / "assets" / "hand-proposal.onnx") as bundled:
        return _load(bundled)


@cache
def available_network() -> tuple[Network | None, str]:
    """Return the network that comes with the project, or None and one sentence that says what is missing."""
    try:
        return load_network(), ""
    except NetworkError as error:
        return None, f"{error} Until then hands are looked for by rendering alone."


def _load(path: Path) -> Network:
    try:
        import onnxruntime
    except ImportError:
        raise NetworkError("The learned proposal needs the package onnxruntime; install it.") from None
    if not path.is_file():
        raise NetworkError(f"The network {path} is not there; install the project again or name another file.")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what goes wrong is raised below
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        shape = session.get_outputs()[0].shape
    except Exception as error:  # onnxruntime's exceptions share no other base
        raise NetworkError(f"The network {path} cannot be read ({type(error).__name__}); get the file again.") from None
    if len(shape) != 2 or shape[1] != layout.OUTPUTS:
        raise NetworkError(f"The network {path} is no hand proposal of this version; use the one that came with it.")
    described = path.with_suffix(".json")
    about = json.loads(described.read_text(encoding="utf-8")) if described.is_file() else {}
    return Network(session, about)
