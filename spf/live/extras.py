"""Packages that only live sensors need: imported when a sensor is opened, and named when they are missing."""

from __future__ import annotations

import importlib
from types import ModuleType

from spf.errors import SensorError

__all__ = ["import_extra"]


def import_extra(module: str, extra: str) -> ModuleType:
    """Import a package of an extra.

    Args:
        module: its name.
        extra: of the project's distribution.

    Raises:
        SensorError: it is not installed or does not load.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise SensorError(
            f"{module} does not load ({error}): install it with uv pip install 'smart-particle-filter[{extra}]'."
        ) from error
