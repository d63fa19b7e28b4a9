"""The hand's shape, refined while it is tracked, in views that tell something of it.

What views say of the shape (:mod:`spf.shape_equations`) is gathered as an information filter does: Λ and Λθ of a Gaussian
over the logarithms of factors on the start's shape. A view counts the less, the less the samples agree in where the joints
are. The likeliest shape is not believed for that: it becomes a candidate, and must explain the views that come *next* better
than the present one does, both rendered where SMD takes them from the same pose.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spf.cost.problem import golden, make_problem
from spf.cost.settings import CostSettings
from spf.cost.spheres import digit_spheres
from spf.filters.step import StepInfo
from spf.hand.kinematics import joints_of_each
from spf.hand.model import DOF_NAMES, Hand
from spf.hand.shape import UNCHANGED, HandShape, varied
from spf.kernels.cost import Spheres
from spf.optimisers.smd import SmdSettings, optimise
from spf.shape_equations import BACKGROUND, POOL, View, equations_of, nudged

__all__ = ["Refinement", "agreement", "is_due", "modelled", "refined", "unrefined"]

Array = NDArray[np.float64]

_SPREAD = np.array([0.03, *([0.15] * 5), 0.02, 0.02, 0.02])  # of the start's shape: how far off its parameters may be
_PRIOR = np.diag(_SPREAD**-2.0)
_APART = 0.016  # of a hand's length, that samples' joints are apart on the average where a view counts 1/e
_COUNTS = 0.05  # of a view, under which it is left out
_EVERY = 3  # frames between two views, which are nearly the same when they follow each other
_VIEWS = 3  # that judge a candidate
_STEP = 0.05  # at most, of a parameter, from the present shape to a candidate
_LEAST_SHARE = 0.125  # of the way to the likeliest shape
_FARTHEST = 0.3  # that a parameter can be from the start's
_ROUNDS = 4  # of the descents that a candidate is judged after
_LEAST_GOLDEN = 0.05  # of a view, where a relative change says nothing any more


class Refinement(NamedTuple):
    """What is known of the shape, by now; P = 9 ``SHAPE_PARAMETERS``, as logarithms of factors on the start's shape.

    Attributes:
        change: (P,) of the hand that is tracked with.
        information: (P, P) Λ of all views.
        vector: (P,) Λθ.
        candidate: (P,) shape that is being judged; the present one before there is any.
        gains: relative change of the golden energy with the candidate, in the views since: negative where it is better.
        share: of the way to the likeliest shape that the next candidate goes.
        waited: frames since the last view.
    """

    change: Array
    information: Array
    vector: Array
    candidate: Array
    gains: tuple[float, ...]
    share: float
    waited: int


def unrefined() -> Refinement:
    """Return what is known of the shape when a run begins: it is the start's."""
    return Refinement(UNCHANGED, _PRIOR, UNCHANGED, UNCHANGED, (), 1.0, 0)


def is_due(refinement: Refinement) -> bool:
    """Tell whether enough frames have passed for the next view."""
    return refinement.waited >= _EVERY


def agreement(hand: Hand, info: StepInfo) -> float:
    """Say how much a frame counts as a view of the shape: 1 where its samples agree in the joints, 0 where they do not."""
    samples = np.concatenate([info.predicted, info.optimised])
    joints = joints_of_each(hand, samples, info.reference)
    weights = np.exp(info.log_weights)
    apart = joints - np.einsum("n,nij->ij", weights, joints)
    scatter = np.sqrt(np.einsum("n,nij->i", weights, apart**2)).mean()
    counts = float(np.exp(-((scatter / (_APART * hand.length)) ** 2)))
    return counts if counts > _COUNTS else 0.0


@lru_cache(maxsize=32)
def modelled(shape: HandShape, *, free_dip: bool = False) -> tuple[Hand, Spheres]:
    """Return the hand of a shape with the spheres of its collision term; the last ones are kept."""
    hand = shape.hand(free_dip=free_dip)
    return hand, digit_spheres(hand)


_nudged = lru_cache(maxsize=4)(nudged)


def refined(refinement: Refinement, start: HandShape, view: View, counts: float, seed: list[int]) -> Refinement:
    """Take a view into account, which from time to time changes the shape that is tracked with.

    Args:
        refinement: before the view.
        start: shape of the start.
        view: of a frame that was tracked with the present shape.
        counts: weight of the view, from :func:`agreement`.
        seed: of what is random.
    """
    free_dip = len(view.pose) > len(DOF_NAMES)
    shape = varied(start, refinement.change)
    gains = refinement.gains
    judging = not np.array_equal(refinement.candidate, refinement.change)
    if judging:
        gains = (*gains, _gain(shape, varied(start, refinement.candidate), view, seed, free_dip=free_dip))
    hand, spheres = modelled(shape, free_dip=free_dip)
    settings, rng = CostSettings(background=BACKGROUND), np.random.default_rng(seed)
    problem = make_problem(hand, view.observation, settings, view.reference, rng, spheres, pool=POOL)
    said = equations_of(problem, view.pose, _nudged(shape, free_dip=free_dip))
    told = refinement._replace(
        information=refinement.information + counts * said.information,
        vector=refinement.vector + counts * (said.information @ refinement.change - said.gradient),
        gains=gains,
        waited=0,
    )
    return _next(told) if not judging or len(gains) >= _VIEWS else told


def _gain(shape: HandShape, candidate: HandShape, view: View, seed: list[int], *, free_dip: bool) -> float:
    """By which part of it the golden energy of a view rises with a candidate; below 0 where it explains more."""

    def explained(one: HandShape) -> float:
        hand, spheres = modelled(one, free_dip=free_dip)
        rng = np.random.default_rng(seed)  # the same randomness for both
        problem = make_problem(hand, view.observation, CostSettings(), view.reference, rng, spheres)
        end, *_ = optimise(problem, SmdSettings(rounds=_ROUNDS), rng, view.pose)
        return float(golden(problem, np.stack([view.pose, end]))[0].min())

    now, then = explained(shape), explained(candidate)
    return (then - now) / max(now, _LEAST_GOLDEN)


def _next(refinement: Refinement) -> Refinement:
    """Take the candidate, if the views liked it, and choose the next one on the way to the likeliest shape."""
    change, share = refinement.change, refinement.share
    if refinement.gains:
        liked = float(np.mean(refinement.gains)) < 0.0
        change = refinement.candidate if liked else change
        share = min(1.0, 2.0 * share) if liked else max(_LEAST_SHARE, 0.5 * share)
    likeliest = np.linalg.solve(refinement.information, refinement.vector)
    step = np.clip(share * (likeliest - change), -_STEP, _STEP)
    return refinement._replace(
        change=change, candidate=np.clip(change + step, -_FARTHEST, _FARTHEST), gains=(), share=share
    )
