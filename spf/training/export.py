"""Write a network as ONNX, with a JSON that says where it comes from."""

from __future__ import annotations

import hashlib
import json
import subprocess
import warnings
from pathlib import Path
from typing import Any

import torch

from spf.learned.layout import CROP_SIZE
from spf.training.network import HandNetwork

__all__ = ["NAME", "export_network"]

NAME = "hand-proposal"


def export_network(network: HandNetwork, folder: Path, about: dict[str, Any]) -> Path:
    """Write ``hand-proposal.onnx`` and ``hand-proposal.json`` (settings, samples seen, SHA-256, commit) into a folder."""
    path, fresh = folder / f"{NAME}.onnx", folder / f"{NAME}.new"
    was_training = network.training
    network.eval()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter announces its own successor
        torch.onnx.export(
            network,
            (torch.zeros(2, 1, CROP_SIZE, CROP_SIZE),),
            str(fresh),
            input_names=["crops"],
            output_names=["outputs"],
            dynamic_axes={"crops": {0: "n"}, "outputs": {0: "n"}},
            opset_version=17,
            dynamo=False,
        )
    network.train(was_training)
    content = fresh.read_bytes()
    fresh.replace(path)
    commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, cwd=Path(__file__).parent)
    about = {**about, "sha256": hashlib.sha256(content).hexdigest(), "commit": commit.stdout.strip()}
    (folder / f"{NAME}.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    return path
