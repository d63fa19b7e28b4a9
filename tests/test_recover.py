"""A hand that is lost is found again, and one that the tracker mistakes something else for is noticed by the network."""

import numpy as np
import pytest

from benchmarks.holds.kidnaps import kidnapped
from benchmarks.holds.sessions import session_settings
from spf.hand.kinematics import joints_of, pose_hand, relative_to_camera
from spf.hand.model import load_hand
from spf.learned.guesses import Guess, extent_of, guesses
from spf.learned.network import available_network
from spf.locate import _ABSENT, _AROUND, _LOOKS, _looks, seen_at, strangeness_to
from spf.prepare import prepare
from spf.recover import _places, recover, unlikely
from spf.synthetic import synthesise
from spf.synthetic.clutter import _forearm_mesh
from spf.track import begin, track_frame
from spf.trackers import make_settings

needs_network = pytest.mark.skipif(available_network()[0] is None, reason="the network or its runtime is missing")


def error_of(result, frame):
    return float(np.linalg.norm(result.joints - frame.truth.joints, axis=1).mean())


@needs_network
@pytest.mark.parametrize(("kind", "number"), [("medium", 4), ("body", 1)])
def test_a_hand_that_jumps_is_held_at_once_and_not_taken_for_what_is_now_where_it_was(kind, number):
    at = 3
    session = kidnapped(synthesise(session_settings(kind, number, 8)), at, np.random.default_rng([number, 11]))
    start = prepare(session, init="truth", seed=0)
    tracking, state = begin("spf", make_settings("spf"), start, 0, time=float(session.times[0]))
    errors = []
    for frame in session:
        state, result = track_frame(tracking, state, frame)
        errors.append(error_of(result, frame))
        assert not result.lost
    assert np.linalg.norm(session[at].truth.joints - session[at - 1].truth.joints, axis=1).mean() > 0.1
    assert max(errors[at + 2 :]) < 0.02


def test_the_network_looks_at_both_ends_of_what_is_there(rng):
    arm = np.column_stack([np.linspace(-0.3, 0.3, 500), *rng.normal(scale=0.01, size=(2, 500))])
    places = _looks(arm)
    assert len(places) <= _LOOKS
    for end in (arm[0], arm[-1]):
        assert np.linalg.norm(places - end, axis=1).min() < _AROUND
    ball = rng.normal(scale=0.01, size=(300, 3))
    assert len(_looks(ball)) == 1


def test_nothing_is_strange_to_a_network_that_is_not_asked():
    assert strangeness_to([], load_hand("right"), np.zeros((21, 3))) == 0.0


def test_a_place_where_the_network_sees_no_hand_is_strange_however_well_a_hand_fits_there():
    hand = load_hand("right")
    joints = joints_of(hand, np.zeros(hand.dofs))
    seen = Guess("right", 1.0, np.zeros(hand.dofs), np.eye(3), joints, np.full(21, 0.01), 0.0, presence=1.0)
    charges = [strangeness_to([seen._replace(log_weight=np.log(p))], hand, joints) for p in (1.0, 0.6, 0.1)]
    np.testing.assert_allclose(np.diff(charges), [0.4 * _ABSENT, 0.5 * _ABSENT])
    halves = [seen._replace(log_weight=np.log(0.5)) for _ in range(2)]
    assert strangeness_to(halves, hand, joints) == pytest.approx(0.0)


@needs_network
def test_the_network_sees_hands_and_no_elbows():
    network = available_network()[0]
    at_hand, at_elbow = [], []
    for number in range(6):
        session = kidnapped(synthesise(session_settings("body", number, 8)), 3, np.random.default_rng([number, 11]))
        frame, trajectory, hand = session[4], session.stage.trajectory, session.hand
        _, elbow = _forearm_mesh(hand, pose_hand(hand, trajectory.poses[4], trajectory.orientations[4]))
        pixel = frame.camera.project(elbow[None])[0]
        if (pixel < 0).any() or (pixel > (frame.camera.width, frame.camera.height)).any():
            continue
        for places, seen in ((frame.truth.joints.mean(axis=0), at_hand), (elbow, at_elbow)):
            found = guesses(network, frame.depth, frame.camera, places, extent_of(1.0), [hand.side])
            seen.append(max(guess.presence for guess in found))
    assert len(at_elbow) > 2
    assert np.median(at_hand) > 0.9
    assert np.median(at_elbow) < 0.3


@needs_network
def test_a_hand_is_lost_where_the_network_sees_none_however_well_it_is_rendered(monkeypatch):
    def blind(*arguments):
        return [guess._replace(presence=0.1) for guess in seen_at(*arguments)]

    session = synthesise(session_settings("slow", 0, 4))
    start = prepare(session, init="truth", seed=0)

    def run():
        tracking, state = begin("spf", make_settings("spf"), start, 0, time=float(session.times[0]))
        results = []
        for frame in session:
            state, result = track_frame(tracking, state, frame)
            results.append(result)
        return [result.lost for result in results], max(result.golden for result in results)

    assert run()[0] == [False] * 4
    monkeypatch.setattr("spf.track.seen_at", blind)
    monkeypatch.setattr("spf.locate.seen_at", blind)
    lost, golden = run()
    assert lost == [False, False, True, True]
    assert golden < 0.3


def test_a_pose_whose_digits_are_as_they_were_is_the_likelier_one():
    hand = load_hand("right")
    last = hand.constrain(hand.neutral_pose())
    bent = last.copy()
    bent[hand.dof_names.index("ring_pip_flexion")] += 1.0
    assert unlikely(last, last, 0.2) == 0.0
    assert 0.0 < unlikely(bent, last, 0.2) < 0.02
    bent[6:] += 0.5
    assert unlikely(bent, last, 0.2) > 0.04


@needs_network
def test_a_hand_is_looked_for_with_the_digits_that_it_was_lost_with_too():
    session = synthesise(session_settings("medium", 4, 2))
    frame, hand, last = session[1], session.hand, session.hand.neutral_pose()
    last[:3], last[6:] = session[0].truth.pose[:3], 0.2
    places = list(_places(available_network()[0], frame, hand, last))
    assert places
    for place in places:
        own, remembered = np.split(place.seeds.poses, 2)
        np.testing.assert_array_equal(own[:, :6], remembered[:, :6])
        np.testing.assert_array_equal(remembered[:, 6:], np.broadcast_to(last[6:], remembered[:, 6:].shape))
        assert np.abs(own[:, 6:] - last[6:]).max() > 0.05
        assert len(place.seeds.scales) == len(place.seeds.poses)


@needs_network
@pytest.mark.parametrize(("missing", "searched"), [(1, True), (2, True), (3, False), (5, False), (8, True), (48, True)])
def test_a_lost_hand_is_searched_for_in_some_frames_and_looked_for_in_all(missing, searched, monkeypatch, rng):
    session = kidnapped(synthesise(session_settings("medium", 4, 8)), 3, np.random.default_rng([4, 11]))
    before, frame, hand = session[2].truth, session[3], session.hand
    asked = []

    def counted(*arguments):
        asked.append(arguments)
        return []

    monkeypatch.setattr("spf.recover.locate", counted)
    last = relative_to_camera(before.pose, before.orientation)
    found = recover(frame, hand, 0.5, 0.5, last, 0.5, missing, available_network()[0], rng)
    if searched:
        assert asked
        assert found is None
    else:
        assert not asked
        assert np.linalg.norm(joints_of(hand, found) - frame.truth.joints, axis=1).mean() < 0.02
