"""A run as files for other programs: its track as a table, pictures and films of its frames, its hand."""

from spf.export.film import write_film
from spf.export.hands import write_hand
from spf.export.pictures import VIEWS, View, hand_scene, hand_view, row_skeletons, write_picture
from spf.export.tables import write_table

__all__ = [
    "VIEWS",
    "View",
    "hand_scene",
    "hand_view",
    "row_skeletons",
    "write_film",
    "write_hand",
    "write_picture",
    "write_table",
]
