"""Chains at poses that another estimator found: what the baselines share.

The policy reads chains, so every choice of `--slam` builds them; here they correct nothing. The odometry between scans,
and what the discs say of each turn, is the same as that of `chain`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.base import ScanEntry, ScanUpdate, SlamConfig
from sonar_explore.slam.features import Feature
from sonar_explore.slam.link_graph import LinkGraphs
from sonar_explore.slam.localization import Correction
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.slam import ChainSlam
from sonar_explore.slam.turn.agreement import Extraction


class LocatedSlam(ChainSlam, ABC):
    """A subclass says where the robot has been; this class does the rest."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, replace(config, odometry=replace(config.odometry, enabled=True)), robot)
        self._told = False

    @abstractmethod
    def _next(self, features: Sequence[Feature], predicted: Pose, spread: Array | None) -> list[Pose]:
        """Pose of every scan so far, with the one just taken.

        Args:
            predicted: by odometry from the last scan, or as placed from outside.
            spread: covariance of it, x y [m] heading [rad], map frame, shape (3, 3); None where it is known for sure.
        """

    def update(self, scan: Scan) -> ScanUpdate:
        """Find the pose, then build the chains there."""
        update = super().update(scan)
        return replace(update, predicted_pose=self._by_odometry)

    def _predicted_at(self, scan: Scan) -> Pose:
        self._told = self._placed is not None or not self._entries
        self._by_odometry = super()._predicted_at(scan)
        return self._by_odometry

    def _turned(
        self, predicted: Pose, scan: Scan, extraction: Extraction
    ) -> tuple[Pose, tuple[Feature, ...]]:
        straight, features = super()._turned(predicted, scan, extraction)
        if self._told:
            self._follow(self._next(features, predicted, None))
        else:
            self._follow(self._next(features, straight, self._filter.covariance[:3, :3].copy()))
        self._filter.covariance[:3, :] = self._filter.covariance[:, :3] = (
            0.0  # sure of it until it moves again
        )
        return self.pose, features

    def _correct(
        self, predicted: Pose, features: Sequence[Feature], graphs: LinkGraphs, residuals: Residuals
    ) -> Correction:
        return Correction()

    def _follow(self, poses: Sequence[Pose]) -> None:
        """Move scans and chains to where the robot is now taken to have been."""
        moved = {
            i: pose for i, (pose, e) in enumerate(zip(poses, self._entries, strict=False)) if pose != e.pose
        }
        if moved:
            self._entries = [
                ScanEntry(moved.get(i, e.pose), e.scan, e.features) for i, e in enumerate(self._entries)
            ]
            self._scans = None
            self.chains.place(np.array([*moved]), np.array([pose.as_row() for pose in moved.values()]))
        self.pose = poses[-1]
