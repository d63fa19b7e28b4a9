"""Messages to a browser go out in the order in which they were made, and all of them.

While a connection is busy, Panel 1.9 puts what it has to send aside and looks again every few milliseconds. What Bokeh
sends meanwhile overtakes it, and so speaks of plots that the browser has not been sent yet; and what Panel puts aside just
when it has sent the rest stays there until the next change. Here each message queues for the connection, as Bokeh's do.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Iterable
from typing import Any

import panel.io.document
from bokeh.document.events import DocumentPatchedEvent
from bokeh.server.connection import ServerConnection
from tornado.websocket import WebSocketClosedError

__all__ = ["keep_order"]

_on_their_way: set[asyncio.Task[None]] = set()  # so that nobody collects them


def keep_order() -> None:
    """Have Panel's messages queue for their connection, from now on and in the whole process."""
    panel.io.document.schedule_write_events = _queue


def _queue(_document: Any, connections: Iterable[ServerConnection], events: list[DocumentPatchedEvent]) -> None:
    """Take a place in the queue of each connection for what has just changed."""
    for connection in connections:
        message = connection.protocol.create("PATCH-DOC", events)
        turn = connection._socket.write_lock.acquire()
        task = asyncio.ensure_future(_send(connection, message, turn))
        _on_their_way.add(task)
        task.add_done_callback(_on_their_way.discard)


async def _send(connection: ServerConnection, message: Any, turn: Awaitable[Any]) -> None:
    with await turn:
        try:
            for written in panel.io.document.dispatch_tornado(connection, msg=message):
                await written
        except WebSocketClosedError:
            return  # the visitor has left, which Bokeh knows and says
