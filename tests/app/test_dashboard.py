"""The layout of a page: the server holds nothing of it, so that its memory is free when the page is gone."""

from __future__ import annotations

import asyncio
import subprocess
import sys

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


def test_a_server_that_is_loaded_has_all_that_stays_out_of_the_way_of_its_garbage():
    program = (
        "import asyncio, gc, sys\n"
        "from app import app_hooks\n"
        "async def load():\n"
        "    app_hooks.kernels = app_hooks.renderer = lambda: None\n"
        "    app_hooks.on_server_loaded(None)\n"
        "asyncio.run(load())\n"
        "print('app.views.modes' in sys.modules, gc.get_freeze_count() > 100_000)\n"
    )
    said = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    assert said.split() == ["True", "True"]
