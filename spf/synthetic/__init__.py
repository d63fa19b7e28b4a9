"""Synthetic sessions with exact truth: motions × sensors × clutter × hand shapes, all seeded."""

from spf.synthetic.clutter import CLUTTER
from spf.synthetic.hands import SHAPES
from spf.synthetic.motions import MOTIONS
from spf.synthetic.sensors import SENSORS
from spf.synthetic.session import SyntheticSession, SyntheticSettings, synthesise

__all__ = ["CLUTTER", "MOTIONS", "SENSORS", "SHAPES", "SyntheticSession", "SyntheticSettings", "synthesise"]
