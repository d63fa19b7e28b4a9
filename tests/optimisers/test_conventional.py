"""Gradient descent, L-BFGS-B, Powell's method and Levenberg-Marquardt on the cost that SMD minimises."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spf.cost.problem import Problem
from spf.cost.products import products, see
from spf.hand.model import load_hand
from spf.kernels.smd import smd_update
from spf.optimisers import bfgs, gd, lm, powell, smd
from spf.optimisers.rounds import FixedCost
from spf.optimisers.trajectory import Optimise
from tests.optimisers.test_smd import beside, vertex_error
from tests.scenes import CAMERAS, hand_problem, natural_pose

#: name → (optimiser, its settings); of the deterministic ones.
DETERMINISTIC: dict[str, tuple[Optimise, Any]] = {
    "bfgs": (bfgs.optimise, bfgs.BfgsSettings()),
    "powell": (powell.optimise, powell.PowellSettings(evaluations=1500)),
    "lm": (lm.optimise, lm.LmSettings()),
}
ALL: dict[str, tuple[Optimise, Any]] = {
    "smd": (smd.optimise, smd.SmdSettings()),
    "gd": (gd.optimise, smd.DescentSettings()),
    **DETERMINISTIC,
}


@pytest.fixture(scope="module")
def scene() -> tuple[Problem, np.ndarray, np.ndarray]:
    """A frame's cost, its true pose, and a start beside it."""
    hand = load_hand("right")
    truth = natural_pose(hand)
    problem = hand_problem(hand, truth, CAMERAS["pinhole"])
    return problem, truth, hand.constrain(beside(truth, np.random.default_rng(1)))


def full_cost(problem: Problem, pose: np.ndarray) -> float:
    return products(problem, pose, np.zeros_like(pose), see(problem, pose)).energy


@pytest.mark.parametrize("name", ALL)
def test_every_optimiser_lowers_the_cost_and_comes_back(
    name: str, scene: tuple[Problem, np.ndarray, np.ndarray]
) -> None:
    problem, truth, start = scene
    optimise, settings = ALL[name]
    found, _, evaluations = optimise(problem, settings, np.random.default_rng(0), start)
    assert full_cost(problem, found) < 0.5 * full_cost(problem, start)
    assert vertex_error(problem, found, truth) < 0.6 * vertex_error(problem, start, truth)
    assert (found >= problem.hand.limits[:, 0]).all()
    assert (found <= problem.hand.limits[:, 1]).all()
    assert evaluations > 0


@pytest.mark.parametrize("name", DETERMINISTIC)
def test_equal_costs_at_equal_poses(name: str, scene: tuple[Problem, np.ndarray, np.ndarray]) -> None:
    """What an optimiser says that E is at its first pose is E on all that is seen there, and none ends a round worse."""
    problem, _, start = scene
    optimise, settings = DETERMINISTIC[name]
    _, trajectory, _ = optimise(problem, settings.replace(rounds=1), np.random.default_rng(0), start, record=True)
    assert trajectory is not None
    assert trajectory.costs[0] == pytest.approx(full_cost(problem, start), rel=1e-12)
    sample = see(problem, start)
    for pose, cost in zip(trajectory.poses, trajectory.costs, strict=True):
        assert products(problem, pose, np.zeros_like(pose), sample).energy == pytest.approx(cost, rel=1e-9)
    assert (np.diff(trajectory.costs) <= 1e-9).all()


def test_smd_samples_the_cost_that_the_others_evaluate(scene: tuple[Problem, np.ndarray, np.ndarray]) -> None:
    """The mean of E over SMD's samples at the start is E on all points there."""
    problem, _, start = scene
    seen = [
        smd.optimise(problem, smd.SmdSettings(rounds=1, iterations=1), np.random.default_rng(seed), start, record=True)[
            1
        ]
        for seed in range(400)
    ]
    costs = np.array([trajectory.costs[0] for trajectory in seen if trajectory is not None])
    assert costs.mean() == pytest.approx(full_cost(problem, start), abs=4 * costs.std() / np.sqrt(len(costs)))


@pytest.mark.parametrize("name", DETERMINISTIC)
def test_nothing_is_random(name: str, scene: tuple[Problem, np.ndarray, np.ndarray]) -> None:
    problem, _, start = scene
    optimise, settings = DETERMINISTIC[name]
    first, second = (
        optimise(problem, settings.replace(rounds=1), np.random.default_rng(seed), start)[0] for seed in (0, 1)
    )
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("name", ALL)
def test_a_strong_pull_holds_the_pose(name: str, scene: tuple[Problem, np.ndarray, np.ndarray]) -> None:
    problem, _, start = scene
    optimise, settings = ALL[name]
    found, _, _ = optimise(problem, settings, np.random.default_rng(0), start, precision=np.full(26, 1e9))
    np.testing.assert_allclose(found, start, atol=1e-4)


# ---- gradient descent


def test_gradient_descent_is_smd_without_meta_step_and_decay(scene: tuple[Problem, np.ndarray, np.ndarray]) -> None:
    problem, _, start = scene
    settings = smd.DescentSettings(rounds=3, iterations=5, anneal=False)
    found, trajectory, _ = gd.optimise(problem, settings, np.random.default_rng(2), start, record=True)
    special = smd.SmdSettings(rounds=3, iterations=5, anneal=False, mu=0.0, decay=0.0)
    same, _, _ = smd.optimise(problem, special, np.random.default_rng(2), start)
    np.testing.assert_array_equal(found, same)
    assert trajectory is not None
    np.testing.assert_array_equal(trajectory.step_sizes, trajectory.step_sizes[:1].repeat(16, axis=0))
    other, _, _ = smd.optimise(problem, special.replace(mu=0.1, decay=0.9), np.random.default_rng(2), start)
    assert (found != other).any()


def test_the_update_without_meta_step_and_decay_is_a_step_down_the_gradient(rng: np.random.Generator) -> None:
    pose, gradient, step = rng.normal(size=(3, 8))
    step = np.abs(step)
    settings = gd.as_smd(smd.DescentSettings())
    moved, wide = pose.copy(), np.tile([-np.inf, np.inf], (8, 1))
    bounds = settings.least_step * step, settings.most_step * step
    trace = rng.normal(size=8)
    smd_update(moved, step, trace, gradient, rng.normal(size=8), settings.mu, settings.decay, False, *bounds,
               np.full(8, np.inf), wide)  # fmt: skip
    np.testing.assert_allclose(moved, pose - step * gradient, rtol=1e-12)


# ---- Levenberg-Marquardt


def test_an_undamped_step_solves_the_normal_equations(rng: np.random.Generator) -> None:
    root, gradient = rng.normal(size=(9, 6)), 1e-3 * rng.normal(size=6)
    hessian, wide = root.T @ root, np.tile([-np.inf, np.inf], (6, 1))
    step = lm.damped_step(hessian, gradient, 1e-9, np.zeros(6), wide)
    np.testing.assert_allclose(step, -np.linalg.solve(hessian, gradient), rtol=1e-3, atol=1e-7)


def test_damping_turns_the_step_to_the_scaled_gradient(rng: np.random.Generator) -> None:
    root, gradient = rng.normal(size=(9, 6)), rng.normal(size=6)
    hessian, wide = root.T @ root, np.tile([-np.inf, np.inf], (6, 1))
    step = lm.damped_step(hessian, gradient, 1e5, np.zeros(6), wide)
    np.testing.assert_allclose(step, -gradient / (1e5 * np.diag(hessian)), rtol=1e-3)


def test_an_entry_that_is_pushed_out_of_its_limit_stays_and_the_others_are_solved_without_it() -> None:
    hessian = np.array([[2.0, 1.0], [1.0, 2.0]])
    limits = np.array([[0.0, 1.0], [-1.0, 1.0]])
    step = lm.damped_step(hessian, np.array([0.5, 0.01]), 1e-9, np.array([0.0, 0.0]), limits)
    np.testing.assert_allclose(step, [0.0, -0.005], rtol=1e-3)


def test_the_hessian_of_a_round_is_symmetric_and_has_the_diagonal_of_the_curvature(
    scene: tuple[Problem, np.ndarray, np.ndarray],
) -> None:
    problem, _, start = scene
    cost = FixedCost(problem, see(problem, start), start, None)
    hessian = cost.hessian(start)
    assert cost.evaluations == len(start)
    np.testing.assert_allclose(hessian, hessian.T, rtol=1e-6, atol=1e-6 * np.abs(hessian).max())
    diagonal = 1.0 / cost.scale(start) ** 2 - problem.curvature_floor
    np.testing.assert_allclose(np.diag(hessian), diagonal, rtol=1e-6, atol=1e-6 * diagonal.max())
