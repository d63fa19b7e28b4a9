"""The layout of a page: the server holds nothing of it, so that its memory is free when the page is gone."""

from __future__ import annotations

import asyncio

import panel as pn
from bokeh.document import Document
from panel.io.state import set_curdoc

from app.dashboard import page


def test_the_server_holds_no_page():
    def followers():
        return list(pn.state.param.watchers.get("busy", {}).get("value", ()))

    async def made():  # in a loop, for the page finds one or makes one that nobody closes
        with set_curdoc(Document()):
            page()

    before = followers()
    asyncio.run(made())
    assert followers() == before
