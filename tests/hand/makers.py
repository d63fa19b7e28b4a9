"""Small broken and unusual ``.glb`` files, made from the bundled one."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any


def bundled_bytes(side: str = "right") -> bytes:
    """The bundled hand's file."""
    return (files("spf.hand") / "assets" / f"{side}.glb").read_bytes()


def write_changed_glb(path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Write the bundled hand with its glTF header changed in place by ``change``."""
    data = bundled_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    header = json.loads(data[20 : 20 + length])
    change(header)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    total = 20 + len(text) + len(rest)
    path.write_bytes(data[:8] + struct.pack("<II", total, len(text)) + b"JSON" + text + rest)
    return path
