"""A file for the visitor: bytes in, a download of the browser out."""

from __future__ import annotations

from typing import Any

import param
from panel.custom import JSComponent

__all__ = ["Download"]


class Download(JSComponent):
    """Takes no room; :meth:`hand_over` has the browser save a file."""

    content: bytes = param.Bytes(b"", doc="of the file that is on its way")
    name_of_file: str = param.String("", doc="that it is saved under")
    handed_over: int = param.Integer(0, doc="counts the files")

    _esm = """
    export function render({ model }) {
      model.on('handed_over', () => {
        const url = URL.createObjectURL(new Blob([model.content]));
        const link = document.createElement('a');
        link.href = url;
        link.download = model.name_of_file;
        document.body.append(link);
        link.click();
        link.remove();
        setTimeout(() => URL.revokeObjectURL(url), 60000);
        model.send_msg({ kind: 'taken' });
      });
      return document.createElement('span');
    }
    """

    def hand_over(self, name: str, content: bytes) -> None:
        """Have the browser save a file."""
        self.param.update(content=content, name_of_file=name)
        self.handed_over += 1

    def _handle_msg(self, msg: dict[str, Any]) -> None:
        if msg["kind"] == "taken":
            self.content = b""  # the page needs not keep it
