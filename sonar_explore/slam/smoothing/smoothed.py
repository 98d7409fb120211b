"""`smoothed`: the paper's chains and link graph in front, the smoothing back-end behind (beyond the paper)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.association import Association
from sonar_explore.slam.base import ScanEntry, ScanUpdate, SlamConfig
from sonar_explore.slam.dual import surviving
from sonar_explore.slam.features import Feature
from sonar_explore.slam.motion import MotionSum, RandomWalk
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.slam import ChainSlam
from sonar_explore.slam.smoothing.loop_closing import closed, may_close, settles, visits
from sonar_explore.slam.smoothing.point_matching import met_again
from sonar_explore.slam.smoothing.smoothing import Smoother
from sonar_explore.slam.turn.discs import TurnError
from sonar_explore.slam.turn.points import Point
from sonar_explore.slam.turn.sighting import Sighting


class SmoothedSlam(ChainSlam):
    """After every scan, all poses and all chains move to where everything measured agrees best."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, config, robot)
        odometry, smoothing = config.odometry, config.smoothing
        self._smoother = Smoother(start, smoothing, (smoothing.turn_error, smoothing.bend_rad_m))
        self._points_known = self._smoother.points()
        """Their numbers and places, as last solved."""
        self._where: Array = np.full((64, 3), np.inf)
        """x, y [m], heading [rad] at which each scan was placed."""
        self._moved: NDArray[np.bool_] = np.zeros(64, dtype=bool)
        """Scans that were placed elsewhere since their entry was made,"""
        self._stale = False
        """and whether there are any."""
        self._hears_points = False
        """Whether a scan has what points are heard by: all discs."""
        self._motion = MotionSum(RandomWalk(odometry.turn_rad, odometry.drift_rad, odometry.distance_m))

    @property
    def scans(self) -> tuple[ScanEntry, ...]:
        """Every scan so far, in order, at the poses now believed."""
        if self._stale:
            moved = np.flatnonzero(self._moved)
            for k, row in zip(moved.tolist(), self._where[moved].tolist(), strict=True):
                entry = self._entries[k]
                self._entries[k] = ScanEntry(Pose(*row), entry.scan, entry.features)
            self._moved[:] = self._stale = False
            self._scans = None
        return super().scans

    def _pose_of(self, scan: int) -> Pose:
        return Pose(*self._where[scan].tolist())

    def _poses_of(self, scans: NDArray[np.intp]) -> Array:
        return self._where[scans]

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
        turn = self._turn_heard
        heard = TurnError(turn.relative + known, turn.sigma) if turn else None
        self._smoother.add_scan(update.pose, self._motion.total if update.index else None, heard)
        self._motion.clear(self._turn_rad)
        for merge in update.merges:
            self._smoother.merge(merge.survivor, merge.absorbed)
        for i, chain in self._seen(update):
            self._smoother.add_sighting(Sighting.of(update.index, chain, update.features[i], self._smear))
        for point, number in zip(self._points, met, strict=True):
            self._smoother.add_point(Sighting.of(update.index, number, point, known))
        self._smoother.solve()
        self._points_known = self._smoother.points()
        self._close_loops()
        self._move_everything()
        return ScanUpdate(**{**vars(update), "pose": self.pose})

    def _seen(self, update: ScanUpdate) -> list[tuple[int, int]]:
        """(feature, chain) of this scan: the links of the final graph and the new roots."""
        kept = {(a.feature, surviving(a.chain, update.merges)) for a in update.link_graphs.kept}
        roots = {(self.chains[chain].root.feature_index, chain) for chain in update.new_chains}
        return sorted(kept | roots)

    def _met_again(self, points: Sequence[Point], pose: Pose, turn_error: float) -> list[int]:
        """The number of each point of this scan: of the one known before that it is, or a new one."""
        first = self._smoother.known_points.count
        out = list(range(first, first + len(points)))
        if not points or not first:
            return out
        prior, config = self._filter.covariance, self.config.matching
        found = met_again(points, pose, turn_error, prior, self._smoother, self._points_known, config)
        return [number if number >= 0 else new for number, new in zip(found, out, strict=True)]

    def _close_loops(self) -> None:
        """Where what was heard of late is what was heard long ago, put the two together."""
        config, now = self.config.loops, len(self._entries) - 1
        numbers, places = self._points_known
        if not may_close(self._smoother, numbers, places, config):
            return
        _, _, kinds, first, last = self._smoother.known_points.rows[numbers].T
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
        before = self._smoother.copy()
        for survivor, absorbed in same:
            self._smoother.merge_points(survivor, absorbed)
        if not settles(self._smoother, before.misfit() + self.config.loops.strain * len(same)):
            self._smoother = before
        self._points_known = self._smoother.points()

    def _move_everything(self) -> None:
        """Scans and chains to where they are by the solution, but for those that have hardly moved since they were."""
        config, n = self.config.smoothing, len(self._entries)
        if n > len(self._where):
            self._where = np.concatenate([self._where, np.full_like(self._where, np.inf)])
            self._moved = np.concatenate([self._moved, np.zeros_like(self._moved)])
        variables, _, values, *_ = self._smoother.solved
        scans, poses = np.empty(n, dtype=np.intp), np.empty((n, 3))
        still = config.settled_m, config.settled_m, config.settled_rad
        count = _settle(variables, values, still, self._where, self._moved, scans, poses)
        if count:
            self._stale = True
            self.chains.place(scans[:count], poses[:count])
        self.pose = self._pose_of(n - 1)
        turn_error, bend, _ = self._smoother.constants.tolist()
        self._filter.restart(turn_error, bend, self._smoother.own_error)

    def _reference(
        self, predicted: Pose, features: Sequence[Feature], associations: Sequence[Association]
    ) -> Array:
        """The lines of the chains by the solution, a metre of each beside the link, shape (n, 4)."""
        rows = np.empty((len(associations), 4))
        for i, a in enumerate(associations):
            angle, distance = self._smoother.line(a.chain)
            x1, y1, x2, y2 = self.chains.segments[self.chains.row(a.chain, a.link)].tolist()
            x, y = 0.5 * (x1 + x2), 0.5 * (y1 + y2)
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
        features = np.array([association.feature for association in associations], dtype=np.intp)
        sure_m = self.config.matching.sure_m if self._hears_points else math.inf
        return self._filter.believable(residuals, spread, features, sure_m)


@lean_kernel
def _settle(variables, values, still, where, moved, scans, poses):  # type: ignore[no-untyped-def]
    """Scans farther from where they were placed than what is `still` are there now: which, and where; how many."""
    count = 0
    for k in range(len(variables)):
        pose = values[variables[k]]
        for i in range(3):
            if abs(pose[i] - where[k, i]) > still[i]:
                for j in range(3):
                    where[k, j] = poses[count, j] = pose[j]
                moved[k], scans[count] = True, k
                count += 1
                break
    return count
