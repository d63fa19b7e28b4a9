"""Where a search begins: the places that the network suggests."""

from __future__ import annotations

import numpy as np

from spf.learned.guesses import Guess
from spf.locate import _places


def _guess(x: float, sigma: float, log_weight: float) -> Guess:
    pose = np.zeros(26)
    pose[0] = x
    return Guess("right", 1.0, pose, np.eye(3), np.zeros((21, 3)), np.full(21, sigma), log_weight, 1.0)


def test_the_place_of_sure_joints_is_not_crowded_out_by_places_where_the_network_knows_nothing():
    """Weights tell hypotheses of one cube from each other, and say nothing between cubes."""
    arms = [_guess(0.2 * number, 0.03, -0.1) for number in range(1, 6)]
    hand = [_guess(-0.3, 0.006, -0.8), _guess(-0.31, 0.007, -1.2)]
    places = _places([*arms, *hand])
    assert places[0] == hand
    assert len(places) == 3
