"""A tour of the page in five steps, offered at the first visit; it says what to do, and frames where."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import param
from panel.custom import JSComponent

__all__ = ["STEPS", "Step", "Tour"]


class Step(NamedTuple):
    """A step: title, one or two sentences, and the name of the part of the page that is framed meanwhile."""

    title: str
    words: str
    part: str


STEPS = (
    Step("A session", "A recording of depth images is open already. Choose another here, or open your own: a path, or an upload.",
         "session"),
    Step("A start", "Press Start: the hand, its side and its size are found in the depth. This takes some seconds.", "start"),
    Step("Step and play", "Step tracks one frame, Play goes on. Drag the line to go back; press ? for all keys.", "transport"),
    Step("See and tune", "Turn the pictures with the mouse. Move k, μ, N or h on the left: the frame shown answers at once.",
         "settings"),
    Step("Compare, keep, share", "Compare sets trackers beside each other. Runs are kept by themselves; Export makes a report "
         "of one. Help, above, explains the method.", "export"),
)  # fmt: skip

_ROOM = {"padding-top": "8px"}  # between the frame and the label of a part's first field, which stands above its field
_FRAME = {**_ROOM, "outline": "3px solid #e69f00", "outline-offset": "-3px", "border-radius": "6px"}
_NO_FRAME = {**_ROOM, "outline": "none"}  # said, for a style that is left out stays in the browser


class Tour(JSComponent):
    """A small card in a corner of the page; that it was seen is kept in the browser, nowhere else.

    Args:
        parts: the panels of the page that steps name.
    """

    steps: list[Any] = param.List([step._asdict() for step in STEPS])
    asked: int = param.Integer(0, doc="counts how often the tour was asked for")

    _esm = """
    export function render({ model }) {
      const seen = () => { try { return localStorage.getItem('spf-tour') === 'seen'; } catch { return true; } };
      const remember = () => { try { localStorage.setItem('spf-tour', 'seen'); } catch { /* a private window forgets */ } };
      let step = -1;
      const card = document.createElement('section');
      card.className = 'tour-card';
      card.setAttribute('role', 'dialog');
      card.setAttribute('aria-label', 'Tour');
      card.innerHTML = `<p class="where"></p><h2></h2><p class="words" aria-live="polite"></p>
        <div><button class="skip">Skip</button><span></span><button class="back">Back</button>
        <button class="next"></button></div>`;
      const part = (name) => card.querySelector(name);
      const go = (next) => {
        step = next;
        card.hidden = step < 0;
        model.send_msg({ step });
        if (step < 0) return;
        const { title, words } = model.steps[step], last = step + 1 === model.steps.length;
        part('.where').textContent = `Step ${step + 1} of ${model.steps.length}`;
        part('h2').textContent = title;
        part('.words').textContent = words;
        part('.back').disabled = step === 0;
        part('.next').textContent = last ? 'Done' : 'Next';
      };
      const end = () => { remember(); go(-1); };
      part('.skip').onclick = end;
      part('.back').onclick = () => go(step - 1);
      part('.next').onclick = () => (step + 1 === model.steps.length ? end() : go(step + 1));
      card.addEventListener('keydown', (event) => {
        event.stopPropagation();  // the page has keys of its own
        if (event.key === 'Escape') end();
      });
      model.on('asked', () => { go(0); part('.next').focus(); });
      card.hidden = true;
      if (!seen()) go(0);
      return card;
    }
    """

    _stylesheets: ClassVar[list[str]] = [
        """
        .tour-card { position: fixed; right: 24px; bottom: 24px; z-index: 1300; width: 330px; padding: 14px 18px;
                border-radius: 10px;
                background: #1f2a36; color: #f2f5f8; box-shadow: 0 6px 28px rgba(0, 0, 0, .4);
                font: 14px/1.5 Roboto, sans-serif; }
        .tour-card[hidden] { display: none; }
        .tour-card h2 { font-size: 17px; font-weight: 500; margin: 2px 0 6px; }
        .tour-card p { margin: 0 0 12px; }
        .tour-card .where { font-size: 12px; margin: 0; color: #b9c6d2; }
        .tour-card div { display: flex; gap: 8px; align-items: center; }
        .tour-card span { flex: 1; }
        .tour-card button { font: inherit; padding: 4px 14px; border-radius: 5px; border: 1px solid #8fa3b5; background: none;
                       color: inherit; cursor: pointer; }
        .tour-card button.next { background: #f2f5f8; color: #1f2a36; border-color: #f2f5f8; }
        .tour-card button:disabled { opacity: .45; cursor: default; }
        .tour-card button:focus-visible { outline: 2px solid #e69f00; outline-offset: 2px; }
        """
    ]

    def __init__(self, parts: Mapping[str, Any], **params: Any) -> None:
        super().__init__(**params)
        self._parts = dict(parts)
        self._frame("")

    def begin(self) -> None:
        """Show the first step, whether the tour was seen or not."""
        self.asked += 1

    def _handle_msg(self, msg: dict[str, Any]) -> None:
        step = int(msg["step"])
        self._frame(STEPS[step].part if 0 <= step < len(STEPS) else "")

    def _frame(self, framed: str) -> None:
        """Frame a part; "" for none. No part moves when its frame comes or goes."""
        for name, panel in self._parts.items():
            panel.styles = _FRAME if name == framed else _NO_FRAME
