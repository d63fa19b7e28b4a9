"""What travels between the renderer and its process."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.render.scene import Scene
from spf.render.view import ViewCamera

__all__ = ["Encoding", "OpenGL", "Reply", "Request"]

Encoding = Literal["rgb", "jpeg", "png"]


class OpenGL(NamedTuple):
    """What draws: VTK's window class (EGL or OSMesa) and the name that the driver gives itself."""

    window: str
    driver: str


class Request(NamedTuple):
    """A picture that is asked for; ``size`` is (width, height) in pixels, ``quality`` JPEG's 1 to 100."""

    scene: Scene
    view: ViewCamera
    size: tuple[int, int]
    encoding: Encoding
    quality: int
    smooth: bool


class Reply(NamedTuple):
    """A picture, or the sentence that says why there is none."""

    picture: NDArray[np.uint8] | bytes | None
    error: str = ""
