"""What a visitor can do, on a bundled session, without a browser."""

import asyncio

import numpy as np
import pytest

import app.work
from app.views.depth import around_joints, depth_jpeg
from app.views.scenes import SCENES, view_of
from spf.frame import JOINT_NAMES
from spf.render import Skeleton, ViewCamera, depth_picture


def started(state, controller, sample, act):
    state.change("rounds", 2)  # quick: what is tracked does not matter here
    state.change("learned", False)  # N particles in every frame, none added by the network
    act(lambda: controller.open(sample), controller.start)
    assert state.error == ""


def test_opening_shows_the_first_frame(page, sample, act):
    state, controller = page
    act(lambda: controller.open(sample))
    assert (state.session.name, state.frame, state.origin, state.error) == ("open-close", 0, None, "")


@pytest.mark.parametrize("path", ["", "/no/such/session.mcap", __file__])
def test_a_path_that_is_no_session_is_one_sentence_and_the_old_session_stays(page, sample, act, path):
    state, controller = page
    act(lambda: controller.open(sample), lambda: controller.open(path))
    assert state.error.count("\n") == 0
    assert len(state.error) > 20
    assert "Traceback" not in state.error
    assert state.session.name == "open-close"
    assert not state.busy


def test_start_tracks_the_first_frame_and_step_the_next_ones(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    assert state.frame == state.origin.start.frame == 0
    act(controller.step, controller.step)
    assert state.frame == 2
    assert [summary.frame for summary in state.lane.results.summaries] == [0, 1, 2]
    assert all(np.isfinite(summary.error) for summary in state.lane.results.summaries)


def test_a_changed_setting_takes_effect_with_the_next_step(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    state.change("n", 7)
    act(controller.step)
    assert len(state.entry.result.info.predicted) == 7
    assert len(state.lane.results.entry(0).result.info.predicted) == 4


def test_a_jump_back_shows_the_stored_frame_and_a_step_shows_it_again(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    act(lambda: controller.jump(3))
    stored = state.lane.results.entry(1)
    act(lambda: controller.jump(0), controller.step)
    assert state.frame == 1
    assert state.entry is stored
    assert state.lane.results.last == 3


def test_a_step_shows_what_was_tracked_whatever_the_settings_are_now(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    act(lambda: controller.jump(3), lambda: controller.jump(0))
    stored = state.lane.results.entry(1)
    state.change("n", 2)
    act(controller.step)
    assert (state.frame, state.lane.results.last) == (1, 3)
    assert state.entry is stored


def test_the_same_frames_with_the_same_settings_are_the_same(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    act(controller.step)
    once = state.entry.result.pose
    act(controller.restart, controller.step)
    assert np.array_equal(state.entry.result.pose, once)


def test_playing_stops_when_paused_and_never_draws_two_frames_at_once(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    shown = []

    async def drawn():
        shown.append(state.frame)
        if len(shown) == 3:
            controller.pause()

    controller.drawn = drawn
    act(controller.play)
    assert shown == [1, 2, 3]
    assert not state.busy


def test_a_cancelled_jump_keeps_what_was_tracked(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)

    def cancel_at_two(event):
        if event.new == 2:
            controller.cancel()

    state.param.watch(cancel_at_two, "frame")
    act(lambda: controller.jump(50))
    assert state.lane.results.last == 2
    assert (state.busy, state.error) == (False, "")
    act(controller.step)
    assert state.frame == 3


def test_an_unexpected_error_is_a_sentence_in_the_page_and_a_traceback_in_the_log(
    page, sample, act, monkeypatch, caplog
):
    state, controller = page
    started(state, controller, sample, act)

    def broken(*_args, **_kwargs):
        raise RuntimeError("the moon is full")

    monkeypatch.setattr(app.work, "track_frame", broken)
    act(controller.step)
    assert "the moon is full" in state.error
    assert "Traceback" not in state.error
    assert caplog.records[-1].exc_info is not None
    assert state.lane.results.last == 0
    assert not state.busy


@pytest.mark.parametrize(
    "choice", [{"init": "file"}, {"init": "file", "pose_file": "/no/pose.json"}, {"shape": "file"}]
)
def test_a_missing_file_is_one_sentence(page, sample, act, choice):
    state, controller = page
    act(lambda: controller.open(sample))
    state.param.update(**choice)
    act(controller.start)
    assert "file" in state.error
    assert state.origin is None
    assert not state.busy


def test_a_tracked_frame_makes_three_scenes_under_one_view_and_a_depth_jpeg(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    scenes = {name: scene(state.entry, ()) for name, scene in SCENES.items()}
    assert len(scenes["particles"].meshes) == 8
    assert len(scenes["reconstruction"].meshes) == 1
    assert scenes["trajectories"].lines[0].paths.shape[0] == 4 * 6
    assert isinstance(view_of([state.entry], state), ViewCamera)
    frame = state.session[0]
    plain = depth_jpeg(frame)
    full = depth_jpeg(frame, state.entry.seen, [Skeleton(state.summary.joints, (255, 255, 255))])
    assert plain.startswith(b"\xff\xd8")
    assert plain != full


def test_clicks_that_come_faster_than_frames_are_all_done(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)

    async def three_at_once():
        await asyncio.gather(controller.step(), controller.step(), controller.step())

    asyncio.run(three_at_once())
    assert state.frame == 3


def test_looking_at_a_frame_tracks_nothing_and_stops_play(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    state.playing = True
    controller.look(50)
    assert (state.frame, state.playing, state.lane.results.last) == (50, False, 0)
    act(lambda: controller.jump(2))
    assert (state.frame, state.lane.results.last) == (2, 2)


def test_who_looks_back_while_frames_are_tracked_is_left_where_he_looks(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)

    def look_back_at_two(event):
        if event.new == 2:
            controller.look(0)

    watcher = state.param.watch(look_back_at_two, "frame")
    act(lambda: controller.jump(4))
    state.param.unwatch(watcher)
    assert (state.frame, state.lane.results.last) == (0, 4)


def test_play_in_a_loop_stays_within_the_range(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    act(lambda: controller.jump(4))
    state.param.update(span=(1, 3), loop=True)
    shown = []

    async def drawn():
        shown.append(state.frame)
        if len(shown) == 7:
            controller.pause()

    controller.drawn = drawn
    act(controller.play)
    assert shown == [2, 3, 1, 2, 3, 1, 2]  # it began at 1
    assert state.lane.results.last == 4


def test_around_each_joint_stands_how_far_off_it_may_be(page, sample, act):
    state, controller = page
    started(state, controller, sample, act)
    frame = state.session[0]
    around = around_joints(state.entry, frame)
    assert around.shape == (21, 3, 3)
    reach = np.sqrt(np.linalg.eigvalsh(around)[:, -1])
    assert (reach > 1e-4).all()
    assert reach[JOINT_NAMES.index("middle_tip")] > reach[JOINT_NAMES.index("middle_mcp")]
    bare = Skeleton(state.summary.joints, (255, 255, 255))
    without, with_them = (depth_picture(frame, None, [one]) for one in (bare, bare._replace(around=around)))
    assert (without != with_them).any()
    lost = state.entry._replace(result=state.entry.result._replace(info=None))
    assert around_joints(lost, frame) is None
