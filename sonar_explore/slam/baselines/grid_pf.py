"""`grid-pf`: a Rao-Blackwellised particle filter on sonar occupancy grids, to compare with (beyond the paper)."""

from __future__ import annotations

from collections.abc import Sequence

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.base import SlamConfig
from sonar_explore.slam.baselines.end_points import end_points
from sonar_explore.slam.baselines.located import LocatedSlam
from sonar_explore.slam.baselines.particles import ParticleFilter
from sonar_explore.slam.baselines.scan_matching import turned
from sonar_explore.slam.features import Feature


class GridParticleSlam(LocatedSlam):
    """The robot went where the particles went on the whole."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, config, robot)
        self._particles = ParticleFilter(start, config.particles)

    def _next(self, features: Sequence[Feature], predicted: Pose, spread: Array | None) -> list[Pose]:
        if spread is None:
            self._particles.place(predicted)
        else:
            before = self._entries[-1].pose
            self._particles.move(before.inverse() @ predicted, turned(spread, -before.heading))
        self._particles.weigh(end_points(features))
        return [Pose(*map(float, row)) for row in self._particles.path]
