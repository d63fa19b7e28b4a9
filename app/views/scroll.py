"""Where each mode of the page was scrolled to: left and come back to, it is there again; a new one begins at its top."""

from __future__ import annotations

import param
from panel.custom import JSComponent

__all__ = ["Scroll"]


class Scroll(JSComponent):
    """Takes no room. The modes share what is scrolled, which a browser leaves where the last one was.

    It has to hear of another mode before the parts of the page do, while what is left is still in its place.
    """

    place: str = param.String(doc="the mode that is seen")

    _esm = """
    const HOLD = 1500;  // ms in which what comes back is laid out, and grows to the height that it had

    export function render({ model }) {
      const element = document.createElement('span'), kept = {};
      let here = model.place, round = 0;
      const scrolled = () => {
        for (let it = element; it; it = it.parentNode ?? it.host) if (it.classList?.contains('main-content')) return it;
        return null;
      };
      const give_up = () => { round += 1; };
      const hold = (box, wanted, until, mine) => {
        if (mine !== round) return;
        if (box.scrollTop !== wanted) box.scrollTop = wanted;
        if (performance.now() < until) requestAnimationFrame(() => hold(box, wanted, until, mine));
      };
      const by_hand = ['wheel', 'touchstart', 'pointerdown', 'keydown'];
      by_hand.forEach((kind) => window.addEventListener(kind, give_up, { capture: true, passive: true }));
      model.on('place', () => {
        const box = scrolled();
        if (!box) return;
        kept[here] = box.scrollTop;
        here = model.place;
        round += 1;
        if (kept[here]) hold(box, kept[here], performance.now() + HOLD, round);
        else box.scrollTop = 0;
      });
      model.on('remove', () => by_hand.forEach((kind) => window.removeEventListener(kind, give_up, { capture: true })));
      return element;
    }
    """
