"""Smoothing (beyond the paper): all scan poses, all chain lines and the wheels as one sparse least-squares problem.

The paper moves nothing retroactively: when two chains merge, the gap stays in the map, and a root keeps the
heading error of the scan that saw it. Here every scan pose and every chain's line is estimated from everything
measured so far:

- odometry between scans, with its covariance and its dependence on the two constants of the wheels and on the own
  error of each scan's turn, which the discs of the scan may tell;
- bearing and range of each associated feature to the line of its chain; a merge puts two chains on one line. All ranges
  share one scale: the air is warmer or colder than the robot thinks, all day;
- bearing and range of each point that was met again to its place (`sonar_explore.slam.points`).

Gauss-Newton with a robust loss (Huber, then Cauchy), so that a false merge bends the map little.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.discs import TurnError
from sonar_explore.slam.elimination import Elimination, Factors
from sonar_explore.slam.jacobian import (
    Heard,
    Robust,
    Unknowns,
    anchor,
    lines_heard,
    odometry,
    own_turns,
    points_heard,
    radii_told,
)
from sonar_explore.slam.motion import Motion
from sonar_explore.slam.sighting import Sighting

HUBER, CAUCHY = 1.5, 2.0  # sigmas


@dataclass(frozen=True)
class SmoothingConfig:
    """Standard deviations of what is measured."""

    bearing_rad: float = math.radians(2.0)
    """Of a feature's normal as one disc hears it, by the lattice of headings, [rad]."""
    bearing_least_rad: float = math.radians(0.3)
    """The same, however many discs heard it, [rad]."""
    turn_error: float = 0.012
    """Of the relative error of all turns: it is learned on the way, so that a worn robot's costs a good one little."""
    bend_rad_m: float = math.radians(2.0)
    """Of the bend of straight drives, likewise, [rad/m]."""
    turn_rad: float = math.radians(1.5)
    """Random heading error of the full turn of a scan, [rad]."""
    range_m: float = 0.015
    """Of a feature's range, [m]."""
    point_bearing_rad: float = math.radians(0.45)
    """Of the bearing of a point, [rad]."""
    point_range_m: float = 0.006
    """Of the range of a point, [m]."""
    range_scale: float = 0.005
    """Of all ranges together, relative: 3 K more or less than assumed change the speed of sound by as much."""
    radius_share: float = 0.4
    """Of the radius of a column by how widely it is heard, relative."""
    iterations: int = 6
    """Gauss-Newton steps a scan at most, with Cauchy's loss; after a merge half as many with Huber's come first."""
    still_m: float = 0.002
    """A step that moves no scan farther is the last, [m]."""
    still_rad: float = 0.001
    """Nor turns any by more, [rad]."""


class Smoother:
    """The whole history, solved again after each scan."""

    def __init__(self, start: Pose, config: SmoothingConfig, wheel_sigmas: tuple[float, float]) -> None:
        self._config = config
        self._constant_sigmas = np.array([*wheel_sigmas, config.range_scale])
        self._start = np.array([start.x, start.y, start.heading])
        self.poses: Array = np.zeros((0, 3))
        """x, y [m], heading [rad] of every scan, shape (n, 3)."""
        self.constants: Array = np.zeros(3)
        """Turn error, bend [rad/m] and scale of the ranges (true over measured, less one)."""
        self.own: Array = np.zeros(0)
        """What each scan's own turn has of error beyond that, relative, shape (n,)."""
        self._turns: list[tuple[int, float, float]] = []
        self._motions: list[tuple[Array, Array, Array, Array]] = []
        """What whitens each motion, its change, its derivatives by the wheels and by the own turn."""
        self._stacked: tuple[Array, ...] = ()
        self._lines: dict[int, Array] = {}
        self._seen: Array = np.zeros((0, 7))
        """Walls on chains, a row each."""
        self._points: Array = np.zeros((0, 2))
        """Places x y of the points that were met again, in the order in which they were, [m]."""
        self._row_of_point: dict[int, int] = {}
        self.radii: Array = np.zeros(0)
        """Of the columns among them, [m]."""
        self._radius_of: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
        """Which radius each of the points has, -1 for a thin one."""
        self._met: Array = np.zeros((0, 7))
        """How scans heard them, a row each, by the row of the point."""
        self._once: dict[int, Sighting] = {}
        """Points that were heard in one scan alone: they bind nothing yet."""
        self._far_off = True
        """Whether the next solution may be far from here."""
        self._elimination = Elimination()
        self._solved: tuple[Factors, Unknowns, dict[int, int]] | None = None
        """The factors of the last solution, the unknowns then, and which line is whose chain's."""

    def add_scan(self, pose: Pose, motion: Motion | None, turn: TurnError | None = None) -> None:
        """A new scan, first guessed here.

        Args:
            motion: from the scan before, None for the first.
            turn: what the discs say of the error of its turn.
        """
        if turn is not None:
            self._turns.append((len(self.poses), turn.relative, turn.sigma))
        self.poses = np.vstack([self.poses, [pose.x, pose.y, pose.heading]])
        self.own = np.append(self.own, 0.0)
        if motion is not None:
            white = np.linalg.inv(np.linalg.cholesky(motion.covariance))
            self._motions.append((white, motion.change, motion.by_wheels, motion.by_own))

    def add_sighting(self, sighting: Sighting) -> None:
        """A wall on a chain; the first one of a chain makes its line."""
        self._seen = np.vstack([self._seen, sighting.as_row()])
        if sighting.what not in self._lines:
            angle = self._direction(sighting)
            x, y, _ = self.poses[sighting.scan]
            distance = x * math.cos(angle) + y * math.sin(angle) + sighting.range_m
            self._lines[sighting.what] = np.array([angle, distance])

    def add_point(self, sighting: Sighting) -> None:
        """A point; from the second scan that hears it on it is in the problem."""
        number = sighting.what
        if number in self._once:
            self._bind(number)
        elif number not in self._row_of_point:
            self._once[number] = sighting
            return
        self._hear(sighting)

    def _bind(self, number: int) -> None:
        """A point that was heard once is in the problem from now on."""
        first = self._once.pop(number)
        self._row_of_point[number] = len(self._points)
        self._points = np.vstack([self._points, self._places([first])])
        thick = first.radius_m > 0.0
        self._radius_of = np.append(self._radius_of, len(self.radii) if thick else -1)
        self.radii = np.append(self.radii, first.radius_m) if thick else self.radii
        self._hear(first)

    def _hear(self, sighting: Sighting) -> None:
        self._met = np.vstack([self._met, sighting.as_row()])
        self._met[-1, 1] = self._row_of_point[sighting.what]

    def merge_points(self, survivor: int, absorbed: int) -> None:
        """Two points of one kind are one."""
        for number in (survivor, absorbed):
            if number in self._once:
                self._bind(number)
        row = self._row_of_point.pop(absorbed)
        rows, radius = self._met[:, 1], self._radius_of[row]
        rows[rows == row] = self._row_of_point[survivor]
        rows[rows > row] -= 1
        self._row_of_point = {n: r - (r > row) for n, r in self._row_of_point.items()}
        self._points, self._radius_of = np.delete(self._points, row, axis=0), np.delete(self._radius_of, row)
        if radius >= 0:
            self.radii = np.delete(self.radii, radius)
            self._radius_of[self._radius_of > radius] -= 1
        self._far_off = True

    def points(self) -> tuple[NDArray[np.intp], Array]:
        """Number and place x y, shape (n, 2), [m], of every point so far."""
        numbers = np.array([*self._row_of_point, *self._once], dtype=np.intp)
        return numbers, np.vstack([self._points, self._places(list(self._once.values()))])

    def merge(self, survivor: int, absorbed: int) -> None:
        """Two chains are one wall."""
        self._seen[self._seen[:, 1] == absorbed, 1] = survivor
        self._lines.pop(absorbed, None)
        self._far_off = True

    def solve(self) -> None:
        """Move poses, lines, points and wheels to where everything agrees best."""
        at, seen, met = self._problem()
        if self._far_off:
            at, _ = self._converged(at, seen, met, _huber, self._config.iterations // 2)
        at, factors = self._converged(at, seen, met, _cauchy, self._config.iterations)
        self._far_off = False
        self.poses, self.own, self._points, self.constants = at.poses, at.own, at.points, at.constants
        self.radii = at.radii
        chains = sorted(self._lines)
        self._lines = dict(zip(chains, at.lines, strict=True))
        self._solved = factors, at, {chain: k for k, chain in enumerate(chains)}

    def misfit(self) -> float:
        """Of all walls and points as heard, as things stand: the sum of Cauchy's loss, in squared sigmas."""
        found: list[float] = []

        def summed(squared: Array) -> Array:
            found.append(float(np.log1p(squared / CAUCHY**2).sum()))
            return np.zeros_like(squared)

        self._rows(*self._problem(), summed)
        return CAUCHY**2 * sum(found)

    def copy(self) -> Smoother:
        """As it is now, whatever is added to this one or merged in it."""
        out = copy(self)
        out._met = self._met.copy()
        out._seen = self._seen.copy()
        out._radius_of = self._radius_of.copy()
        out._lines, out._once = dict(self._lines), dict(self._once)
        out._row_of_point = dict(self._row_of_point)
        out._turns, out._motions = list(self._turns), list(self._motions)
        out._elimination = copy(self._elimination)
        return out

    def _problem(self) -> tuple[Unknowns, Heard, Heard]:
        """The unknowns as they are, and walls and points as heard, by the row of each."""
        chains = sorted(self._lines)
        lines = np.array([self._lines[chain] for chain in chains]).reshape(-1, 2)
        at = Unknowns(self.poses, self.own, lines, self._points, self.radii, self.constants)
        seen = self._heard_of(self._seen, self._bearing_sigma(self._seen[:, 5]))
        seen.what[:] = np.searchsorted(chains, seen.what)
        return at, seen, self._heard_of(self._met, np.full(len(self._met), self._config.point_bearing_rad))

    def covariance(self, chain: int, at: Pose, normal: Array) -> Array:
        """How unsure the robot is of a chain's line: of its heading and of its place along the normal, shape (2, 2).

        Relative to the line, by what the solution has of the last scan, [rad] and [m]; zero for a chain that is not in
        the problem yet.

        Args:
            at: where the robot is now, taken as known relative to the last scan.
            normal: of the line, shape (2,), to the side on which the place counts as ahead.
        """
        if self._solved is None or chain not in self._solved[2]:
            return np.zeros((2, 2))
        factors, then, line_of = self._solved
        n, k = 3 * (len(then.poses) - 1), then.first_line + 2 * line_of[chain]
        angle, _ = self._lines[chain]
        c, s = math.cos(angle), math.sin(angle)
        last_x, last_y, _ = then.poses[-1]
        side = 1.0 if c * normal[0] + s * normal[1] >= 0.0 else -1.0
        ask = np.zeros((then.size, 2))
        ask[n + 2, 0], ask[k, 0] = 1.0, -1.0
        ask[n, 1], ask[n + 1, 1], ask[n + 2, 1] = c, s, s * (at.x - last_x) - c * (at.y - last_y)
        ask[k, 1], ask[k + 1, 1] = at.y * c - at.x * s, -1.0
        ask[:, 1] *= side
        return np.asarray(ask.T @ factors.solve(ask))

    def drift(self, scan: int) -> Array:
        """How unsure the last pose is, seen from this scan: x, y [m], heading [rad], map frame, shape (3, 3)."""
        if self._solved is None:
            return np.zeros((3, 3))
        factors, then, _ = self._solved
        last = len(then.poses) - 1
        away = then.poses[last] - then.poses[scan]
        ask = np.zeros((then.size, 3))
        ask[3 * last + np.arange(3), np.arange(3)] = 1.0
        ask[3 * scan + np.arange(3), np.arange(3)] -= 1.0
        ask[3 * scan + 2, 0] += away[1]
        ask[3 * scan + 2, 1] -= away[0]
        return np.asarray(ask.T @ factors.solve(ask))

    def spread(self, numbers: NDArray[np.intp], at: Array) -> Array:
        """How unsure these points are, seen from the last scan: covariance of x y, shape (n, 2, 2), map frame, [m2].

        Args:
            numbers: of the points, all of them known when it was last solved, shape (n,).
            at: where they are, shape (n, 2), map frame, [m].
        """
        if self._solved is None:
            return np.zeros((len(numbers), 2, 2))
        factors, then, _ = self._solved
        last, k = len(then.poses) - 1, np.arange(len(numbers))
        ask = np.zeros((then.size, len(numbers), 2))
        self._move_with(ask, np.full(len(k), last), k, at, -1.0)
        row = np.array([self._row_of_point.get(number, -1) for number in numbers.tolist()])
        own = np.flatnonzero(row >= 0)
        ask[then.first_point + 2 * row[own], own, 0] = 1.0
        ask[then.first_point + 2 * row[own] + 1, own, 1] = 1.0
        once = np.flatnonzero(row < 0)
        scan = np.array([self._once[number].scan for number in numbers[once].tolist()], dtype=np.intp)
        self._move_with(ask, scan, once, at[once], 1.0)
        half = factors.solve(ask.reshape(then.size, -1)).reshape(ask.shape)
        return np.einsum("mki,mkj->kij", ask, half)

    def _move_with(
        self, ask: Array, scan: NDArray[np.intp], column: NDArray[np.intp], at: Array, sign: float
    ) -> None:
        """Places x y that move with a scan each: their derivatives by its pose, into columns of `ask`."""
        away = at - self.poses[scan, :2]
        ask[3 * scan, column, 0] += sign
        ask[3 * scan + 1, column, 1] += sign
        ask[3 * scan + 2, column, 0] -= sign * away[:, 1]
        ask[3 * scan + 2, column, 1] += sign * away[:, 0]

    def _converged(
        self, at: Unknowns, seen: Heard, met: Heard, robust: Robust, steps: int
    ) -> tuple[Unknowns, Factors]:
        """Gauss-Newton until the poses stand still; the factors are of the last step."""
        n, still = len(at.poses), (self._config.still_m, self._config.still_m, self._config.still_rad)
        for _ in range(steps):
            factors, slope = self._elimination.factorised(*self._rows(at, seen, met, robust), at.sizes)
            step = factors.solve(-slope)
            at = at.moved(step)
            if (np.abs(step[: 3 * n].reshape(n, 3)) <= still).all():
                break
        return at, factors

    def _rows(
        self, at: Unknowns, seen: Heard, met: Heard, robust: Robust
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """The Jacobian and the residual, as `normal_equations` takes them."""
        config = self._config
        scans, turns, sigmas = np.array(self._turns).reshape(-1, 3).T
        blocks = [
            anchor(at, self._start, self._constant_sigmas),
            *own_turns(at, config.turn_rad / math.tau, scans.astype(np.intp), turns, sigmas),
        ]
        if self._motions:
            blocks.append(odometry(at, *self._stacked_motions()))
        if len(seen.scan):
            blocks += lines_heard(at, seen, config.range_m, robust)
        if len(met.scan):
            radius: NDArray[np.intp] = self._radius_of[met.what]
            blocks += points_heard(at, met, radius, config.point_range_m, robust)
            blocks.append(radii_told(at, *self._radii_by_width(radius)))
        widths = np.concatenate([[0], *(np.full(len(b.columns), b.columns.shape[1]) for b in blocks)])
        return (
            np.cumsum(widths),
            np.concatenate([b.columns.ravel() for b in blocks]),
            np.concatenate([b.values.ravel() for b in blocks]),
            np.concatenate([b.residual for b in blocks]),
        )

    def _stacked_motions(self) -> tuple[Array, ...]:
        if len(self._stacked) != 4 or len(self._stacked[0]) != len(self._motions):
            self._stacked = tuple(np.stack(parts) for parts in zip(*self._motions, strict=True))
        return self._stacked

    def _radii_by_width(self, radius: NDArray[np.intp]) -> tuple[Array, Array]:
        """Mean and standard deviation of every column's radius, by how widely it was heard, shape (c,), [m]."""
        thick = radius >= 0
        sums = np.bincount(radius[thick], self._met[thick, 6], len(self.radii))
        told = sums / np.bincount(radius[thick], minlength=len(self.radii))
        return told, self._config.radius_share * told

    def _heard_of(self, rows: Array, sigma: Array) -> Heard:
        scan, what = rows[:, :2].T.astype(np.intp)
        return Heard(scan, what, rows[:, 2], rows[:, 3], rows[:, 4], 1.0 / sigma)

    def _bearing_sigma(self, discs: Array) -> Array:
        config = self._config
        return np.asarray(np.sqrt(config.bearing_rad**2 / discs + config.bearing_least_rad**2))

    def _direction(self, sighting: Sighting) -> float:
        """Of the normal or of the point, map frame, [rad]."""
        error = self.constants[0] + self.own[sighting.scan]
        return float(self.poses[sighting.scan, 2] + sighting.bearing_rad + sighting.sweep_rad * error)

    def _places(self, sightings: list[Sighting]) -> Array:
        """Where points are by one scan each, x y, shape (n, 2), [m]."""
        rows = np.array([sighting.as_row() for sighting in sightings]).reshape(-1, 7)
        scan = rows[:, 0].astype(np.intp)
        angle = self.poses[scan, 2] + rows[:, 2] + rows[:, 3] * (self.constants[0] + self.own[scan])
        depth = rows[:, 4] * (1.0 + self.constants[2]) + rows[:, 6]
        return self.poses[scan, :2] + depth[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _huber(squared: Array) -> Array:
    """Weight of a squared residual."""
    return np.asarray(1.0 / np.maximum(1.0, np.sqrt(squared) / HUBER))


def _cauchy(squared: Array) -> Array:
    """Weight of a squared residual: what is far off hardly counts."""
    return np.asarray(1.0 / (1.0 + squared / CAUCHY**2))
