"""The button that uploads a file, which takes no more bytes than it says, whatever the browser sends."""

from __future__ import annotations

from typing import Any

import panel_material_ui as pmu

from app.uploads import ENDINGS, LARGEST_UPLOAD

__all__ = ["Upload"]

_CHUNK = 4 * 2**20  # bytes of an upload in one message


class Upload(pmu.FileInput):
    """The button."""

    def __init__(self, **params: Any) -> None:
        super().__init__(
            label="Upload", accept=",".join(ENDINGS), size="small", chunk_size=_CHUNK, max_file_size=LARGEST_UPLOAD,
            max_total_file_size=LARGEST_UPLOAD, variant="outlined", **params,
        )  # fmt: skip

    def _process_chunk(self, msg: dict[str, Any]) -> None:
        """Take a part of a file; the browser checks the size too, but who sends more need not use a browser."""
        held = sum(len(part) for file in self._file_buffer.values() for part in file["chunks"].values())
        if held + len(msg["data"]) > LARGEST_UPLOAD:
            self._file_buffer.clear()
            raise ValueError(f"an upload of more than {LARGEST_UPLOAD} bytes was refused")
        super()._process_chunk(msg)
