"""Live depth sensors: opened by URI, recorded without loss (docs/live.md); ``spf.live.tracking`` tracks them.

This package's own names need no tracker: a headless box that only records or sends imports nothing else.
"""

from spf.live.feed import Feed
from spf.live.feed_state import FeedState, Taken
from spf.live.opening import SENSORS, is_live, is_meant_live, open_live
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
    "is_meant_live",
    "open_live",
]
