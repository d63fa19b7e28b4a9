"""How far off the estimate may be: the covariance of the posterior, from the weighted samples and the curvature under them.

The filter's samples are a mixture: what they differ by, and around each a Gaussian that the cost's curvature gives (Laplace).
With few particles one sample carries nearly all the weight, so that the second part is what says something:

    Σ = Σ_n π_n (s_n − ŝ)(s_n − ŝ)ᵀ + (H/σ² + diag(1/q²))⁻¹

H is the Gauss-Newton Hessian (22) at the estimate ŝ, σ² that of the likelihood (6), and q the process noise: what the depth
does not see is known as well as the dynamics predict it over one frame. Left out are the rendered comparison, the calibration of
the hand, and minima that no particle is in. Two numbers, fitted to synthetic sessions with exact truth, stand for these: a
factor on the covariance, and the degrees of freedom of Student's t, for some sessions and fingers are far more wrong than most:

    error ~ t_ν with covariance Σ: a share p of the errors in d dimensions is within r of the estimate by Σ⁻¹, where
    r² = d (ν − 2)/ν · F⁻¹_{d,ν}(p)

They do not make the estimate of a hand that is held wrongly uncertain.

Nothing of this is computed in a step: it is asked for, of a frame's info, by whoever shows it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from spf.cost.problem import make_problem
from spf.cost.products import gauss_newton, see
from spf.filters.dynamics import noise_scale
from spf.filters.smart import SpfSettings
from spf.filters.step import StepInfo
from spf.hand.kinematics import joint_jacobian
from spf.hand.model import Hand
from spf.observation import Observation

__all__ = ["INFLATION", "TAILS", "Uncertainty", "reach_of_share", "uncertainty_of"]

Array = NDArray[np.float64]

#: Factor on the covariance, and degrees of freedom of the errors' distribution (more than 2; the fewer, the heavier its tails),
#: fitted by ``python -m benchmarks.holds.calibration``; see docs/evaluation.md.
INFLATION, TAILS = 0.5, 3.6


class Uncertainty(NamedTuple):
    """How far off an estimate may be.

    Attributes:
        pose: (D, D) covariance of the estimate's entries, m and rad.
        joints: (21, 3, 3) covariance of each joint's place, m².
        deviation: (21,) m, root mean square distance that a joint is expected to be off by.
    """

    pose: Array
    joints: Array
    deviation: Array


def uncertainty_of(
    hand: Hand, observation: Observation, info: StepInfo, settings: SpfSettings, *, factor: float = INFLATION
) -> Uncertainty:
    """Say how far off the estimate of a frame may be.

    Args:
        hand: the calibrated hand.
        observation: of the frame.
        info: what happened in the frame.
        settings: that the filter ran with.
        factor: on the covariance; 1 for what the posterior itself says.
    """
    problem = make_problem(hand, observation, settings, info.reference, np.random.default_rng(0))
    curvature = gauss_newton(problem, info.estimate, see(problem, info.estimate)) / settings.sigma2
    within = np.linalg.inv(curvature + np.diag(noise_scale(hand, settings) ** -2))
    apart = np.concatenate([info.predicted, info.optimised]) - info.estimate
    between = np.einsum("n,ni,nj->ij", np.exp(info.log_weights), apart, apart)
    pose = factor * (within + between)
    jacobian = joint_jacobian(hand, info.estimate, info.reference)
    joints = np.einsum("jai,ik,jbk->jab", jacobian, pose, jacobian)
    return Uncertainty(pose, joints, np.sqrt(np.trace(joints, axis1=1, axis2=2)))


def reach_of_share(share: float, dimensions: int = 3, tails: float = TAILS) -> float:
    """Return the r within which a share of the errors is: ``√(eᵀ Σ⁻¹ e) ≤ r`` for errors e and covariance Σ.

    Args:
        share: 0 to 1.
        dimensions: of an error: 3 in space, 2 in a picture.
        tails: degrees of freedom ν, more than 2.
    """
    return float(np.sqrt(dimensions * (tails - 2.0) / tails * fdtri(dimensions, tails, share)))
