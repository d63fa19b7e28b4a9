"""Live depth sensors: opened by URI, recorded without loss, tracked with the newest frame winning (docs/live.md)."""

from spf.live.feed import Feed, FeedState, Taken
from spf.live.opening import SENSORS, is_live, open_live
from spf.live.recorder import Recorder, Recording
from spf.live.source import About, Capture, LiveSource

__all__ = [
    "SENSORS",
    "About",
    "Capture",
    "Feed",
    "FeedState",
    "LiveSource",
    "Recorder",
    "Recording",
    "Taken",
    "is_live",
    "open_live",
]
