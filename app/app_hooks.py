"""What a server does before the first page is asked for: compile the kernels, start the renderer, keep order."""

import asyncio
import gc
from typing import Any

from tornado.ioloop import IOLoop
from tornado.websocket import WebSocketClosedError

import app.dashboard  # noqa: F401 - before the first visitor waits for it
from app.sending import keep_order
from app.server import kernels, renderer


def on_server_loaded(_server_context: Any) -> None:
    """Begin the first two in the background.

    What has been imported by now stays: a look for garbage, during which nobody is answered, need not go through it.
    """
    keep_order()
    kernels()
    renderer()
    gc.freeze()
    IOLoop.current().asyncio_loop.set_exception_handler(_tell)  # type: ignore[attr-defined]


def _tell(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Log what went wrong in a task that nobody waits for.

    Who leaves a page while a message is on its way to it is no error: Bokeh knows and says so, but leaves tornado's task behind.
    """
    if not isinstance(context.get("exception"), WebSocketClosedError):
        loop.default_exception_handler(context)
