"""E, its gradient and its Gauss-Newton product against central differences of a naive reference."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from spf.cost.problem import Problem
from spf.cost.products import Sample, curvature, products, see
from spf.errors import HandError
from spf.hand.model import load_hand
from spf.kernels.cost_inputs import LABEL, UNKNOWN
from tests.reference import cost as reference
from tests.scenes import CAMERAS, hand_problem, natural_pose

ROTATIONS = {
    "zero": (0.0, 0.0, 0.0),
    "near zero": (1e-8, -3e-9, 2e-8),
    "away": (0.7, -0.5, 0.9),
}
OFF = {"normal": 0.0, "background": 0.0, "coverage": 0.0, "collision": 0.0}
TERMS = {
    "depth": {},
    "depth, not robust": {"behind": 0.0, "front": 0.0, "pull": 0.0},
    "normal": {"normal": 3.0},
    "background": {"background": 0.7},
    "coverage": {"coverage": 3.0},
    "collision": {"collision": 3.0},
}


@dataclasses.dataclass(frozen=True)
class Case:
    """A problem, a pose beside its truth, and what is compared there."""

    problem: Problem
    pose: np.ndarray
    sample: Sample
    prior: np.ndarray
    precision: np.ndarray


def make_case(side: str, dofs: int, camera: str, rotation: str, seed: int = 0) -> Case:
    """A hand beside the truth far enough that every gate is in use: in front, behind, beside, colliding digits."""
    hand = load_hand(side, free_dip=dofs == 30)
    rng = np.random.default_rng(seed)
    truth = natural_pose(hand, ROTATIONS[rotation])
    problem = hand_problem(hand, truth, CAMERAS[camera])
    pose = truth + rng.normal(size=dofs) * np.r_[np.full(3, 0.006), np.zeros(3), np.full(dofs - 6, 0.15)]
    pose[[hand.dof_names.index(f"{finger}_mp_abduction") for finger in ("index", "ring")]] = -0.35, 0.35
    seen = see(problem, pose)
    sample = Sample(seen.points[:: len(seen.points) // 45][:45].copy(), seen.pixels[:15], seen.matches[:15])
    return Case(problem, pose, sample, pose + rng.normal(size=dofs) * 0.05, rng.uniform(0, 20, size=dofs))


def only(case: Case, **weights: float) -> Case:
    off = case.problem.weights._replace(**(OFF | weights))
    return dataclasses.replace(case, problem=case.problem._replace(weights=off), precision=np.zeros(len(case.pose)))


def directions(dofs: int) -> np.ndarray:
    """A random direction of all entries, and one of each block."""
    rng = np.random.default_rng(5)
    scale = np.r_[np.full(3, 0.1), np.ones(dofs - 3)]
    blocks = np.zeros((3, dofs))
    blocks[0, :3], blocks[1, 3:6], blocks[2, 6:] = 0.1, rng.normal(size=3), rng.normal(size=dofs - 6)
    return np.vstack([rng.normal(size=dofs) * scale, blocks])


def check_against_reference(case: Case) -> None:
    problem, pose = case.problem, case.pose
    taken = reference.springs(problem, pose, case.sample)

    def energy(p: np.ndarray) -> float:
        return reference.energy(problem, taken, p, case.prior, case.precision)

    hessian = reference.gauss_newton(problem, taken, pose, case.precision)
    for direction in directions(len(pose)):
        found = products(problem, pose, direction, case.sample, prior=case.prior, precision=case.precision)
        assert found.energy == pytest.approx(energy(pose), rel=1e-10)
        step = 2e-5
        # Richardson: two central differences, free of the third-order term
        near = (energy(pose + step * direction) - energy(pose - step * direction)) / (2 * step)
        far = (energy(pose + 2 * step * direction) - energy(pose - 2 * step * direction)) / (4 * step)
        slope = (4 * near - far) / 3
        size = np.linalg.norm(found.gradient) * np.linalg.norm(direction)
        assert abs(found.gradient @ direction - slope) < 1e-6 * max(abs(slope), 0.01 * size)
        np.testing.assert_allclose(
            found.product, hessian @ direction, rtol=1e-6, atol=1e-6 * np.abs(hessian @ direction).max()
        )


@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize(("side", "dofs"), [("right", 26), ("left", 30)])
def test_all_terms_agree_with_differences(side: str, dofs: int, camera: str, rotation: str) -> None:
    check_against_reference(make_case(side, dofs, camera, rotation))


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize(("side", "dofs", "camera"), [("left", 26, "pinhole"), ("right", 30, "orthographic")])
def test_each_term_agrees_with_differences(side: str, dofs: int, camera: str, term: str) -> None:
    whole = make_case(side, dofs, camera, "away", seed=1)
    case = only(whole, **TERMS[term])
    check_against_reference(case)
    if term != "depth":  # the term is really there
        without = products(only(whole).problem, case.pose, case.pose, case.sample).energy
        with_term = products(case.problem, case.pose, case.pose, case.sample).energy
        assert with_term > 1.001 * without


def test_the_cases_use_every_gate() -> None:
    """The cases above would show nothing of a branch that they never take."""
    case = make_case("right", 26, "pinhole", "away")
    taken = reference.springs(case.problem, case.pose, case.sample)
    kinds = {spring.loss.__qualname__ for spring in taken}
    assert len(kinds) == 3  # square, Cauchy, Geman-McClure
    weights = case.problem.weights
    background = weights.background * weights.points / len(case.sample.points) / weights.length**2
    assert any(spring.gain == pytest.approx(background) for spring in taken)
    colliding = reference.springs(case.problem, case.pose, Sample(*(part[:0] for part in case.sample)))
    assert len(colliding) >= 1


@pytest.mark.parametrize(("side", "dofs"), [("right", 26), ("left", 30)])
def test_gauss_newton_is_symmetric_and_positive_semidefinite(side: str, dofs: int) -> None:
    case = make_case(side, dofs, "pinhole", "away")
    columns = [products(case.problem, case.pose, unit, case.sample).product for unit in np.eye(dofs)]
    hessian = np.array(columns)
    scale = np.abs(hessian).max()
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-11 * scale)
    assert np.linalg.eigvalsh(hessian).min() > -1e-11 * scale
    assert np.linalg.eigvalsh(hessian).max() > 0


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize(("side", "dofs"), [("right", 26), ("left", 30)])
def test_diagonal_is_that_of_the_products(side: str, dofs: int, camera: str) -> None:
    """The columns summed up the tree against products with the unit vectors."""
    case = make_case(side, dofs, camera, "away")
    by_products = [
        products(case.problem, case.pose, unit, case.sample, precision=case.precision).product for unit in np.eye(dofs)
    ]
    found = curvature(case.problem, case.pose, case.sample, precision=case.precision)
    np.testing.assert_allclose(found, np.diag(by_products), rtol=1e-9)


def test_product_is_linear_in_the_direction(rng: np.random.Generator) -> None:
    case = make_case("right", 26, "pinhole", "zero")
    a, b = rng.normal(size=(2, 26))
    both = products(case.problem, case.pose, 2 * a - b, case.sample).product
    apart = [products(case.problem, case.pose, v, case.sample).product for v in (a, b)]
    np.testing.assert_allclose(both, 2 * apart[0] - apart[1], rtol=1e-9, atol=1e-9 * np.abs(both).max())


def test_sums_are_scaled_to_the_nominal_sample() -> None:
    """Twice the same points say nothing new."""
    case = only(make_case("right", 26, "pinhole", "away"), normal=1.0, coverage=1.0)
    twice = Sample(*(np.tile(part, 2) for part in case.sample))
    once = products(case.problem, case.pose, case.pose, case.sample)
    again = products(case.problem, case.pose, case.pose, twice)
    assert again.energy == pytest.approx(once.energy)
    np.testing.assert_allclose(again.gradient, once.gradient, rtol=1e-9, atol=1e-9 * np.abs(once.gradient).max())


def test_pixels_without_a_match_count_nothing() -> None:
    case = only(make_case("right", 26, "pinhole", "away"), coverage=1.0)
    nothing = case.sample._replace(points=case.sample.points[:0], matches=np.full_like(case.sample.matches, -1))
    found = products(case.problem, case.pose, case.pose, nothing)
    assert found.energy == 0
    assert not found.gradient.any()


def test_unknown_pixels_count_nothing() -> None:
    """A surface far in front hides the hand: what lies behind it says nothing."""
    case = only(make_case("right", 26, "pinhole", "away"), normal=1.0, background=1.0)
    observation = case.problem.observation
    surface = observation.arrays.surface.copy()
    surface[:, LABEL] = UNKNOWN
    hidden = observation.arrays._replace(surface=surface)
    problem = case.problem._replace(observation=observation._replace(arrays=hidden))
    assert products(problem, case.pose, case.pose, case.sample).energy == 0


def test_a_pose_of_another_hand_is_refused() -> None:
    case = make_case("right", 26, "pinhole", "zero")
    with pytest.raises(HandError, match="26"):
        products(case.problem, np.zeros(30), np.zeros(26), case.sample)
    with pytest.raises(HandError, match="26"):
        see(case.problem, np.full(26, np.nan))
