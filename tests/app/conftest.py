"""A page without a browser: its state and its controller."""

import asyncio

import pytest

from app.controller import Controller
from app.runner import Runner
from app.server import bundled
from app.state import State


@pytest.fixture(scope="module")
def shelf(tmp_path_factory):
    """The folder of a server's runs; they and its presets go where nobody's are."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("runs")
        patch.setenv("SPF_RUNS", str(folder))
        patch.setenv("SPF_PRESETS", str(tmp_path_factory.mktemp("presets")))
        yield folder


@pytest.fixture
def sample():
    """The path of a bundled session."""
    return bundled()["open-close"]


@pytest.fixture
def page():
    """(state, controller) that take the first pose from the truth."""
    state = State(init="truth")
    controller = Controller(state, Runner())
    yield state, controller
    controller.close()


@pytest.fixture
def act():
    """Does some actions of a controller, one after the other."""

    def act(*actions):
        async def all_of_them():
            for action in actions:
                await action()

        asyncio.run(all_of_them())

    return act
