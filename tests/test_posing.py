"""One frame's pose and hand by hand: where a hand is put first, and what fits make of it."""

import numpy as np
import pytest

from spf.errors import StartError
from spf.hand.handles import Stance
from spf.hand.kinematics import joints_of
from spf.hand.shape import HandShape
from spf.posing import calibrated_from, explained, first_stance, fitted_from, open_hand
from spf.prepare import SessionFrames
from spf.sessions import open_session
from tests.conftest import REPOSITORY
from tests.made_runs import made_session

SESSION = made_session(frames=16)
FRAME = SESSION[0]
SHAPE = HandShape.from_dict(SESSION.hand_shape)


def true_stance(frame=FRAME):
    orientation = np.eye(3) if frame.truth.orientation is None else frame.truth.orientation
    return Stance(frame.truth.pose, orientation)


def error(shape, stance, frame=FRAME):
    return np.linalg.norm(joints_of(shape.hand(), *stance) - frame.truth.joints, axis=1).mean()


def test_an_open_hand_is_put_where_the_hand_is():
    stance = open_hand(FRAME, SHAPE)
    assert np.linalg.norm(stance.pose[:3] - FRAME.truth.pose[:3]) < 0.15
    assert explained(FRAME, SHAPE, stance) is not None
    empty = FRAME._replace(depth=np.zeros_like(FRAME.depth))
    assert open_hand(empty, SHAPE).pose[2] == pytest.approx(0.5)
    assert explained(empty, SHAPE, stance) is None


def test_the_suggestion_explains_the_frame(rng):
    found = explained(FRAME, SHAPE, first_stance(FRAME, SHAPE, rng))
    assert found is not None
    assert found.overlap > 0.5


def test_a_fit_mends_a_pose_and_leaves_none_worse(rng):
    pose, reference = true_stance()
    off = pose.copy()
    off[:3] += [0.012, -0.01, 0.01]
    off[[11, 15, 19]] += 0.3
    begun = Stance(SHAPE.hand().constrain(off), reference)
    said = []
    fitted = fitted_from(FRAME, SHAPE, begun, rng, lambda text, share: said.append((text, share)))
    assert error(SHAPE, fitted) < 0.5 * error(SHAPE, begun)
    assert explained(FRAME, SHAPE, fitted).golden <= explained(FRAME, SHAPE, begun).golden + 1e-9
    assert [share for _, share in said] == sorted(share for _, share in said)
    assert (fitted.pose[3:6] == 0).all()


def test_a_fit_where_nothing_is_says_what_to_do(rng):
    pose, reference = true_stance()
    away = pose.copy()
    away[2] += 3.0
    with pytest.raises(StartError, match="drag it over the hand"):
        fitted_from(FRAME, SHAPE, Stance(away, reference), rng)
    with pytest.raises(StartError, match="drag it over the hand"):
        calibrated_from([FRAME], SHAPE, Stance(away, reference), rng)


def test_the_shape_is_fitted_from_a_pose(rng):
    session = open_session(REPOSITORY / "sessions" / "open-close.mcap")
    right = HandShape.from_dict(session.hand_shape)
    large, said = right._replace(scale=1.2 * right.scale), []
    shape, stance = calibrated_from(
        SessionFrames(session), large, true_stance(session[0]), rng, lambda _text, share: said.append(share)
    )
    assert abs(shape.hand().length / right.hand().length - 1) < 0.1
    assert shape.side == right.side
    assert error(shape, stance, session[0]) < 0.015
    assert said == sorted(said)
    assert 0 <= said[0] <= said[-1] <= 1
