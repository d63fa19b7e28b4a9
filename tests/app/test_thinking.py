"""What the filter thinks, without a browser: every pane of the tabs, drawn from tracked frames."""

import numpy as np
import pytest

from app.look import COLOURINGS, LAYERS, Shown
from app.views.coordinates import Coordinates
from app.views.descents import Descents
from app.views.layers import layered, scale_of
from app.views.particle_table import ParticleTable
from app.views.particles import Particles
from app.views.samples import SamplesOverFrames
from app.views.scenes import view_of
from app.views.step_sizes import StepSizes
from app.views.viewpoints import VIEWS, palm_view
from app.views.winners import Winners
from spf.filters.kde import marginal_density
from spf.hand.kinematics import joints_of

# Panel's own table uses what pandas is about to drop.
pytestmark = pytest.mark.filterwarnings("ignore:The inplace keyword in DataFrame.reset_index")


@pytest.fixture
def tracked(page, sample, act):
    """The state of a page that has tracked three frames, and shows what the filter thinks."""
    state, controller = page
    act(lambda: controller.open(sample), controller.start, controller.step, controller.step)
    assert state.error == ""
    state.look.tab = "particles"
    return state


def test_the_plane_shows_every_particle_in_millimetres_and_degrees(tracked):
    particles = Particles(tracked)
    plane = Coordinates(tracked, particles)
    tracked.look.densities = ["f", "f_plus", "g"]
    tracked.look.across, tracked.look.upwards = 0, 11
    particles.draw()
    plane.draw()
    info, data = tracked.entry.result.info, particles.source.data
    assert data["x0"] == pytest.approx(1000 * info.predicted[:, 0])
    assert data["y1"] == pytest.approx(np.degrees(info.optimised[:, 11]))
    assert plane.figure.xaxis.axis_label == "Palm X, mm"
    assert plane.figure.yaxis.axis_label == "Index MP flexion, °"
    assert all(len(source.data["xs"]) == 5 for source in plane.contours.values())
    window = plane.window.data
    assert window["width"] == pytest.approx([2000 * info.bandwidth[0]])
    assert info.bandwidth[0] == pytest.approx(
        info.window * 0.005, rel=0.01
    )  # h times the noise of a thirtieth of a second
    ways = list(zip(info.origins, plane.paths.data["xs"], data["x0"], data["x1"], strict=True))
    for origin, path, before, after in ways:  # a recombined sample's path begins at none of the predicted ones
        assert path[-1] == pytest.approx(after, abs=1e-2)
        assert path[0] == pytest.approx(before, abs=1e-2) or origin == "recombined"
    assert len(plane.marks["truth"].data["x"]) == len(plane.marks["estimate"].data["x"]) == 1
    tracked.with_truth = False
    assert len(plane.marks["truth"].data["x"]) == 0


def test_a_particle_picked_in_the_table_is_picked_everywhere(tracked):
    particles = Particles(tracked)
    plane, table, steps = Coordinates(tracked, particles), ParticleTable(tracked, particles), StepSizes(tracked)
    for part in (particles, plane, table, steps):
        part.draw()
    before = len(layered(tracked.entry, tracked.look.shown).meshes)
    table.pane.selection = [1]
    assert tracked.look.selected == (1,)
    assert particles.source.selected.indices == [1]
    assert "particle 2" in steps.heading.object
    assert len(layered(tracked.entry, tracked.look.shown).meshes) == 2 < before
    particles.source.selected.indices = [0, 2]
    assert table.pane.selection == [0, 2]


def test_a_table_of_hundreds_scrolls_and_has_dashes_for_what_there_is_not(page, sample, act):
    state, controller = page
    state.lane.tracker = "condensation"
    act(lambda: controller.open(sample), controller.start, controller.step)
    particles = Particles(state)
    table = ParticleTable(state, particles)
    particles.draw()
    table.draw()
    assert (len(table.pane.value), table.pane.pagination) == (500, None)
    assert np.isnan(table.pane.value["E after"]).all()
    assert table.pane.formatters["E after"].nan_format == "–"


def test_the_table_says_where_particles_come_from_and_what_they_weigh(tracked):
    particles = Particles(tracked)
    table = ParticleTable(tracked, particles)
    particles.draw()
    table.draw()
    rows, info = table.pane.value, tracked.entry.result.info
    assert list(rows["proposal"]) == list(info.origins)
    assert rows["weight before, %"].sum() + rows["weight after, %"].sum() == pytest.approx(100)
    assert set(rows["ancestor"].str.split().str[1]) <= {"predicted", "optimised"}


def test_descents_and_step_sizes_cover_every_iteration(tracked):
    costs, steps = Descents(tracked), StepSizes(tracked)
    costs.draw()
    steps.draw()
    info = tracked.entry.result.info
    assert [len(path) for path in costs.source.data["ys"]] == [len(trace.costs) for trace in info.trajectories]
    (image,) = steps.source.data["image"]
    heaviest = info.trajectories[int(np.argmax(info.optimised_weights))]
    assert image.shape == (26, len(heaviest.step_sizes))
    assert image[:, 0] == pytest.approx(0.0)
    assert (image <= np.log10(5.0) + 1e-5).all()  # a/a₀ has that bound
    assert image[-1, -1] == pytest.approx(np.log10(heaviest.step_sizes[-1, 0] / heaviest.step_sizes[0, 0]), abs=1e-5)


def test_shares_resampling_and_wins_are_kept_for_every_frame(tracked):
    samples, winners = SamplesOverFrames(tracked), Winners(tracked)
    samples.draw()
    winners.draw()
    entries = [tracked.lane.entry(index) for index in range(3)]
    shares = [100 * entry.result.info.optimised_share for entry in entries]
    assert samples.source.data["share"] == pytest.approx(shares)
    assert samples.resampled.data["frame"] == [0, 1, 2]
    won = [words.split()[0] for words in winners.source.data["winner"]]
    assert won == [entry.result.info.winner for entry in entries]


def test_a_hidden_pane_is_not_drawn(tracked):
    particles = Particles(tracked)
    particles.draw()
    tracked.look.tab = "overview"
    before = particles.source.data
    tracked.show(0)
    assert particles.source.data is before
    tracked.look.tab = "particles"
    assert particles.source.data is not before


def test_every_layer_adds_something_and_every_colouring_has_a_scale(tracked):
    entry = tracked.entry

    def things(*layers, colouring="stage"):
        scene = layered(entry, Shown(layers, colouring, ()))
        return len(scene.meshes), len(scene.points), len(scene.lines)

    count = len(entry.result.info.predicted)
    assert things() == (0, 0, 0)
    assert things("predicted") == things("optimised") == (count, 0, 0)
    assert things("predicted", "optimised") == (2 * count, 0, 0)
    assert things("points") == things("residuals") == (0, 1, 0)
    assert things("hand") == (1, 0, 0)
    assert things("paths") == (0, 2, 1)
    assert things(*LAYERS.values()) == (2 * count + 1, 3, 1)
    for colouring in set(COLOURINGS.values()) - {"stage"}:
        scale = scale_of(entry, colouring)
        assert scale.low < scale.high
        meshes = layered(entry, Shown(("predicted", "optimised"), colouring, ())).meshes
        assert len({tuple(mesh.colour) for mesh in meshes}) > 1


def test_the_front_is_the_side_of_the_palm(tracked):
    """The sample shows the palm to the sensor, or its back: seen from the front, bent fingers come towards the eye."""
    for name, (_, angles) in VIEWS.items():
        tracked.azimuth, tracked.elevation = angles(tracked.entry)
        assert np.isfinite(view_of([tracked.entry], tracked).placement().position).all(), name
    azimuth, elevation = palm_view(tracked.entry)
    view = view_of([tracked.entry], tracked)._replace(azimuth=azimuth, elevation=elevation)
    eye = view.placement().position - np.array(view.focal_point)
    hand, result = tracked.lane.entry(0).tracking.hand, tracked.entry.result
    bent = hand.constrain(result.pose + np.array([1.0 if "flexion" in name else 0.0 for name in hand.dof_names]))
    moved = joints_of(hand, bent, result.reference)[[8, 12, 16, 20]] - result.joints[[8, 12, 16, 20]]
    assert (moved.mean(axis=0) @ eye) > 0


def test_an_anchored_eye_stays(tracked):
    first = view_of([tracked.lane.entry(0)], tracked)
    tracked.look.anchor = first
    tracked.look.pan = (0.01, 0.0)
    later = view_of([tracked.entry], tracked)
    assert later.focal_point == first.focal_point
    assert later.pan == (0.01, 0.0)


def test_marginal_density_integrates_to_one_and_peaks_at_the_samples():
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(5, 2)) * (3.0, 1.0)
    x, y = np.linspace(-30, 30, 301), np.linspace(-15, 15, 301)
    density = marginal_density(x, y, samples, np.array([2.0, 0.7]))
    assert density.sum() * (x[1] - x[0]) * (y[1] - y[0]) == pytest.approx(1.0, abs=1e-3)
    one = marginal_density(x, y, np.array([[3.0, -2.0]]), np.array([2.0, 0.7]))
    row, column = np.unravel_index(one.argmax(), one.shape)
    assert (x[column], y[row]) == pytest.approx((3.0, -2.0), abs=0.11)
