"""A page without a browser: its state and its controller."""

import asyncio

import pytest

from app.controller import Controller
from app.runner import Runner
from app.server import bundled
from app.state import State
from tests.app.test_browser import serving


@pytest.fixture(scope="session")
def shelf(tmp_path_factory):
    """The folder of the runs of the server that the browser tests share."""
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="session")
def server(tmp_path_factory, shelf):
    """The address of a server that the browser tests share, and its log so far."""
    log = tmp_path_factory.mktemp("server") / "log"
    with serving(log, shelf) as address:
        yield address, log


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
