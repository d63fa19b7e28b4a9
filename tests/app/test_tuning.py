"""What a setting does to the frame shown, presets as files, undo, and the page's address: without a browser."""

import asyncio
import os
from urllib.parse import parse_qs, urlencode

import numpy as np
import pytest

from app.address import Address, Place, place_of
from app.controller import Controller
from app.lane import Lane
from app.preview import Previewer
from app.reruns import Reruns
from app.results import seen_again
from app.runner import Runner
from app.server import bundled, open_shared
from app.shelf import Shelf
from app.state import State
from app.views.again_card import AgainCard
from app.views.difference import Difference
from app.views.landscape import LandscapeCard
from app.views.runs_card import RunsCard
from app.views.settings_card import SettingsCard
from spf.errors import SettingError
from spf.presets import Presets
from spf.render import ViewCamera
from tests.sessions.ros_makers import make_ros1_bag


async def weighed(state):
    """Wait until the preview is that of the present settings."""
    while state.preview is None or state.preview.settings != state.lane.settings:
        await asyncio.sleep(0.01)


async def begun(page, sample, rounds):
    """Open a session and start a run that costs little."""
    state, controller = page
    await controller.open(sample)
    state.change("rounds", rounds)
    await controller.start()


def test_a_moved_slider_is_seen_in_the_frame_shown_and_tracks_nothing(page, sample):
    state, controller = page
    previewer, card = Previewer(state), LandscapeCard(state)

    async def scene():
        await begun(page, sample, 2)
        await controller.step()
        await weighed(state)
        before = state.lane.entry(1)
        assert state.entry is before
        state.change("h", 0.6)
        state.change("k", 5.0)
        await weighed(state)
        return before

    before = asyncio.run(asyncio.wait_for(scene(), 120))
    now = state.entry.result.info
    assert state.lane.entry(1) is before
    assert state.lane.results.last == 1
    assert now.window == 0.6
    assert (now.cost_after != before.result.info.cost_after).all()
    np.testing.assert_array_equal(now.optimised, before.result.info.optimised)
    assert "ESS" in state.preview.note
    card.draw()
    assert card.image.data["cost"][0].shape == (19, 19)
    assert len(card.samples.data["x"]) == len(now.predicted) + len(now.optimised) + 1
    previewer.close()


def test_the_frame_is_seen_again_through_the_lens_that_it_was_tracked_through(page, sample, act):
    state, controller = page
    act(lambda: controller.open(sample), controller.start)
    base, frame = state.lane.entry(0), state.session[0]
    start = base.tracking.start
    through = base.tracking._replace(start=start._replace(shape=start.shape._replace(lens=1.3)))
    for tracking, lens in ((base.tracking, 1.0), (through, 1.3)):
        assert seen_again(base._replace(tracking=tracking), frame).camera.fx == pytest.approx(lens * frame.camera.fx)


def test_what_cannot_be_seen_at_once_is_said(page, sample):
    state, _ = page
    previewer = Previewer(state)

    async def scene():
        await begun(page, sample, 1)
        state.change("n", 9)
        await weighed(state)

    asyncio.run(asyncio.wait_for(scene(), 120))
    assert "N: seen when the frame is tracked again" in state.preview.note
    previewer.close()


def test_that_drawn_samples_need_the_frame_again_is_said(page, sample):
    state, _ = page
    previewer, card = Previewer(state), LandscapeCard(state)

    async def scene():
        await begun(page, sample, 1)
        state.change("weighting", "laplace")
        state.change("k", 5.0)
        await weighed(state)
        while state.preview.landscape is None:
            await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(scene(), 120))
    assert "press This frame again" in state.preview.note
    assert state.entry.result is state.lane.entry(0).result  # nothing is made up
    card.draw()
    assert card.image.data["cost"][0].shape == (19, 19)
    previewer.close()


def test_a_preset_is_saved_as_a_file_and_read_back(tmp_path):
    presets = Presets(tmp_path / "presets")
    lane = Lane(presets=presets)
    lane.change("k", 2.5)
    presets.save("spf", "my hand", lane.settings)
    assert presets.names("spf") == ["default", "paper", "my hand"]
    assert presets.names("smd") == ["default", "paper"]
    lane.preset = "my hand"
    assert lane.settings.k == 2.5
    assert lane.differences == {}
    lane.tracker = "smd"
    assert lane.preset == "default"


def test_a_preset_that_is_deleted_leaves_its_settings_to_who_uses_them(tmp_path):
    presets = Presets(tmp_path)
    lane = Lane(presets=presets)
    lane.change("k", 2.5)
    presets.save("spf", "mine", lane.settings)
    lane.preset = "mine"
    presets.delete("spf", "mine")
    assert lane.differences == {}  # another page's, which knows nothing of it
    lane.change("k", 4.0)
    lane.back_to_preset()
    assert lane.settings.k == 2.5
    lane.without_preset()
    assert (lane.preset, lane.settings.k, lane.differences) == ("default", 2.5, {"k": (Lane().settings.k, 2.5)})
    for name in ("mine", "default", "../x"):
        with pytest.raises(SettingError):
            presets.delete("spf", name)


def test_a_preset_is_deleted_in_the_page_with_two_clicks(tmp_path):
    state, presets = State(), Presets(tmp_path)
    state.lane.presets = presets
    card = SettingsCard(state, presets)
    assert not card._delete.visible
    state.change("k", 2.5)
    card._name.value = "mine"
    card._save(None)
    assert card._delete.visible
    card._on_delete(None)
    assert presets.names("spf")[-1] == "mine"
    card._on_delete(None)
    assert "mine" not in presets.names("spf")
    assert (state.lane.preset, state.lane.settings.k, card._delete.visible, state.error) == ("default", 2.5, False, "")


def test_a_damaged_preset_is_not_taken(tmp_path):
    state, presets = State(), Presets(tmp_path)
    state.lane.presets = presets
    (tmp_path / "odd.spf.json").write_text("{")
    card = SettingsCard(state, presets)
    card._preset.value = "odd"
    assert "damaged" in state.error
    assert (state.lane.preset, card._preset.value) == ("default", "default")


@pytest.mark.parametrize("name", ["", "default", "../up", "a/b", "taken"])
def test_no_preset_is_written_over_or_outside(tmp_path, name):
    presets = Presets(tmp_path)
    presets.save("spf", "taken", Lane().settings)
    with pytest.raises(SettingError):
        presets.save("spf", name, Lane().settings)
    assert len(list(tmp_path.iterdir())) == 1


def test_a_damaged_preset_is_one_sentence(tmp_path):
    (tmp_path / "odd.spf.json").write_text('{"format": "spf-preset"')
    with pytest.raises(SettingError, match="damaged"):
        Presets(tmp_path).settings("spf", "odd")


def test_changes_are_undone_one_by_one_and_a_dragged_slider_is_one(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("app.lane.time.monotonic", lambda: now[0])
    lane = Lane()
    first = lane.settings
    for value in (1.1, 1.2, 1.3):
        now[0] += 0.1
        lane.change("k", value)
    lane.change("h", 2.0)
    lane.undo()
    assert (lane.settings.k, lane.settings.h) == (1.3, first.h)
    lane.undo()
    assert lane.settings == first
    assert not lane.can_undo


def test_an_address_is_read_and_what_is_odd_in_it_left_out():
    whole = place_of({"session": "a", "run": "x,y", "frame": 7, "view": "compare", "eye": "0.1,0.2,2"})
    assert whole[:-1] == Place("a", "", ("x", "y"), 7, "compare", (0.1, 0.2, 2.0))[:-1]
    mistyped = {"tab": "moon", "picked": "x,-2", "layers": "hand,foot", "pan": "1", "stay": "0,0,0,0,-1", "across": "z"}
    said = place_of({"frame": "-3", "view": "upside-down", "eye": "east"} | mistyped)
    assert said == Place(look=place_of({}).look)
    State().look.param.update(**said.look)


def test_an_address_opened_elsewhere_shows_the_same(page, sample, act, tmp_path):
    state, controller = page
    shelf = Shelf(tmp_path / "runs")
    samples = bundled()
    address = Address(state, controller, Reruns(controller, shelf), samples)
    act(lambda: address.go(Place("open-close", frame=12)))
    state.orbit(0.5, 0.0, 1.0)
    anchor = ViewCamera((0.01, 0.02, 0.43), 0.44, 0.26)
    looks = {
        "tab": "scene",
        "selected": (1, 3),
        "layers": [],
        "colouring": "cost",
        "pan": (0.01, -0.02),
        "anchor": anchor,
    }
    looks |= {"across": 7, "upwards": 2, "densities": ["g"]}
    state.look.param.update(**looks)
    query = address.query()
    assert (query["session"], query["frame"], "run" in query) == ("open-close", 12, False)
    other = State()
    elsewhere = Controller(other, Runner())
    act(lambda: Address(other, elsewhere, Reruns(elsewhere, shelf), samples).go(place_of(query)))
    assert (other.session.name, other.frame, other.azimuth) == ("open-close", 12, 0.5)
    assert {name: getattr(other.look, name) for name in looks} == looks
    elsewhere.close()


def test_a_session_of_which_something_is_chosen_opens_from_the_address(page, act, tmp_path, monkeypatch):
    monkeypatch.setenv("SPF_SESSIONS", str(tmp_path))
    made = make_ros1_bag(tmp_path / "two topics.bag", np.random.default_rng(3))
    state, controller = page
    controller.opener = open_shared
    address = Address(state, controller, Reruns(controller, Shelf(tmp_path / "runs")), bundled())
    uri = f"{made.path}?topic=/head/depth/image_raw&unit=0.001"
    for session in (uri, parse_qs(urlencode({"session": uri}))["session"][0]):
        act(lambda session=session: address.go(place_of({"session": session})))
        assert state.error == ""
        assert str(state.session.uri) == address.query()["session"] == uri
    before = state.session
    os.utime(made.path, ns=(1, 1))
    act(lambda: controller.open(uri))
    assert state.session is not before  # the file has changed


def test_an_address_of_a_run_that_is_gone_says_so_and_shows_its_session(page, act, tmp_path):
    state, controller = page
    address = Address(state, controller, Reruns(controller, Shelf(tmp_path)), bundled())
    act(lambda: address.go(Place("open-close", runs=("gone",))))
    assert state.session.name == "open-close"
    assert "gone" in state.error


def test_cards_can_be_shown_before_anything_is_there(page, tmp_path):
    state, controller = page
    shelf = Shelf(tmp_path)
    reruns = Reruns(controller, shelf)
    assert AgainCard(state, reruns).panel is not None
    assert RunsCard(state, shelf, reruns).panel is not None
    Difference(state).draw()
