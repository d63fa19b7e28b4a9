"""The renderer: scenes in, pictures out, from any thread."""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from spf.errors import RenderError, RenderUnavailableError
from spf.render.process import RenderProcess
from spf.render.protocol import Encoding, OpenGL, Request
from spf.render.scene import Scene
from spf.render.view import ViewCamera

__all__ = ["Renderer"]

Size = tuple[int, int]
_log = logging.getLogger(__name__)


class Renderer:
    """Draws scenes off-screen in a process of its own, one after the other, in the order they were submitted.

    The process starts at once, in the background. When it dies, the picture being drawn fails with a
    :class:`RenderError` and the next one starts a new process. On a machine without OpenGL every picture fails at once
    with :class:`RenderUnavailableError`, whose sentence is for the user. Close it, or use it in a ``with``.

    Args:
        timeout: seconds after which a silent process is ended.
    """

    def __init__(self, timeout: float = 60.0) -> None:
        self._timeout = timeout
        self._process: RenderProcess | None = None
        self._unavailable: RenderUnavailableError | None = None
        # One thread: it alone talks to the process. `Future.cancel` works on what still waits for it.
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="spf-render")
        self._opengl = self._thread.submit(lambda: self._running().opengl)

    def opengl(self) -> Future[OpenGL]:
        """Return what draws, known once the process is up; raises :class:`RenderUnavailableError` where nothing can."""
        return self._opengl

    def submit(
        self,
        scene: Scene,
        view: ViewCamera,
        size: Size = (640, 480),
        *,
        encoding: Encoding = "rgb",
        quality: int = 80,
        smooth: bool = False,
    ) -> Future[Any]:
        """Queue a picture; ``asyncio.wrap_future`` makes the result awaitable.

        Args:
            scene: what to draw.
            view: where from.
            size: (width, height) in pixels.
            encoding: ``"rgb"`` for a (height, width, 3) uint8 array, ``"jpeg"`` or ``"png"`` for the bytes of a file.
            quality: of a JPEG, 1 to 100.
            smooth: smooth edges, for stills; takes about three times as long.

        Returns:
            A future that raises :class:`RenderError` if the process died meanwhile, :class:`RenderUnavailableError`
            where this machine cannot draw.

        Raises:
            RenderError: the renderer is closed.
            ValueError: the size, the quality or the view is out of range.
        """
        if not all(1 <= side <= 8192 for side in size):
            raise ValueError(f"a picture of {size[0]}×{size[1]} pixels cannot be drawn; sides go from 1 to 8192")
        if not 1 <= quality <= 100:
            raise ValueError(f"quality is {quality}, expected 1 to 100")
        view.placement()
        try:
            return self._thread.submit(self._draw, Request(scene, view, size, encoding, quality, smooth))
        except RuntimeError:
            raise RenderError("The renderer is closed.") from None

    def picture(
        self, scene: Scene, view: ViewCamera, size: Size = (640, 480), *, smooth: bool = False
    ) -> NDArray[np.uint8]:
        """Return the (height, width, 3) RGB picture of a scene; see :meth:`submit`."""
        pixels: NDArray[np.uint8] = self.submit(scene, view, size, smooth=smooth).result()
        return pixels

    def jpeg(
        self, scene: Scene, view: ViewCamera, size: Size = (640, 480), *, quality: int = 80, smooth: bool = False
    ) -> bytes:
        """Return the picture of a scene as a JPEG file; see :meth:`submit`."""
        file: bytes = self.submit(scene, view, size, encoding="jpeg", quality=quality, smooth=smooth).result()
        return file

    def png(self, scene: Scene, view: ViewCamera, size: Size = (640, 480), *, smooth: bool = True) -> bytes:
        """Return the picture of a scene as a PNG file; see :meth:`submit`."""
        file: bytes = self.submit(scene, view, size, encoding="png", smooth=smooth).result()
        return file

    def close(self) -> None:
        """Finish the picture being drawn, cancel those that wait, and end the process. Closing twice is fine."""
        self._thread.shutdown(wait=True, cancel_futures=True)
        if self._process is not None:
            self._process.stop()
            self._process = None

    def __enter__(self) -> Self:
        """Return the renderer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the renderer."""
        self.close()

    def _running(self) -> RenderProcess:
        if self._unavailable is not None:
            raise self._unavailable.with_traceback(None)
        if self._process is not None and not self._process.alive:
            _log.warning("The renderer's process ended between two pictures; starting a new one.")
            self._process.stop()
            self._process = None
        if self._process is None:
            try:
                self._process = RenderProcess.start(self._timeout)
            except RenderUnavailableError as error:
                self._unavailable = error
                _log.warning("%s\n%s", error, "\n".join(error.__notes__))
                raise
        return self._process

    def _draw(self, request: Request) -> NDArray[np.uint8] | bytes:
        try:
            reply = self._running().ask(request, self._timeout)
        except RenderError:
            self._process = None
            raise
        if reply.picture is None:
            raise RenderError(f"The picture could not be drawn: {reply.error}.")
        return reply.picture
