"""The hand posed in the page, without a browser: dragged, fitted, undone, handed to a run."""

import asyncio
import json

import numpy as np
import pytest

from app.placed import SHAPE_PARTS, part_of, pixels_of
from app.posing import Posing
from app.server import bundled
from app.views.overlay import overlay_of, picture_of
from app.views.start_card import StartCard
from spf.cli import execute
from spf.hand import read_hand_shape, read_pose
from spf.hand.kinematics import joints_of
from spf.posing import explained


@pytest.fixture
def posing(page, sample, act, tmp_path):
    """A hand posed in the first frame of an open session."""
    state, controller = page
    posing = Posing(controller, tmp_path)
    act(lambda: controller.open(sample), posing.begin)
    assert state.error == ""
    return posing


def error(posing):
    placed = posing.placed
    return np.linalg.norm(joints_of(placed.hand, *placed.stance) - posing.frame().truth.joints, axis=1).mean()


def drag(posing, handle, right, down):
    start = pixels_of(posing.placed, posing.seen())[handle]
    posing.begin_drag()
    for share in (0.3, 0.7, 1.0):
        posing.drag(handle, start, (start[0] + share * right, start[1] + share * down))


def test_a_drag_is_one_step_back(posing):
    before = posing.placed
    drag(posing, "palm", 20, -10)
    drag(posing, "index_tip", 0, 12)
    assert posing.placed is not before
    posing.undo()
    posing.undo()
    assert posing.placed is before
    drag(posing, "thumb_tip", 0, 0)
    posing.push(0.01)
    assert posing.placed.stance.pose[2] == pytest.approx(before.stance.pose[2] + 0.01)


def test_what_is_told_of_a_hand_is_of_that_hand(posing, act):
    told = {}

    def note(*_events):
        placed = posing.placed
        if not posing.told:
            return
        told[posing.told] = posing.explained == explained(posing.frame(), placed.shape, placed.stance)

    posing.param.watch(note, "told")
    act(posing.fit)
    drag(posing, "palm", 20, -10)
    posing.judge()
    posing.undo()
    assert all(told.values())
    assert any(words.startswith("Fitted to this frame.") for words in told)
    assert "Taken back." in told


def test_a_hand_dragged_away_is_fitted_back(posing, act):
    act(posing.fit)
    fitted = error(posing)
    assert fitted < 0.012
    drag(posing, "palm", 8, 6)
    drag(posing, "wrist", 8, 0)
    assert error(posing) > 1.4 * fitted
    act(posing.fit)
    assert error(posing) < 0.012
    assert "Golden energy" in posing.told
    posing.undo()
    assert error(posing) > 1.4 * fitted


def test_entries_and_shape_keep_to_what_a_hand_can(posing):
    posing.set_entry(11, 9.0)
    assert posing.placed.stance.pose[11] == posing.placed.hand.limits[11, 1]
    for part in SHAPE_PARTS.values():
        posing.set_shape(part, 1.1)
        assert part_of(posing.placed.shape, part) == pytest.approx(1.1)
    before = posing.placed
    posing.set_shape("scale", 9.0)
    assert posing.placed is before
    assert "no human hand" in posing.state.error


def test_a_hand_of_the_other_side_lies_where_the_first_did(posing):
    def across():
        seen = pixels_of(posing.placed, posing.seen())
        return np.subtract(seen["thumb_tip"], seen["little_tip"])

    before = across()
    posing.set_side("left")
    assert posing.placed.hand.side == "left"
    turned = across()
    assert before @ turned > 0.8 * np.linalg.norm(before) * np.linalg.norm(turned)
    posing.undo()
    assert posing.placed.hand.side == "right"


def test_the_shape_is_measured_and_compared(posing, act):
    act(posing.fit)
    posing.set_shape("scale", 1.25)
    act(posing.calibrate)
    assert posing.state.error == ""
    assert posing.compared.shape.scale == pytest.approx(1.25)
    assert abs(part_of(posing.placed.shape, "scale") - 1) < 0.15
    posing.undo()
    assert posing.compared is None
    assert posing.placed.shape.scale == pytest.approx(1.25)


def test_measuring_can_be_cancelled(posing):
    async def cancelled():
        work = asyncio.create_task(posing.calibrate())
        while not posing.state.share:
            await asyncio.sleep(0.05)
        posing._controller.cancel()
        await work

    before = posing.placed
    asyncio.run(cancelled())
    assert posing.placed is before
    assert posing.state.task == posing.state.error == ""


def test_a_run_starts_from_the_pose_and_the_command_line_reads_it(posing, act, sample, tmp_path):
    act(posing.fit)
    card = StartCard(posing.state, posing._controller.start)
    assert "That of the truth, if it has one" in card.hands
    posing.use()
    posing.use()
    state, controller = posing.state, posing._controller
    names = [f"{state.session.name}-frame-0{again}.json" for again in ("-2", "")]
    assert sorted(path.name for path in (tmp_path / "poses").iterdir()) == names
    assert state.pose_file == str(tmp_path / "poses" / names[0])
    assert (state.init, state.shape) == ("file", "depth")
    assert "That of the pose file, if it has one" in card.hands
    act(controller.start)
    assert state.error == ""
    start = state.origin.start
    assert start.pose == pytest.approx(posing.placed.stance.pose)
    assert start.shape == posing.placed.shape
    assert error(posing) < 0.012
    for make, option, name in ((posing.file_of_pose, "--init", "pose"), (posing.file_of_hand, "--hand", "hand")):
        _, content = make()
        path = tmp_path / f"{name}.json"
        path.write_bytes(content)
        run = tmp_path / name
        assert execute(["track", sample, "-o", str(run), "--frames", "0:2", option, str(path)]) == 0
    assert json.loads((tmp_path / "pose" / "manifest.json").read_text())["start"]["frame"] == 0
    assert read_pose(tmp_path / "pose.json").shape == read_hand_shape(tmp_path / "hand.json")


def test_the_tracked_estimate_is_taken(posing, act):
    act(posing._controller.start)
    posing.take_tracked()
    assert joints_of(posing.placed.hand, *posing.placed.stance) == pytest.approx(posing.state.summary.joints)


def test_another_session_begins_without_a_hand(posing, act):
    drag(posing, "palm", 5, 5)
    act(lambda: posing._controller.open(bundled()["fast-wave"]))
    assert posing.placed is None
    assert not posing.can_undo


def test_what_is_drawn_over_the_picture(posing):
    picture = picture_of(posing.state.session, 0)
    assert picture.startswith(b"\xff\xd8")
    over = overlay_of(posing.placed.hand, posing.placed.stance, posing.seen())
    assert sum(line["kind"] == "bone" for line in over.lines) == 20
    outline = next(line["points"] for line in over.lines if line["kind"] == "outline")
    assert outline[0] == outline[-1]
    left, top, width, height = over.box
    assert over.tint.startswith(b"\x89PNG")
    assert all(left <= u <= left + width and top <= v <= top + height for u, v in outline)
    away = posing.placed.stance._replace(pose=posing.placed.stance.pose + np.eye(26)[0] * 5)
    assert overlay_of(posing.placed.hand, away, posing.seen()).tint == b""
