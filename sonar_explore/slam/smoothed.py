"""`smoothed`: the paper's chains and link graph in front, the smoothing back-end behind (beyond the paper)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.association import Association
from sonar_explore.slam.base import ScanEntry, ScanUpdate, SlamConfig
from sonar_explore.slam.dual import surviving
from sonar_explore.slam.features import Feature
from sonar_explore.slam.loop_closing import closed, settles, visits
from sonar_explore.slam.motion import MotionSum, RandomWalk
from sonar_explore.slam.point_matching import matched
from sonar_explore.slam.points import Point
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.sighting import Sighting
from sonar_explore.slam.slam import ChainSlam, turn_of
from sonar_explore.slam.smoothing import Smoother


class SmoothedSlam(ChainSlam):
    """After every scan, all poses and all chains move to where everything measured agrees best."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, config, robot)
        odometry, smoothing = config.odometry, config.smoothing
        self._smoother = Smoother(start, smoothing, (smoothing.turn_error, smoothing.bend_rad_m))
        self._points_known = self._smoother.points()
        """Their numbers and places, as last solved."""
        self._kinds: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
        """`PointKind` of every point, by its number."""
        self._heard_at: NDArray[np.intp] = np.zeros((0, 2), dtype=np.intp)
        """First and last scan that heard it."""
        self._where: Array = np.zeros((0, 3))
        """x, y [m], heading [rad] at which each scan was placed."""
        self._hears_points = False
        """Whether a scan has what points are heard by: all discs."""
        self._motion = MotionSum(RandomWalk(odometry.turn_rad, odometry.drift_rad, odometry.distance_m))

    def predict(self, pose_robot_in_odometry: Pose) -> Pose:
        """Carry the belief along with the odometry since the last call."""
        if self._odometry is not None:
            self._motion.add(self._odometry, pose_robot_in_odometry)
        return super().predict(pose_robot_in_odometry)

    def predict_along(self, odometry: Array) -> Array:
        """`predict` at each of these readings, the pose after each."""
        if self._odometry is not None:
            self._motion.add_along(np.concatenate([[self._odometry.as_row()], odometry]))
        return super().predict_along(odometry)

    def update(self, scan: Scan) -> ScanUpdate:
        """Section III first, then everything again."""
        known = self._filter.turn_error
        self._hears_points = self.config.agreement.enabled and bool(scan.others)
        update = super().update(scan)
        met = self._met_again(self._points, update.pose, self._smear - known)
        heard = self._turn_heard and replace(self._turn_heard, relative=self._turn_heard.relative + known)
        self._smoother.add_scan(update.pose, self._motion.total if update.index else None, heard)
        self._motion.clear(turn_of(scan))
        for merge in update.merges:
            self._smoother.merge(merge.survivor, merge.absorbed)
        for i, chain in self._seen(update):
            self._smoother.add_sighting(Sighting.of(update.index, chain, update.features[i], self._smear))
        for point, number in zip(self._points, met, strict=True):
            self._smoother.add_point(Sighting.of(update.index, number, point, known))
        self._heard_at[met, 1] = update.index
        self._smoother.solve()
        self._points_known = self._smoother.points()
        self._close_loops()
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

    def _met_again(self, points: Sequence[Point], pose: Pose, turn_error: float) -> list[int]:
        """The number of each point of this scan: of the one known before that it is, or a new one."""
        numbers, places = self._points_known
        out = [len(self._kinds) + k for k in range(len(points))]
        if not points:
            return out
        kinds = np.array([point.kind for point in points], dtype=np.intp)
        self._kinds = np.append(self._kinds, kinds)
        self._heard_at = np.vstack([self._heard_at, np.full((len(points), 2), len(self._entries) - 1)])
        if not len(numbers):
            return out
        here = np.array([p.seen_from(pose, turn_error) for p in points])
        config = self.config.matching
        near = (np.hypot(*(places[:, None] - here[None]).transpose(2, 0, 1)) <= config.reach_m).any(axis=1)
        numbers, places = numbers[near], places[near]
        if not len(numbers):
            return out
        spread = self._smoother.spread(numbers, places)
        variance = 0.5 * np.trace(spread, axis1=1, axis2=2)
        prior = self._filter.covariance[:3, :3]
        alike = kinds[:, None] == self._kinds[numbers]
        alike &= variance <= config.sure_m**2
        found = matched(here, np.array([pose.x, pose.y]), prior, places, variance, config, alike)
        return [int(numbers[j]) if j >= 0 else new for j, new in zip(found, out, strict=True)]

    def _close_loops(self) -> None:
        """Where what was heard of late is what was heard long ago, put the two together."""
        config, now = self.config.loops, len(self._entries) - 1
        numbers, places = self._points_known
        if not len(numbers):
            return
        (first, last), kinds = self._heard_at[numbers].T, self._kinds[numbers]
        recent = np.flatnonzero(first > now - config.recent)
        for old in visits(places, last, recent, now, config):
            prior = self._smoother.drift(int(np.median(last[old])))
            alike = kinds[recent][:, None] == kinds[old][None]
            about = self._smoother.poses[-1, :2]
            pairs = closed(places[recent], places[old], alike, about, prior, config)
            if pairs:
                same = [(int(numbers[old[j]]), int(numbers[recent[i]])) for i, j in pairs]
                self._put_together(same)
                return

    def _put_together(self, same: Sequence[tuple[int, int]]) -> None:
        """Points (survivor, absorbed), unless what was heard, of these and all others, then fits much worse."""
        before, heard_at = self._smoother.copy(), self._heard_at.copy()
        for survivor, absorbed in same:
            self._smoother.merge_points(survivor, absorbed)
            self._heard_at[survivor, 1] = self._heard_at[absorbed, 1]
        if not settles(self._smoother, before.misfit() + self.config.loops.strain * len(same)):
            self._smoother, self._heard_at = before, heard_at
        self._points_known = self._smoother.points()

    def _move_everything(self) -> None:
        """Scans and chains to where they are by the solution, but for those that have hardly moved since they were."""
        config, poses = self.config.smoothing, self._smoother.poses
        self._where = np.vstack([self._where, poses[len(self._where) :] + np.inf])
        off = np.abs(poses - self._where) > (config.settled_m, config.settled_m, config.settled_rad)
        moved = np.flatnonzero(off.any(axis=1)).tolist()
        self._where[moved] = poses[moved]
        placed = {k: Pose(*poses[k].tolist()) for k in moved}
        for k, pose in placed.items():
            self._entries[k] = ScanEntry(pose, self._entries[k].scan, self._entries[k].features)
        self.chains.place(placed)
        self.pose = placed[len(poses) - 1]
        self._filter.restart(*map(float, (*self._smoother.constants[:2], self._smoother.own[-1])))

    def _reference(
        self, predicted: Pose, features: Sequence[Feature], associations: Sequence[Association]
    ) -> Array:
        """The lines of the chains by the solution, a metre of each beside the link, shape (n, 4)."""
        rows = np.empty((len(associations), 4))
        for i, a in enumerate(associations):
            angle, distance = self._smoother.line(a.chain)
            x, y = self.chains[a.chain].links[a.link].segment.midpoint
            c, s = math.cos(angle), math.sin(angle)
            off = x * c + y * s - distance
            x, y = x - off * c, y - off * s
            rows[i] = x + 0.5 * s, y - 0.5 * c, x - 0.5 * s, y + 0.5 * c
        return rows

    def _believable(self, associations: Sequence[Association], residuals: Residuals) -> NDArray[np.bool_]:
        """By the odometry since the last scan, and by how sure that scan's pose is relative to each chain.

        Of a chain that is too unsure of where it is, seen from here, any parallel wall may seem to be the next piece.
        Points tell better, where they are heard at all: by one disc, or one for each bearing, they are not.
        """
        chains = [association.chain for association in associations]
        spread = self._smoother.covariances(chains, self.pose, residuals.normals)
        believable = self._filter.believable(residuals, spread)
        if self._hears_points:
            believable &= spread[:, 1, 1] <= self.config.matching.sure_m**2
        return believable
