"""A page without a browser: its state and its controller."""

import asyncio

import pytest

from app.controller import Controller
from app.runner import Runner
from app.server import bundled
from app.state import State
from tests.app.test_browser import make_server, make_shelf

# The browser tests share a server; a module whose runs must be nobody else's makes one of its own from the same functions.
shelf = pytest.fixture(scope="session", name="shelf")(make_shelf)
server = pytest.fixture(scope="session", name="server")(make_server)


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
