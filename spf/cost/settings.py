"""Settings of the cost's terms."""

from __future__ import annotations

import dataclasses

from spf.kernels.cost import CostWeights
from spf.settings import Settings, setting

__all__ = ["CostSettings"]

_COST = "Cost"
LENGTH = 0.01  # ℓ, m: makes E dimensionless and keeps the meaning of the paper's k
# Robust scales, m, of model points behind and in front of the surface, and of point-to-point distances.
BEHIND, FRONT, PULL = 0.015, 0.03, 0.03


@dataclasses.dataclass(frozen=True)
class CostSettings(Settings):
    """What is compared between model and observation (spec 4)."""

    k: float = setting(1.0, "weight of the difference of normals", group=_COST, low=0.0, high=30.0, symbol="k")
    points: int = setting(45, "model points in a sample", group=_COST, low=5, high=1000, symbol="|S|")
    data_points: int = setting(30, "observed pixels in a sample, matched to the model", group=_COST, low=0, high=1000)
    coverage: float = setting(
        1.0, "weight of observed pixels to the model; 0 is the paper's cost", group=_COST, low=0.0, high=30.0
    )
    background: float = setting(
        0.2, "pull of points beside the hand to the nearest hand pixel", group=_COST, low=0.0, high=10.0
    )
    collision: float = setting(3.0, "push between digits that intersect", group=_COST, low=0.0, high=100.0)
    robust: bool = setting(True, "bounded influence of large distances, weaker behind the surface", group=_COST)
    zbuffer: bool = setting(True, "sample only model points that the camera sees", group=_COST)
    golden: float = setting(
        3.0, "weight of the rendered comparison in the likelihood", group=_COST, low=0.0, high=100.0
    )

    def weights(self) -> CostWeights:
        """Return the weights that the kernels take."""
        return CostWeights(
            points=float(self.points),
            length=LENGTH,
            normal=float(self.k),
            behind=1.0 / BEHIND**2 if self.robust else 0.0,
            front=1.0 / FRONT**2 if self.robust else 0.0,
            pull=1.0 / PULL**2 if self.robust else 0.0,
            background=float(self.background),
            coverage=float(self.coverage),
            collision=float(self.collision),
        )
