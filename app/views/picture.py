"""A picture in the browser: bytes in, drags and turns of the wheel out."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from typing import Any, ClassVar
from uuid import uuid4

import param
from panel.custom import JSComponent

__all__ = ["Picture"]


class Picture(JSComponent):
    """Shows an encoded picture; reports when it is on the screen, and how the mouse wants to turn it.

    Args:
        on_shown: called when a new picture is on the screen, or all those of its ``group`` that came with it.
        on_orbit: called with angles in radians to the right and up, and a factor of magnification.
        on_pan: called with a way to the right and up, in heights of the picture.
        on_reset: called after a double click.
    """

    source: str = param.String("", doc="data URL of a picture, or nothing: a blob costs the browser much more")
    hint: str = param.String("", doc="what is said while there is no picture")
    alt: str = param.String("", doc="what the picture shows, for who cannot see it")
    turns: bool = param.Boolean(False, doc="whether the mouse orbits")
    group: str = param.String(
        "", doc='of the pictures that are sent together, and answered together; "" is not answered'
    )

    _esm = """
    const loading = new Map();  // group → how many of its pictures are on their way to the screen

    export function render({ model }) {
      const frame = document.createElement('div');
      frame.className = 'picture-frame';
      const img = document.createElement('img');
      const hint = document.createElement('div');
      hint.className = 'picture-hint';
      frame.append(img, hint);
      let isLoading = false, answered = () => {};
      const begun = () => {
        if (isLoading || !model.group) return;
        isLoading = true;
        loading.set(model.group, (loading.get(model.group) || 0) + 1);
      };
      const ended = () => {
        if (!isLoading) return;
        isLoading = false;
        loading.set(model.group, loading.get(model.group) - 1);
        if (!loading.get(model.group)) model.send_msg({ kind: 'shown' });  // one answer for all: messages are dear
      };
      const say = () => {
        img.style.visibility = model.source ? 'visible' : 'hidden';
        hint.style.display = model.source || !model.hint ? 'none' : 'flex';
        hint.textContent = model.hint;
        img.alt = model.alt;
      };
      const show = () => {
        say();
        if (!model.source) { ended(); return; }
        begun();
        img.onload = img.onerror = () => {
          frame.dataset.shown = String(Number(frame.dataset.shown || 0) + 1);
          ended();
          answered();
        };
        img.src = model.source;
      };
      model.on('source', show);
      model.on('hint', say);
      model.on('remove', ended);
      show();
      if (!model.turns) return frame;

      // Movements add up while the server draws; the sum is sent when its picture has arrived, or after a while.
      let right = 0, up = 0, magnify = 1, aside = 0, above = 0, waiting = false, timer = null;
      const send = () => {
        const turned = right !== 0 || up !== 0 || magnify !== 1, moved = aside !== 0 || above !== 0;
        if (waiting || !(turned || moved)) return;
        if (turned) model.send_msg({ kind: 'orbit', right, up, magnify });
        if (moved) model.send_msg({ kind: 'pan', right: aside, up: above });
        right = 0; up = 0; magnify = 1; aside = 0; above = 0; waiting = true;
        timer = setTimeout(() => answered(), 300);
      };
      answered = () => { clearTimeout(timer); waiting = false; send(); };
      frame.classList.add('turns');
      frame.addEventListener('pointerdown', (e) => { frame.setPointerCapture(e.pointerId); e.preventDefault(); });
      frame.addEventListener('pointermove', (e) => {
        if (!frame.hasPointerCapture(e.pointerId)) return;
        if (e.shiftKey || (e.buttons & 6)) {  // the right or the middle button
          const height = img.clientHeight || 1;
          aside += e.movementX / height; above -= e.movementY / height;
        } else {
          right -= e.movementX * 0.01; up += e.movementY * 0.01;
        }
        send();
      });
      frame.addEventListener('contextmenu', (e) => e.preventDefault());
      frame.addEventListener('wheel', (e) => {
        e.preventDefault(); magnify *= Math.exp(-e.deltaY * 0.0015); send();
      }, { passive: false });
      frame.addEventListener('dblclick', () => model.send_msg({ kind: 'reset' }));
      return frame;
    }
    """

    _stylesheets: ClassVar[list[str]] = [
        """
        :host { display: block; }
        /* A layer of its own: a new picture has nothing else laid out or painted anew. */
        .picture-frame { position: relative; width: 100%; height: 100%; background: #2a3038; border-radius: 6px;
                         overflow: hidden; touch-action: none; contain: strict; will-change: transform; }
        .picture-frame.turns { cursor: grab; }
        .picture-frame.turns:active { cursor: grabbing; }
        .picture-frame img { position: absolute; inset: 0; width: 100%; height: 100%; object-fit: contain;
                             user-select: none; pointer-events: none; }
        .picture-hint { position: absolute; inset: 0; display: flex; align-items: center; justify-content: center;
                        text-align: center; padding: 24px; color: #c9d1da; font: 14px/1.5 Roboto, sans-serif; }
        """
    ]

    def __init__(
        self,
        on_shown: Callable[[], None] | None = None,
        on_orbit: Callable[[float, float, float], None] | None = None,
        on_pan: Callable[[float, float], None] | None = None,
        on_reset: Callable[[], None] | None = None,
        **params: Any,
    ) -> None:
        if on_shown is not None:
            params.setdefault("group", uuid4().hex)
        super().__init__(turns=on_orbit is not None, **params)
        self._shown, self._orbit, self._pan, self._reset = on_shown, on_orbit, on_pan, on_reset

    def show(self, content: bytes) -> None:
        """Show a JPEG file, or the hint where there is nothing."""
        self.source = f"data:image/jpeg;base64,{b64encode(content).decode()}" if content else ""

    def _handle_msg(self, msg: dict[str, Any]) -> None:
        if msg["kind"] == "shown" and self._shown is not None:
            self._shown()
        elif msg["kind"] == "orbit" and self._orbit is not None:
            self._orbit(float(msg["right"]), float(msg["up"]), float(msg["magnify"]))
        elif msg["kind"] == "pan" and self._pan is not None:
            self._pan(float(msg["right"]), float(msg["up"]))
        elif msg["kind"] == "reset" and self._reset is not None:
            self._reset()
