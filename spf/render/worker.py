"""The renderer's own process: ``python -m spf.render.worker WINDOW_CLASS``; stdin takes requests, stdout gives replies.

A process, because a machine without OpenGL answers VTK's first picture with a crash, not with an error, and because a
crash later must not take the server down. Everything is pickled; both ends are this program.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from spf.render.protocol import Encoding, OpenGL, Reply, Request

__all__ = ["first_picture", "main"]


def main(window_class: str) -> None:
    """Say hello with an :class:`OpenGL` once a first picture is drawn, then answer requests until stdin closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then closes stdin
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what libraries print must not get among the replies
    if window_class:
        os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = window_class
    _send(replies, first_picture())

    from spf.render.stage import Stage  # PyVista takes seconds to import: not before the hello

    stage = Stage()
    while True:
        try:
            request = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        _send(replies, _answer(stage, request))


def first_picture() -> OpenGL:
    """Draw a few pixels with bare VTK and look at them; without OpenGL this crashes or raises RuntimeError."""
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  # registers the window classes
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
    from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetSize(8, 8)
    renderer.SetBackground(1.0, 0.0, 0.0)
    window.AddRenderer(renderer)
    window.Render()
    pixels = vtkUnsignedCharArray()
    window.GetPixelData(0, 0, 7, 7, 0, pixels, 0)
    if not (vtk_to_numpy(pixels).reshape(64, 3) == [255, 0, 0]).all():
        raise RuntimeError("OpenGL drew a blank picture")
    capabilities = str(window.ReportCapabilities()).splitlines()
    driver = next((line.partition(":")[2].strip() for line in capabilities if "renderer string" in line), "unknown")
    return OpenGL(window.GetClassName(), driver)


def _answer(stage: Any, request: Request) -> Reply:
    try:
        pixels = stage.draw(request.scene, request.view, request.size, request.smooth)
        return Reply(_encode(pixels, request.encoding, request.quality))
    except Exception as error:  # handed on: the parent raises it for whoever asked
        return Reply(None, f"{type(error).__name__}: {error}")


def _encode(pixels: NDArray[np.uint8], encoding: Encoding, quality: int) -> NDArray[np.uint8] | bytes:
    if encoding == "rgb":
        return pixels
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if encoding == "jpeg" else [cv2.IMWRITE_PNG_COMPRESSION, 3]
    suffix = {"jpeg": ".jpg", "png": ".png"}[encoding]
    ok, encoded = cv2.imencode(suffix, cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), options)
    if not ok:
        raise RuntimeError(f"the picture could not be written as {encoding}")
    return encoded.tobytes()


def _send(stream: BinaryIO, value: OpenGL | Reply) -> None:
    pickle.dump(value, stream, protocol=pickle.HIGHEST_PROTOCOL)
    stream.flush()


if __name__ == "__main__":
    main(sys.argv[1])
