"""`scan-match`: each scan is matched with the points of all past scans, to compare with (beyond the paper)."""

from __future__ import annotations

from collections.abc import Sequence

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.base import SlamConfig
from sonar_explore.slam.baselines.end_points import end_points
from sonar_explore.slam.baselines.located import LocatedSlam
from sonar_explore.slam.baselines.scan_matching import PastScans
from sonar_explore.slam.features import Feature


class ScanMatchSlam(LocatedSlam):
    """Corrects the last pose alone: what is past stays where it was matched."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, config, robot)
        self._past = PastScans(config.scan_match)

    def _next(self, features: Sequence[Feature], predicted: Pose, spread: Array | None) -> list[Pose]:
        points = end_points(features)
        pose = predicted if spread is None else self._past.match(predicted, spread, points)
        self._past.add(pose, points)
        return [*(entry.pose for entry in self._entries), pose]
