"""Runs are kept, opened again, run again from a frame, and compared; nothing that was kept is written over."""

import asyncio
import zipfile

import numpy as np
import pytest

from app.controller import Controller
from app.keeper import Keeper
from app.reruns import Reruns
from app.results import Results
from app.runner import Runner
from app.shelf import Shelf
from app.state import State
from spf.errors import RunError
from spf.runs import read_run, reopen_session, track_plan
from spf.trackfile import read_track


@pytest.fixture
def shelf(tmp_path):
    return Shelf(tmp_path / "runs")


def new_page(shelf):
    state = State(init="truth")
    controller = Controller(state, Runner(), keeper=Keeper(state, shelf))
    return state, controller, Reruns(controller, shelf)


@pytest.fixture
def kept(shelf, sample):
    """A page with a quick run of 24 frames that is on disk."""
    state, controller, reruns = new_page(shelf)

    async def scene():
        await controller.open(sample)
        state.change("rounds", 1)  # quick: what is tracked does not matter here
        state.change("learned", False)
        await controller.start()
        await controller.jump(23)
        await controller.keeper.keep()

    asyncio.run(scene())
    assert state.error == ""
    yield state, controller, reruns
    controller.close()


def test_a_run_is_kept_as_the_command_line_keeps_it(kept, shelf, sample):
    (run,) = shelf.runs()
    stored = read_run(shelf.path(run.run))
    assert stored.manifest["complete"] is True
    assert len(stored.track) == 24
    assert reopen_session(stored.manifest).name == "open-close"
    repeated = [result.pose for result in track_plan(reopen_session(stored.manifest), stored.plan)]
    np.testing.assert_array_equal(repeated, stored.track.poses)


def test_an_opened_run_is_what_was_kept_and_its_particles_come_back(kept, shelf):
    state, _, _ = kept
    before, (run,) = state.lane.entry(17), shelf.runs()
    other, controller, reruns = new_page(shelf)

    async def scene():
        await reruns.open(run.run, 17)
        assert other.lane.entry(17) is None
        while other.lane.entry(17) is None or other.busy:
            await asyncio.sleep(0.05)

    asyncio.run(asyncio.wait_for(scene(), 120))
    assert (other.error, other.frame, other.last) == ("", 17, 23)
    assert other.lane.settings == state.lane.settings
    assert [s.error for s in other.lane.results.summaries] == [s.error for s in state.lane.results.summaries]
    np.testing.assert_array_equal(other.lane.entry(17).result.info.optimised, before.result.info.optimised)
    controller.close()
    assert len(shelf.runs()) == 1  # looking is no run


def test_going_on_with_an_opened_run_is_a_run_of_its_own(kept, shelf):
    (first,) = shelf.runs()
    stored = (shelf.path(first.run) / "track.parquet").read_bytes()
    other, controller, reruns = new_page(shelf)

    async def scene():
        await reruns.open(first.run, 23)
        await controller.step()
        await controller.keeper.keep()

    asyncio.run(scene())
    controller.close()
    assert (other.error, other.frame) == ("", 24)
    assert len(shelf.runs()) == 2
    assert (shelf.path(first.run) / "track.parquet").read_bytes() == stored
    assert len(read_track(shelf.path(other.lane.folder.run) / "track.parquet")) == 25


def test_running_again_from_a_frame_keeps_the_old_run_and_says_what_changed_where(kept, shelf):
    state, controller, reruns = kept
    old = state.lane.folder.run
    before = state.lane.entry(9).result.pose
    state.change("n", 2)
    asyncio.run(reruns.rerun(10))
    asyncio.run(controller.keeper.keep())
    assert (state.error, state.last, state.frame) == ("", 23, 23)
    assert state.lane.folder.run != old
    assert len(read_track(shelf.path(old) / "track.parquet")) == 24
    new = read_run(shelf.path(state.lane.folder.run))
    np.testing.assert_array_equal(new.track.poses[9], before)
    assert [(change.frame, change.settings.n) for change in new.plan.changes] == [(10, 2)]
    repeated = [result.pose for result in track_plan(state.session, new.plan)]
    np.testing.assert_array_equal(repeated, new.track.poses)


def test_a_frame_again_is_the_same_with_its_seed_and_another_with_the_next(kept):
    state, controller, reruns = kept
    controller.look(5)
    before = state.lane.entry(5).result.pose
    asyncio.run(reruns.again())
    assert (state.frame, state.last, state.error) == (5, 5, "")
    np.testing.assert_array_equal(state.lane.entry(5).result.pose, before)
    asyncio.run(reruns.again(other_seed=True))
    assert not np.array_equal(state.lane.entry(5).result.pose, before)


def test_the_whole_run_again_with_the_same_settings_is_the_same(kept):
    state, _, reruns = kept
    before = [row.result.pose for row in state.lane.results.rows]
    asyncio.run(reruns.rerun())
    np.testing.assert_array_equal([row.result.pose for row in state.lane.results.rows], before)


def test_running_again_can_be_cancelled_and_what_it_has_done_is_kept(kept, shelf):
    state, controller, reruns = kept

    def cancel_at_half(event):
        if event.new >= 0.5:
            controller.cancel()

    watcher = state.param.watch(cancel_at_half, "share")
    asyncio.run(reruns.rerun())
    state.param.unwatch(watcher)
    assert not state.busy
    assert state.last == 11
    controller.close()
    assert sorted(len(read_track(shelf.path(run.run) / "track.parquet")) for run in shelf.runs()) == [12, 24]


@pytest.mark.parametrize("doing", ["the particles of the frame shown", "a re-run that needs those of the frame before"])
def test_cancel_acts_while_particles_are_computed_again(kept, shelf, doing):
    """They are looked for by themselves whenever the page is at rest: not again right after they were given up."""
    (run,) = shelf.runs()
    other, controller, reruns = new_page(shelf)
    tasks = []
    other.param.watch(lambda event: tasks.append(event.new) if event.new else None, "task")

    async def scene():
        await reruns.open(run.run, 19)
        if "re-run" in doing:
            running = asyncio.ensure_future(reruns.rerun(19))
        while not other.task.startswith("Computing the particles"):
            await asyncio.sleep(0.005)
        reruns.cancel()
        tasks.clear()
        await asyncio.sleep(1.0)
        if "re-run" in doing:
            await running
        assert (tasks, other.busy, other.last) == ([], False, 23)
        controller.look(18)  # at another frame they are wanted again
        while other.lane.entry(18) is None:
            await asyncio.sleep(0.05)

    asyncio.run(asyncio.wait_for(scene(), 120))
    assert other.error == ""
    controller.close()


def test_a_run_is_compared_with_another_at_the_same_frame(kept, shelf):
    state, _, reruns = kept
    (run,) = shelf.runs()
    asyncio.run(reruns.open(run.run, 3, beside=True))
    assert (state.error, state.mode, state.frame, len(state.lanes)) == ("", "compare", 3, 2)
    first, second = state.lanes
    np.testing.assert_array_equal(first.summary(3).joints, second.summary(3).joints)


def test_a_run_is_named_packed_and_deleted_and_other_files_stay(kept, shelf, tmp_path):
    (run,) = shelf.runs()
    shelf.rename(run.run, "my best")
    assert shelf.runs()[0].label == "my best"
    packed = zipfile.ZipFile(shelf.archive(run.run))
    packed.extractall(tmp_path / "unpacked")
    assert len(read_run(tmp_path / "unpacked" / run.run).track) == 24
    (shelf.folder / run.run / "notes.txt").write_text("mine")
    shelf.delete(run.run)
    assert shelf.runs() == ()
    assert (shelf.folder / run.run / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("run", ["", "nothing", "..", "../runs", "/etc"])
def test_no_name_leads_out_of_the_shelf(kept, shelf, run):
    with pytest.raises(RunError, match="no run"):
        shelf.path(run)


def test_two_runs_of_one_second_have_two_folders(shelf):
    assert shelf.new("a", "spf") != shelf.new("a", "spf")


def test_a_damaged_run_says_so_and_the_others_are_there(kept, shelf):
    (run,) = shelf.runs()
    broken = shelf.folder / "broken"
    broken.mkdir()
    (broken / "manifest.json").write_text("{")
    labels = {kept_run.run: kept_run.label for kept_run in shelf.runs()}
    assert set(labels) == {run.run, "broken"}
    assert "torn" in labels["broken"]


def test_results_copied_grow_apart(kept):
    state, _, _ = kept
    other = state.lane.results.copy()
    other.cut(4)
    assert isinstance(other, Results)
    assert (other.last, state.lane.results.last) == (3, 23)


def test_a_run_that_cannot_be_kept_is_not_dropped(shelf, sample, tmp_path):
    state, controller, reruns = new_page(shelf)

    async def scene():
        await controller.open(sample)
        state.change("rounds", 1)
        state.change("learned", False)
        await controller.start()
        shelf.folder.write_text("a file is where the runs should be")
        await controller.step()
        held = state.lane.results
        for act in (reruns.rerun, reruns.again, controller.restart, lambda: controller.open(sample), controller.start):
            await act()
            assert state.lane.results is held
            assert held.last == 1
            assert "make it writable" in state.error
        shelf.folder.unlink()
        await reruns.rerun()
        assert state.error == ""
        assert len(shelf.runs()) == 1
        assert state.lane.results is not held

    asyncio.run(scene())
    controller.close()
