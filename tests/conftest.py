"""Fixtures that every test may use."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from spf.errors import RenderUnavailableError
from spf.render import Renderer

# No deadlines: a test says nothing about time. Derandomised: a red run is red again when it is repeated.
settings.register_profile("spf", deadline=None, derandomize=True)
settings.load_profile("spf")

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Captured depth: the folder named by SPF_DATA, else ``shared/data`` beside the checkout; skips without one."""
    named = os.environ.get("SPF_DATA")
    folder = Path(named) if named else REPOSITORY.parent / "shared" / "data"
    if named and not folder.is_dir():
        pytest.fail(f"SPF_DATA names {folder}, which is not a folder")
    if not folder.is_dir():
        pytest.skip("no captured depth here: set SPF_DATA to a folder that has it")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20070901)


@pytest.fixture(scope="session")
def renderer() -> Iterator[Renderer]:
    """A renderer that the tests share; skips where nothing can draw."""
    with Renderer() as shared:
        try:
            shared.opengl().result()
        except RenderUnavailableError as error:
            pytest.skip(str(error))
        yield shared
