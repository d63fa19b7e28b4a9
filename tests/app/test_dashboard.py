"""The layout of a page: the server holds nothing of it, so that its memory is free when the page is gone."""

from __future__ import annotations

import panel as pn
from bokeh.document import Document
from panel.io.state import set_curdoc

from app.dashboard import page


def test_the_server_holds_no_page():
    def followers():
        return list(pn.state.param.watchers.get("busy", {}).get("value", ()))

    before = followers()
    with set_curdoc(Document()):
        page()
    assert followers() == before
