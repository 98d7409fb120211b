"""One estimate of the pose, the wheels and all that the map corrects by (beyond the paper).

The paper corrects the pose by the chains and takes the chains for sure. But a chain that was rooted from a wrong pose
is as wrong as that pose was: all chains of one scan share its error, and so does the robot that is corrected by them.
The filter here keeps these correlations: its state is that of `odometry_filter`, one scale of all ranges, the line of
every chain, and points (edges, corners, columns: `points.py`). So old chains pull the robot more than young ones, a
chain's line is learned from all its links with the weight of each, and two chains that merge pull the robot and all
chains between to where the loop closes. Past poses are not in the state: nothing is moved in retrospect.
(Smith, Self and Cheeseman 1990; Durrant-Whyte and Bailey 2006.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose, Segment
from sonar_explore.slam.features import Feature
from sonar_explore.slam.joint.joint_steps import (
    added,
    dropped,
    last_stale,
    points_added,
    points_learned,
    settled,
    turn_learned,
    wall_added,
    walls_learned,
    walls_off,
)
from sonar_explore.slam.joint.landmarks import BASE, CHAIN, LAST, LINE, SCALE
from sonar_explore.slam.kalman import OWN, SIZE
from sonar_explore.slam.odometry_filter import FilterConfig, OdometryFilter, squared_gate
from sonar_explore.slam.turn.discs import TurnError
from sonar_explore.slam.turn.points import Point

MOST_STEPS = 2000
"""Of the search for the points of one scan."""


@dataclass(frozen=True)
class JointConfig:
    """Standard deviations of what is heard, and what is the same."""

    enabled: bool = False
    """The paper takes the chains for sure."""
    bearing_rad: float = math.radians(1.6)
    """Of the normal of a wall that one disc heard, [rad]."""
    bearing_least_rad: float = math.radians(0.4)
    """The same, however many discs heard it, [rad]."""
    range_m: float = 0.012
    """Of the range of a wall, [m]."""
    range_scale: float = 0.005
    """Of all ranges together, relative: 3 K more or less than assumed change the speed of sound by as much."""
    point_bearing_rad: float = math.radians(0.6)
    """Of the bearing of a point, [rad]."""
    point_range_m: float = 0.008
    """Of the range of a point, [m]."""
    radius_share: float = 0.4
    """Of the radius of a column by how widely it is heard, relative."""
    gate_share: float = 0.997
    """Of true associations are believable."""
    huber_sigmas: float = 1.0
    """What is farther off than this counts less the farther it is."""
    unmatched: float = 4.0
    """What a point costs that is none of those known, in squared standard deviations: one farther off is another."""
    reach_m: float = 1.0
    """A point farther off than this is another, however unsure the pose, [m]."""
    same_m: float = 0.01
    """Two chains that merge are one line to this, [m]."""
    same_rad: float = math.radians(0.3)
    """And to this, [rad]."""
    forget_scans: int = 10
    """A point that was heard once, and not again in so many scans, is forgotten."""
    most_landmarks: int = 200
    """More are not kept: those that were not heard for longest are forgotten, so that no scan costs more and more."""


class JointFilter(OdometryFilter):
    """Covariance of pose, wheels, ranges, lines and points."""

    def __init__(self, odometry: FilterConfig, config: JointConfig) -> None:
        super().__init__(odometry)
        self.joint = config
        self.range_scale = 0.0
        """True over measured range, less one."""
        self._marks: Array = np.empty((16, 8))
        self._count = 0
        self._full: Array = np.zeros((BASE + 32, BASE + 32))
        """The whole covariance; its first rows and columns lag behind `covariance` until that is settled."""
        self._settled = False
        self._full[SCALE, SCALE] = config.range_scale**2
        self._slots: dict[int, int] = {}
        """The row among the landmarks of each chain."""
        self._joint_huber = config.huber_sigmas**2
        self._joint_gate = squared_gate(config.gate_share)
        self._same_noise = np.array([config.same_rad**2, config.same_m**2])

    @property
    def landmarks(self) -> Array:
        """A row for each, as `landmarks` has it, shape (k, 8)."""
        return self._marks[: self._count]

    @property
    def full_covariance(self) -> Array:
        """Of pose, wheels and own turn, the scale of ranges, and two numbers of each landmark, shape (n, n)."""
        self._settle()
        n = BASE + 2 * self._count
        return self._full[:n, :n]

    def _settle(self) -> None:
        """Take what motions did into the whole covariance."""
        self._spread()
        if not self._settled:
            settled(self.landmarks, self._full, self.covariance, self._transition)
            self._settled = True

    def _spread_by(self, bits: Array) -> None:
        super()._spread_by(bits)
        self._settled = False

    @property
    def _estimate(self) -> tuple[Array, Array, Array]:
        """Landmarks and covariances as the steps take them."""
        return self.landmarks, self._full, self.covariance

    def _state(self, pose: Pose) -> Array:
        """The pose, and what is believed of wheels, turn and ranges, as the steps take it, shape (7,)."""
        wheels = self.turn_error, self.bend_rad_m, self.own_error
        return np.array([pose.x, pose.y, pose.heading, *wheels, self.range_scale])

    def _believe(self, state: Array) -> Pose:
        """Take what a step made of it; the pose."""
        x, y, heading, self.turn_error, self.bend_rad_m, self.own_error, self.range_scale = state.tolist()
        return Pose(x, y, heading)

    def begin_scan(self, turn_rad: float) -> None:
        """A new turn, with an error of its own that has nothing to do with anything before it."""
        super().begin_scan(turn_rad)
        self._settled = False
        self._settle()
        n = BASE + 2 * self._count
        self._full[OWN, SIZE:n] = self._full[SIZE:n, OWN] = 0.0

    def heard_turn(self, pose: Pose, turn: TurnError) -> tuple[Pose, float]:
        """Learn from what the discs say of the turn."""
        before, state = self.turn_error, self._state(pose)
        self._settle()
        turn_learned(state, *self._estimate, turn.relative, turn.sigma**2, self._joint_huber)
        return self._believe(state), self.turn_error - before + self.own_error

    def line(self, chain: int, near: tuple[float, float]) -> Segment | None:
        """A piece of the line of a chain beside this place, x y [m]; None for a chain that is not kept here."""
        slot = self._slots.get(chain)
        if slot is None:
            return None
        angle, beyond, x, y = self._marks[slot, :4].tolist()
        c, s = math.cos(angle), math.sin(angle)
        along = c * (near[1] - y) - s * (near[0] - x)
        x, y = x + beyond * c - along * s, y + beyond * s + along * c
        return Segment(x + 0.5 * s, y - 0.5 * c, x - 0.5 * s, y + 0.5 * c)

    def walls_believable(
        self, pose: Pose, walls: Sequence[Feature], chains: Sequence[int]
    ) -> NDArray[np.bool_]:
        """Which of these walls of a scan may be of these chains, all of them kept here, shape (n,)."""
        off = np.empty(len(walls))
        if len(walls):
            self._settle()
            heard = self._walls(walls, chains)
            walls_off(self._state(pose), self.landmarks, self._full, heard, off)
        return np.asarray(off <= self._joint_gate)

    def by_walls(
        self,
        pose: Pose,
        walls: Sequence[Feature],
        chains: Sequence[int],
        same: Sequence[tuple[int, int]],
        scan: int,
    ) -> Pose:
        """The pose after these walls of a scan, of these chains, when these two of them each are one line."""
        if not len(walls):
            return pose
        self._settle()
        state, heard = self._state(pose), self._walls(walls, chains)
        lines = np.array([(self._slots[a], self._slots[b]) for a, b in same], dtype=np.int64).reshape(-1, 2)
        told = heard, lines, self._same_noise
        walls_learned(state, *self._estimate, *told, self._joint_huber, scan)
        return self._believe(state)

    def by_points(self, pose: Pose, points: Sequence[Point], scan: int, turn_error: float = 0.0) -> Pose:
        """The pose after the points of a scan that are known; the others are known from now on.

        Args:
            turn_error: by how much more the robot turned than their bearings have it, relative.
        """
        if not points:
            return pose
        self._settle()
        state, heard, joint = self._state(pose), self._points(points, turn_error), self.joint
        kinds, met = (
            np.array([point.kind for point in points], dtype=float),
            np.empty(len(points), dtype=bool),
        )
        limits = joint.reach_m, self._joint_gate, joint.unmatched, MOST_STEPS, self._joint_huber
        points_learned(state, *self._estimate, heard, kinds, *limits, scan, met)
        self._make_room(len(points))
        self._count = points_added(state, self._marks, self._count, self._full, heard, kinds, met, scan)
        return self._believe(state)

    def add_wall(self, chain: int, pose: Pose, wall: Feature, scan: int) -> None:
        """The line of a chain that this wall roots, heard from this pose."""
        self._settle()
        self._make_room(1)
        self._slots[chain] = self._count
        (heard,) = self._walls([wall], [chain])
        wall_added(self._state(pose), self._marks, self._count, self._full, heard, chain, scan)
        self._count += 1

    def adopt(self, chain: int, line: Segment, scan: int) -> None:
        """A chain that was not kept here: its line is taken to be known apart from everything else."""
        angle = line.direction + math.pi / 2
        noise = np.diag([self.joint.bearing_rad**2, self.config.normal_m**2])
        self._settle()
        self._make_room(1)
        added(self._full, BASE + 2 * self._count, np.zeros((2, BASE)), noise)
        self._slots[chain] = self._count
        self._marks[self._count] = angle, 0.0, *line.midpoint, LINE, chain, 1, scan
        self._count += 1

    def drop_wall(self, chain: int) -> None:
        """A chain that is no more."""
        if chain in self._slots:
            self._drop(self._slots[chain])

    def forget(self, scan: int) -> None:
        """Points that were heard once, some time ago; and, where there are too many, what was not heard for longest."""
        while (slot := last_stale(self.landmarks, scan - self.joint.forget_scans)) >= 0:
            self._drop(slot)
        while self._count > self.joint.most_landmarks:
            self._drop(int(np.argmin(self.landmarks[:, LAST])))

    def _bearing_of(self, wall: Feature) -> float:
        return self.joint.bearing_rad**2 / wall.discs + self.joint.bearing_least_rad**2

    def _walls(self, walls: Sequence[Feature], chains: Sequence[int]) -> Array:
        """As rows of what was heard."""
        variance = self.joint.range_m**2
        return np.array(
            [
                (self._slots[c], w.bearing_rad, w.range_m, w.sweep_rad, self._bearing_of(w), variance, 0.0)
                for w, c in zip(walls, chains, strict=True)
            ]
        )

    def _points(self, points: Sequence[Point], turn_error: float) -> Array:
        """As rows of what was heard, of no landmark yet."""
        bearing, spread = self.joint.point_bearing_rad**2, self.joint.point_range_m**2
        share, rows = self.joint.radius_share, []
        for p in points:
            turned, variance = p.bearing_rad + turn_error * p.sweep_rad, spread + (share * p.radius_m) ** 2
            rows.append((0.0, turned, p.range_m, p.sweep_rad, bearing, variance, p.radius_m))
        return np.array(rows)

    def _make_room(self, more: int) -> None:
        """For so many landmarks more."""
        while self._count + more > len(self._marks):
            self._marks = np.concatenate([self._marks, np.empty_like(self._marks)])
            wider = np.zeros((BASE + 2 * len(self._marks),) * 2)
            wider[: len(self._full), : len(self._full)] = self._full
            self._full = wider

    def _drop(self, slot: int) -> None:
        """Without a landmark; the last one takes its row."""
        chain, moved = int(self._marks[slot, CHAIN]), int(self._marks[self._count - 1, CHAIN])
        self._settle()
        dropped(self.landmarks, self._full, slot)
        if moved >= 0:
            self._slots[moved] = slot
        self._slots.pop(chain, None)
        self._count -= 1
