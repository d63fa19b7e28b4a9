"""What is changed reaches the browser whole and in the order in which it was changed, also over a busy connection."""

import asyncio
import json
import time

import panel as pn
import panel.io.document
import pytest
from bokeh.client import pull_session
from bokeh.document.events import MessageSentEvent
from bokeh.events import DocumentReady
from bokeh.models import Range1d
from bokeh.models.widgets import Checkbox
from bokeh.plotting import figure
from tornado.websocket import WebSocketHandler

from app.sending import keep_order
from app.state import State
from app.views.follower import Follower


class Line(Follower):
    """A plot that is drawn when the preview changes."""

    def __init__(self, state):
        super().__init__(state, mode=None)
        self.figure = figure(x_range=Range1d(0, 1))
        self.pane = pn.pane.Bokeh(self.figure)

    def draw(self):
        self.figure.x_range.end = 7


def page():
    """A switch that adds a plot and has it drawn while something else is being sent."""
    state, column, add = State(), pn.Column(), pn.widgets.Checkbox()

    async def added(_event):
        (connection,) = pn.state.curdoc.session_context.session._subscribed_connections
        with await connection._socket.write_lock.acquire():
            column.append(Line(state).pane)
            state.previewed += 1

    add.param.watch(added, "value")
    return pn.Column(add, column)


def visit(address):
    session = pull_session(url=address)
    session.document.callbacks.trigger_on_change(MessageSentEvent(session.document, "bokeh_event", DocumentReady()))
    session.force_roundtrip()
    session.document.select_one({"type": Checkbox}).active = True
    session.force_roundtrip()
    time.sleep(0.5)
    session.close()


@pytest.fixture
def sent(monkeypatch):
    """Everything that a server writes to its connections, in order."""
    pieces, write = [], WebSocketHandler.write_message

    def noted(self, message, binary=False):
        pieces.append(message)
        return write(self, message, binary)

    monkeypatch.setattr(WebSocketHandler, "write_message", noted)
    return pieces


def test_changes_over_a_busy_connection_arrive_whole_and_in_order(sent, monkeypatch):
    monkeypatch.setattr(panel.io.document, "schedule_write_events", panel.io.document.schedule_write_events)
    keep_order()

    async def served():
        server = pn.serve(page, port=0, address="127.0.0.1", show=False, start=False)
        server.start()
        try:
            await asyncio.to_thread(visit, f"http://127.0.0.1:{server.port}/")
        finally:
            server.stop()

    asyncio.run(served())
    changes = [event for piece in sent if '"events"' in str(piece) for event in json.loads(piece)["events"]]
    assert [event["attr"] for event in changes if "attr" in event] == ["children", "end"]
