"""Trackers side by side on one session: the same starts, the same observations, the same measures."""

from spf.compare.comparison import COMPARISON, Comparison, check_free, compare, prepare_comparison
from spf.compare.contender import Contender, contenders_of
from spf.compare.figure import draw_success
from spf.compare.table import table

__all__ = [
    "COMPARISON",
    "Comparison",
    "Contender",
    "check_free",
    "compare",
    "contenders_of",
    "draw_success",
    "prepare_comparison",
    "table",
]
