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
from sonar_explore.slam.discs import TurnError
from sonar_explore.slam.features import Feature
from sonar_explore.slam.kalman import OWN, SIZE, TURN, X, Y
from sonar_explore.slam.landmarks import (
    BASE,
    BEARING_VARIANCE,
    CHAIN,
    ENTRIES,
    FIRST,
    KIND,
    LAST,
    LINE,
    RADIUS,
    RANGE_VARIANCE,
    SCALE,
    SECOND,
    SLOT,
    TIMES,
    best_pairs,
    candidates,
    learned,
    looked,
    observed,
    same_line,
    squared,
)
from sonar_explore.slam.odometry_filter import FilterConfig, OdometryFilter
from sonar_explore.slam.points import Point

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
        """The whole covariance; its first rows and columns lag behind `covariance` until it is settled."""
        self._full[SCALE, SCALE] = config.range_scale**2
        self._slots: dict[int, int] = {}
        """The row among the landmarks of each chain."""

    @property
    def landmarks(self) -> Array:
        """A row for each, as `landmarks` has it, shape (k, 8)."""
        return self._marks[: self._count]

    @property
    def full_covariance(self) -> Array:
        """Of pose, wheels and own turn, the scale of ranges, and two numbers of each landmark, shape (n, n)."""
        n = BASE + 2 * self._count
        full = self._full[:n, :n]
        full[:SIZE, :SIZE] = self.covariance
        if self._has_moved:
            full[:SIZE, SIZE:] = self._transition @ full[:SIZE, SIZE:]
            full[SIZE:, :SIZE] = full[:SIZE, SIZE:].T
            self._transition, self._has_moved = np.eye(SIZE), False
        return full

    def begin_scan(self, turn_rad: float) -> None:
        """A new turn, with an error of its own that has nothing to do with anything before it."""
        super().begin_scan(turn_rad)
        full = self.full_covariance
        full[OWN, SIZE:] = full[SIZE:, OWN] = 0.0

    def heard_turn(self, pose: Pose, turn: TurnError) -> tuple[Pose, float]:
        """Learn from what the discs say of the turn."""
        columns, values = np.zeros((1, ENTRIES), dtype=np.intp), np.zeros((1, ENTRIES))
        columns[0, :2], values[0, :2] = (TURN, OWN), 1.0
        before = self.turn_error
        self._spread()
        off, sure = np.array([turn.relative]), np.array([turn.sigma**2])
        pose = self._corrected(pose, *self._observed(columns, values), off, sure)
        return pose, self.turn_error - before + self.own_error

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
            self._spread()
            columns, values, innovation, noise = self._looked(pose, self._walls(walls, chains))
            squared(self._observed(columns, values)[1], innovation, noise, off)
        return np.asarray(off <= self._gate)

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
        self._spread()
        parts = [self._looked(pose, self._walls(walls, chains))]
        for one, other in same:
            first, second = self._slots[one], self._slots[other]
            columns, values, off = np.empty((2, ENTRIES), dtype=np.intp), np.empty((2, ENTRIES)), np.empty(2)
            same_line(self._marks[first], self._marks[second], first, second, columns, values, off)
            noise = np.array([self.joint.same_rad**2, self.joint.same_m**2])
            parts.append((columns, values, off, noise))
        for chain in chains:
            self._marks[self._slots[chain], LAST] = scan
        columns, values, innovation, noise = (np.concatenate(part) for part in zip(*parts, strict=True))
        return self._corrected(pose, *self._observed(columns, values), innovation, noise)

    def by_points(self, pose: Pose, points: Sequence[Point], scan: int) -> Pose:
        """The pose after the points of a scan that are known; the others are known from now on."""
        if not points:
            return pose
        self._spread()
        new = np.ones(len(points), dtype=bool)
        pairs, across, expected, innovation, noise = self._near(pose, points)
        if len(pairs):
            chosen, unmatched = np.empty(len(pairs), dtype=bool), self.joint.unmatched
            best_pairs(expected + np.diag(noise), innovation, pairs, unmatched, MOST_STEPS, chosen)
            rows = np.flatnonzero(np.repeat(chosen, 2))
            if len(rows):
                inside = expected[np.ix_(rows, rows)]
                pose = self._corrected(pose, across[rows], inside, innovation[rows], noise[rows])
                new[pairs[chosen, 0]] = False
                self._marks[pairs[chosen, 1], TIMES] += 1
                self._marks[pairs[chosen, 1], LAST] = scan
        for point in (point for point, is_new in zip(points, new, strict=True) if is_new):
            self._add_point(pose, point, scan)
        return pose

    def add_wall(self, chain: int, pose: Pose, wall: Feature, scan: int) -> None:
        """The line of a chain that this wall roots, heard from this pose."""
        depth = wall.range_m * (1.0 + self.range_scale)
        angle = pose.heading + wall.bearing_rad
        c, s = math.cos(angle), math.sin(angle)
        by_state = np.zeros((2, BASE))
        by_state[0, 2], by_state[0, TURN], by_state[0, OWN] = 1.0, wall.sweep_rad, wall.sweep_rad
        by_state[1, X], by_state[1, Y], by_state[1, SCALE] = c, s, wall.range_m
        noise = np.diag([self._bearing_of(wall), self.joint.range_m**2])
        mark = angle, 0.0, pose.x + depth * c, pose.y + depth * s, LINE, chain, 1, scan
        self._add(mark, by_state, noise)

    def adopt(self, chain: int, line: Segment, scan: int) -> None:
        """A chain that was not kept here: its line is taken to be known apart from everything else."""
        angle = line.direction + math.pi / 2
        noise = np.diag([self.joint.bearing_rad**2, self.config.normal_m**2])
        self._add((angle, 0.0, *line.midpoint, LINE, chain, 1, scan), np.zeros((2, BASE)), noise)

    def drop_wall(self, chain: int) -> None:
        """A chain that is no more."""
        if chain in self._slots:
            self._drop(self._slots[chain])

    def forget(self, scan: int) -> None:
        """Points that were heard once, some time ago; and, where there are too many, what was not heard for longest."""
        marks = self.landmarks
        once = (marks[:, KIND] != LINE) & (marks[:, TIMES] < 2)
        for slot in np.flatnonzero(once & (marks[:, LAST] <= scan - self.joint.forget_scans))[::-1]:
            self._drop(int(slot))
        while self._count > self.joint.most_landmarks:
            self._drop(int(np.argmin(self.landmarks[:, LAST])))

    @property
    def _gate(self) -> float:
        return -2.0 * math.log(1.0 - self.joint.gate_share)  # chi-squared, two degrees

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

    def _points(self, points: Sequence[Point]) -> Array:
        """As rows of what was heard, of no landmark yet."""
        bearing, spread = self.joint.point_bearing_rad**2, self.joint.point_range_m**2
        share = self.joint.radius_share
        rows = [
            (
                0,
                p.bearing_rad,
                p.range_m,
                p.sweep_rad,
                bearing,
                spread + (share * p.radius_m) ** 2,
                p.radius_m,
            )
            for p in points
        ]
        return np.array(rows).reshape(-1, RADIUS + 1)

    def _near(
        self, pose: Pose, points: Sequence[Point]
    ) -> tuple[NDArray[np.intp], Array, Array, Array, Array]:
        """Points of a scan and the landmarks that each may be, by the point, shape (k, 2), and what each says: H P and
        H P H', innovation and noise, two rows each."""
        here = np.array([point.seen_from(pose) for point in points]).reshape(-1, 2)
        kinds = np.array([float(point.kind) for point in points])
        pairs = np.empty((len(points) * self._count, 2), dtype=np.intp)
        pairs = pairs[: candidates(here, kinds, self.landmarks, self.joint.reach_m, pairs)]
        heard = self._points([points[i] for i in pairs[:, 0]])
        heard[:, SLOT] = pairs[:, 1]
        columns, values, innovation, noise = self._looked(pose, heard)
        across, expected = self._observed(columns, values)
        off = np.empty(len(pairs))
        squared(expected, innovation, noise, off)
        near = off <= self._gate
        rows = np.flatnonzero(np.repeat(near, 2))
        return pairs[near], across[rows], expected[np.ix_(rows, rows)], innovation[rows], noise[rows]

    def _looked(self, pose: Pose, heard: Array) -> tuple[NDArray[np.intp], Array, Array, Array]:
        """Jacobian, innovation and noise of what was heard, two rows each."""
        m = 2 * len(heard)
        columns, values, innovation = (
            np.empty((m, ENTRIES), dtype=np.intp),
            np.empty((m, ENTRIES)),
            np.empty(m),
        )
        place = np.array([pose.x, pose.y, pose.heading])
        looked(place, self.range_scale, self._marks, heard, columns, values, innovation)
        return columns, values, innovation, heard[:, BEARING_VARIANCE : RANGE_VARIANCE + 1].ravel()

    def _observed(self, columns: NDArray[np.intp], values: Array) -> tuple[Array, Array]:
        """H P and H P H'."""
        m, n = len(columns), len(self.full_covariance)
        across, expected = np.empty((m, n)), np.empty((m, m))
        observed(self._full, columns, values, across, expected)
        return across, expected

    def _corrected(self, pose: Pose, across: Array, expected: Array, innovation: Array, noise: Array) -> Pose:
        """One update of everything, with Huber's loss over bearing and range together; the pose after it."""
        change = np.empty(across.shape[1])
        learned(self._full, across, expected, innovation, noise, self.joint.huber_sigmas**2, change)
        self.covariance = self._full[:SIZE, :SIZE].copy()
        x, y, heading, turn_error, bend_rad_m, own_error, scale = change[:BASE].tolist()
        self.turn_error += turn_error
        self.bend_rad_m += bend_rad_m
        self.own_error += own_error
        self.range_scale += scale
        self.landmarks[:, FIRST : SECOND + 1] += change[BASE:].reshape(-1, 2)
        return Pose(pose.x + x, pose.y + y, pose.heading + heading)

    def _add_point(self, pose: Pose, point: Point, scan: int) -> None:
        depth = point.range_m * (1.0 + self.range_scale) + point.radius_m
        angle = pose.heading + point.bearing_rad
        c, s = math.cos(angle), math.sin(angle)
        by_bearing, by_range = np.array([-depth * s, depth * c]), np.array([c, s])
        by_state = np.zeros((2, BASE))
        by_state[0, X] = by_state[1, Y] = 1.0
        by_state[:, 2] = by_bearing
        by_state[:, TURN] = by_state[:, OWN] = point.sweep_rad * by_bearing
        by_state[:, SCALE] = point.range_m * by_range
        heard = self._points([point])[0]
        noise = heard[BEARING_VARIANCE] * np.outer(by_bearing, by_bearing)
        noise += heard[RANGE_VARIANCE] * np.outer(by_range, by_range)
        mark = pose.x + depth * c, pose.y + depth * s, 0.0, 0.0, float(point.kind), -1, 1, scan
        self._add(mark, by_state, noise)

    def _add(self, mark: Sequence[float], by_state: Array, noise: Array) -> None:
        """A landmark whose two numbers depend on the first unknowns in this way, with this noise."""
        self._spread()
        if self._count == len(self._marks):
            self._marks = np.concatenate([self._marks, np.empty_like(self._marks)])
            wider = np.zeros((BASE + 2 * len(self._marks),) * 2)
            wider[: len(self._full), : len(self._full)] = self._full
            self._full = wider
        full = self.full_covariance
        n, across = len(full), by_state @ full[:BASE]
        self._full[n : n + 2, :n], self._full[:n, n : n + 2] = across, across.T
        self._full[n : n + 2, n : n + 2] = across[:, :BASE] @ by_state.T + noise
        self._marks[self._count] = mark
        if mark[KIND] == LINE:
            self._slots[int(mark[CHAIN])] = self._count
        self._count += 1

    def _drop(self, slot: int) -> None:
        """Without a landmark; the last one takes its row."""
        full, last = self.full_covariance, self._count - 1
        chain, moved = int(self._marks[slot, CHAIN]), int(self._marks[last, CHAIN])
        here, there = BASE + 2 * slot, BASE + 2 * last
        full[here : here + 2] = full[there : there + 2]
        full[:, here : here + 2] = full[:, there : there + 2]
        self._marks[slot] = self._marks[last]
        if moved >= 0:
            self._slots[moved] = slot
        self._slots.pop(chain, None)
        self._count = last
