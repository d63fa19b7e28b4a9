"""A long recording is opened beside the page: how far that is is shown, and it can be cancelled."""

from __future__ import annotations

import asyncio
import re
import threading
import time
from pathlib import Path

from app.server import open_shared


def test_how_far_the_opening_of_a_recording_is_is_shown(page, sample, act):
    state, controller = page
    shown = []

    def opener(uri, camera, report):
        time.sleep(0.2)
        report("Reading the time stamps", 0.25)
        time.sleep(0.3)  # the page looks ten times a second
        return open_shared(uri, camera, report)

    controller.opener = opener
    state.param.watch(lambda event: shown.append((state.task, state.share)), "share")
    act(lambda: controller.open(sample))
    assert len(shown) > 1
    (text, share), *_ = shown
    assert share == 0.25
    assert re.fullmatch(rf"{Path(sample).name}: Reading the time stamps · about \d+ s left", text)
    assert (len(state.session), state.task, state.error) == (120, "", "")


def test_opening_a_recording_is_cancelled(page, sample):
    state, controller = page
    ended = threading.Event()

    def opener(uri, camera, report):
        try:
            while True:
                report("Reading the time stamps", 0.5)
                time.sleep(0.01)
        finally:
            ended.set()

    async def cancelled():
        controller.opener = opener
        opening = asyncio.create_task(controller.open("long.bag"))
        while not state.task.startswith("long.bag: Reading the time stamps"):
            await asyncio.sleep(0.01)
        controller.cancel()
        await opening

    asyncio.run(cancelled())
    assert ended.wait(10)  # the worker has noticed at its next report
    assert (state.session, state.task, state.error) == (None, "", "")
