"""A line that says what is being laid out, seen before the browser is busy with it and until it is done."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import param
from panel.custom import JSComponent

__all__ = ["LayingOut"]


class LayingOut(JSComponent):
    """The line, over what is below: it takes no room, so that nothing moves under a pointer when it goes.

    Args:
        on_shown: called when the browser shows the words.
    """

    words: str = param.String(doc="what is said; empty when the browser has been sent all")

    _esm = """
    const LATEST = 300, LONGEST = 1500;  // ms: a page in the background draws nothing, and one that plays is never idle

    export function render({ model }) {
      const line = document.createElement('p');
      line.className = 'laying-out';
      line.setAttribute('role', 'status');
      const follow = () => {
        const words = model.words;
        if (!words) {
          requestIdleCallback(() => { if (!model.words) line.hidden = true; }, { timeout: LONGEST });
          return;
        }
        line.textContent = words;
        line.hidden = false;
        let told = false;
        const shown = () => { if (!told) { told = true; model.send_msg({ shown: words }); } };
        requestAnimationFrame(() => requestAnimationFrame(shown));
        setTimeout(shown, LATEST);
      };
      line.hidden = true;
      model.on('words', follow);
      if (model.words) follow();
      return line;
    }
    """

    _stylesheets: ClassVar[list[str]] = [
        """
        :host { overflow: visible; position: relative; }
        .laying-out {
          position: absolute; top: 8px; left: 16px; margin: 0; white-space: nowrap;
          font: 14px/1.5 Roboto, sans-serif; color: var(--panel-on-background-color, #2a3038);
        }
        .laying-out[hidden] { display: none; }
        """
    ]

    def __init__(self, on_shown: Callable[[], None], **params: Any) -> None:
        super().__init__(**params)
        self._on_shown = on_shown

    def _handle_msg(self, msg: dict[str, Any]) -> None:
        if msg["shown"] == self.words:
            self._on_shown()
