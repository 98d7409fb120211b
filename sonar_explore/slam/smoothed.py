"""`smoothed`: the paper's chains and link graph in front, the smoothing back-end behind (beyond the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.association import Association
from sonar_explore.slam.base import ScanEntry, ScanUpdate, SlamConfig
from sonar_explore.slam.dual import surviving
from sonar_explore.slam.motion import MotionSum, RandomWalk
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.slam import ChainSlam, turn_of
from sonar_explore.slam.smoothing import Sighting, Smoother


class SmoothedSlam(ChainSlam):
    """After every scan, all poses and all chains move to where everything measured agrees best."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, config, robot)
        odometry = config.odometry
        self._smoother = Smoother(start, config.smoothing, (odometry.turn_error, odometry.bend_rad_m))
        self._motion = MotionSum(RandomWalk(odometry.turn_rad, odometry.drift_rad, odometry.distance_m))

    def predict(self, pose_robot_in_odometry: Pose) -> Pose:
        """Carry the belief along with the odometry since the last call."""
        if self._odometry is not None:
            self._motion.add(self._odometry, pose_robot_in_odometry)
        return super().predict(pose_robot_in_odometry)

    def predict_along(self, odometry: Sequence[Pose]) -> list[Pose]:
        """`predict` at each of these readings, the pose after each."""
        return [self.predict(pose) for pose in odometry]

    def update(self, scan: Scan) -> ScanUpdate:
        """Section III first, then everything again."""
        known = self._filter.turn_error
        update = super().update(scan)
        heard = self._turn_heard and replace(self._turn_heard, relative=self._turn_heard.relative + known)
        self._smoother.add_scan(update.pose, self._motion.total if update.index else None, heard)
        self._motion.clear(turn_of(scan))
        for merge in update.merges:
            self._smoother.merge(merge.survivor, merge.absorbed)
        for feature_index, chain in self._seen(update):
            feature = update.features[feature_index]
            self._smoother.add_sighting(
                Sighting(
                    scan=update.index,
                    chain=chain,
                    bearing_rad=feature.bearing_rad - feature.sweep_rad * self._smear,
                    sweep_rad=feature.sweep_rad,
                    range_m=feature.range_m,
                    discs=feature.discs,
                )
            )
        self._smoother.solve()
        self._move_everything()
        return replace(update, pose=self.pose)

    def _seen(self, update: ScanUpdate) -> list[tuple[int, int]]:
        """(feature, chain) of this scan: the links of the final graph and the new roots."""
        kept = {
            (a.association.feature, surviving(a.association.chain, update.merges))
            for a in update.associations
            if a.kept
        }
        roots = {(self.chains[chain].root.feature_index, chain) for chain in update.new_chains}
        return sorted(kept | roots)

    def _move_everything(self) -> None:
        poses = [Pose(*map(float, row)) for row in self._smoother.poses]
        self._entries = [
            ScanEntry(pose, e.scan, e.features) for pose, e in zip(poses, self._entries, strict=True)
        ]
        self.chains.place(dict(enumerate(poses)))
        self.pose = poses[-1]
        self._filter.restart(*map(float, (*self._smoother.constants[:2], self._smoother.own[-1])))

    def _believable(self, associations: Sequence[Association], residuals: Residuals) -> NDArray[np.bool_]:
        """By the odometry since the last scan, and by how sure that scan's pose is relative to each chain."""
        spread = [
            self._smoother.covariance(association.chain, self.pose, normal)
            for association, normal in zip(associations, residuals.normals, strict=True)
        ]
        return self._filter.believable(residuals, np.array(spread).reshape(-1, 2, 2))
