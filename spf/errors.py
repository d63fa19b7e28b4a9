"""The errors that a user can cause, each one sentence that says what is wrong and what to do."""

__all__ = [
    "HandError",
    "RenderError",
    "RenderUnavailableError",
    "RunError",
    "SensorError",
    "SessionError",
    "SettingError",
    "SpfError",
    "StartError",
]


class SpfError(Exception):
    """Base of all errors that the command line and the dashboard show as one sentence."""


class SessionError(SpfError):
    """A session cannot be opened, read or written."""


class SensorError(SpfError):
    """A live sensor is missing, busy, lost or may not be used; most of the time it can be connected to again."""


class SettingError(SpfError, ValueError):
    """A setting is unknown, not a number or out of its range."""


class HandError(SpfError):
    """A hand model, a hand shape or a pose does not fit."""


class StartError(SpfError):
    """No believable first pose could be found."""


class RunError(SpfError):
    """A run directory (track and manifest) cannot be written, read or repeated."""


class RenderError(SpfError):
    """A picture could not be drawn; the next one may be."""


class RenderUnavailableError(RenderError):
    """This machine cannot draw three-dimensional pictures until something is installed."""
