"""Smoothing (beyond the paper): all scan poses, all chain lines and the wheels as one sparse least-squares problem.

The paper moves nothing retroactively: when two chains merge, the gap stays in the map, and a root keeps the
heading error of the scan that saw it. Here every scan pose and every chain's line is estimated from everything
measured so far:

- odometry between scans, with its covariance and its dependence on the two constants of the wheels and on the own
  error of each scan's turn, which the discs of the scan may tell;
- bearing and range of each associated feature to the line of its chain; a merge puts two chains on one line. All ranges
  share one scale: the air is warmer or colder than the robot thinks, all day.

Gauss-Newton with a robust loss (Huber, then Cauchy), so that a false merge bends the map little.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.slam.agreement import TurnError
from sonar_explore.slam.motion import Motion
from sonar_explore.slam.normal_equations import normal_equations

Robust = Callable[[Array], Array]
"""Weights of squared residuals, in sigmas."""
HUBER, CAUCHY = 1.5, 2.0  # sigmas


@dataclass(frozen=True)
class SmoothingConfig:
    """Standard deviations of what is measured."""

    bearing_rad: float = math.radians(2.0)
    """Of a feature's normal as one disc hears it, by the lattice of headings, [rad]."""
    bearing_least_rad: float = math.radians(0.3)
    """The same, however many discs heard it, [rad]."""
    turn_rad: float = math.radians(1.5)
    """Random heading error of the full turn of a scan, [rad]."""
    range_m: float = 0.015
    """Of a feature's range, [m]."""
    range_scale: float = 0.005
    """Of all ranges together, relative: 3 K more or less than assumed change the speed of sound by as much."""
    iterations: int = 6
    """Gauss-Newton steps a scan at most, with Cauchy's loss; after a merge half as many with Huber's come first."""
    still_m: float = 0.002
    """A step that moves no scan farther is the last, [m]."""
    still_rad: float = 0.001
    """Nor turns any by more, [rad]."""


@dataclass(frozen=True)
class Sighting:
    """A feature of one scan on one chain."""

    scan: int
    chain: int
    bearing_rad: float
    """Of the normal, as the odometry has it, robot frame at the start of the scan, [rad]."""
    sweep_rad: float
    """How far the robot had turned when it heard it, signed, [rad]."""
    range_m: float
    """[m]"""
    discs: int = 1
    """How many discs heard it."""


class Smoother:
    """The whole history, solved again after each scan."""

    def __init__(self, start: Pose, config: SmoothingConfig, wheel_sigmas: tuple[float, float]) -> None:
        self._config = config
        self._constant_sigmas = np.array([*wheel_sigmas, config.range_scale])
        self._start = start
        self.poses: Array = np.zeros((0, 3))
        """x, y [m], heading [rad] of every scan, shape (n, 3)."""
        self.constants: Array = np.zeros(3)
        """Turn error, bend [rad/m] and scale of the ranges (true over measured, less one), the last unknowns."""
        self.own: Array = np.zeros(0)
        """What each scan's own turn has of error beyond that, relative, shape (n,)."""
        self._turns: list[tuple[int, TurnError]] = []
        self._lines: dict[int, Array] = {}
        self._motions: list[tuple[Array, Array, Array, Array]] = []
        """What whitens each motion, its change, its derivatives by the wheels and by the own turn."""
        self._sightings: list[Sighting] = []
        self._stacked: tuple[Array, ...] = ()
        self._far_off = True
        """Whether the next solution may be far from here."""
        self._factor: SuperLU | None = None

    def add_scan(self, pose: Pose, motion: Motion | None, turn: TurnError | None = None) -> None:
        """A new scan, first guessed here.

        Args:
            motion: from the scan before, None for the first.
            turn: what the discs say of the error of its turn.
        """
        if turn is not None:
            self._turns.append((len(self.poses), turn))
        self.poses = np.vstack([self.poses, [pose.x, pose.y, pose.heading]])
        self.own = np.append(self.own, 0.0)
        if motion is not None:
            white = np.linalg.inv(np.linalg.cholesky(motion.covariance))
            self._motions.append((white, motion.change, motion.by_wheels, motion.by_own))

    def add_sighting(self, sighting: Sighting) -> None:
        """A feature on a chain; the first one of a chain makes its line."""
        self._sightings.append(sighting)
        if sighting.chain not in self._lines:
            x, y, heading = self.poses[sighting.scan]
            error = self.constants[0] + self.own[sighting.scan]
            angle = heading + sighting.bearing_rad + sighting.sweep_rad * error
            self._lines[sighting.chain] = np.array(
                [angle, x * math.cos(angle) + y * math.sin(angle) + sighting.range_m]
            )

    def merge(self, survivor: int, absorbed: int) -> None:
        """Two chains are one wall."""
        self._sightings = [replace(s, chain=survivor) if s.chain == absorbed else s for s in self._sightings]
        self._lines.pop(absorbed, None)
        self._far_off = True

    def solve(self) -> None:
        """Move poses, lines and wheels to where everything agrees best."""
        chains = sorted(self._lines)
        column = {chain: 4 * len(self.poses) + 2 * k for k, chain in enumerate(chains)}
        sightings = _Stack.of(self._sightings, column, self._config)
        lines = np.array([self._lines[chain] for chain in chains]).reshape(-1, 2)
        if self._far_off:
            lines = self._converged(sightings, lines, _huber, self._config.iterations // 2)
        lines = self._converged(sightings, lines, _cauchy, self._config.iterations)
        self._far_off = False
        self._lines = dict(zip(chains, lines, strict=True))
        self._column = column

    def covariance(self, chain: int, at: Pose, normal: Array) -> Array:
        """How unsure the robot is of a chain's line: of its heading and of its place along the normal, shape (2, 2).

        Relative to the line, by what the solution has of the last scan, [rad] and [m]; zero for a chain that is not in
        the problem yet.

        Args:
            at: where the robot is now, taken as known relative to the last scan.
            normal: of the line, shape (2,), to the side on which the place counts as ahead.
        """
        if self._factor is None or chain not in self._column:
            return np.zeros((2, 2))
        n, k = 3 * (len(self.poses) - 1), self._column[chain]
        angle, _ = self._lines[chain]
        c, s = math.cos(angle), math.sin(angle)
        last_x, last_y, _ = self.poses[-1]
        side = 1.0 if c * normal[0] + s * normal[1] >= 0.0 else -1.0
        ask = np.zeros((self._factor.shape[0], 2))
        ask[n + 2, 0], ask[k, 0] = 1.0, -1.0
        ask[n, 1], ask[n + 1, 1], ask[n + 2, 1] = c, s, s * (at.x - last_x) - c * (at.y - last_y)
        ask[k, 1], ask[k + 1, 1] = at.y * c - at.x * s, -1.0
        ask[:, 1] *= side
        return np.asarray(ask.T @ self._factor.solve(ask))

    def _converged(self, sightings: _Stack, lines: Array, robust: Robust, steps: int) -> Array:
        """Gauss-Newton until the poses stand still; the lines then."""
        n, config = len(self.poses), self._config
        for _ in range(steps):
            step = self._step(sightings, lines, robust)
            moved = step[: 3 * n].reshape(n, 3)
            self.poses = self.poses + moved
            self.own = self.own + step[3 * n : 4 * n]
            lines = lines + step[4 * n : -3].reshape(-1, 2)
            self.constants = self.constants + step[-3:]
            if (np.abs(moved) <= (config.still_m, config.still_m, config.still_rad)).all():
                break
        return lines

    def _step(self, sightings: _Stack, lines: Array, robust: Robust) -> Array:
        size = 4 * len(self.poses) + 2 * len(lines) + 3
        blocks = [self._anchor(size), *self._own_turns(size)]
        if self._motions:
            blocks.append(self._odometry(size))
        if len(sightings.scan):
            blocks += self._sighted(sightings, lines, size, robust)
        widths = np.concatenate([np.full(len(b.columns), b.columns.shape[1]) for b in blocks])
        normal, slope = normal_equations(
            np.concatenate([[0], np.cumsum(widths)]),
            np.concatenate([b.columns.ravel() for b in blocks]),
            np.concatenate([b.values.ravel() for b in blocks]),
            np.concatenate([b.residual for b in blocks]),
            size,
        )
        self._factor = splu(  # symmetric and positive: no pivots, an order that keeps it sparse
            normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        return np.asarray(self._factor.solve(-slope))

    def _anchor(self, size: int) -> _Rows:
        """The first scan stands at the start; wheels and temperature are about right."""
        weight = np.concatenate([np.full(3, 1e4), 1.0 / self._constant_sigmas])
        columns = np.array([0, 1, 2, size - 3, size - 2, size - 1])
        start = np.array([self._start.x, self._start.y, self._start.heading])
        off = np.concatenate([self.poses[0] - start, self.constants])
        return _Rows(columns[:, None], weight[:, None], weight * off)

    def _own_turns(self, size: int) -> tuple[_Rows, _Rows]:
        """Every scan's turn is about as the wheels turn, and about as its discs say."""
        n = len(self.poses)
        loose = math.tau / self._config.turn_rad
        scans = np.array([scan for scan, _ in self._turns], dtype=np.intp)
        heard = np.array([turn.relative for _, turn in self._turns])
        weight = np.array([1.0 / turn.sigma for _, turn in self._turns])
        off = weight * (self.constants[0] + self.own[scans] - heard)
        columns = np.column_stack([3 * n + scans, np.full(len(scans), size - 3)])
        return (
            _Rows(3 * n + np.arange(n)[:, None], np.full((n, 1), loose), loose * self.own),
            _Rows(columns, np.column_stack([weight, weight]), off),
        )

    def _odometry(self, size: int) -> _Rows:
        m = len(self._motions)
        white, change, by_wheels, by_own = self._stacked_motions()
        here, there = self.poses[:m], self.poses[1 : m + 1]
        c, s = np.cos(here[:, 2]), np.sin(here[:, 2])
        back = np.zeros((m, 3, 3))
        back[:, 0, 0], back[:, 0, 1], back[:, 1, 0], back[:, 1, 1], back[:, 2, 2] = c, s, -s, c, 1.0
        moved = (back @ (there - here)[:, :, None])[:, :, 0]
        by_here = -back
        by_here[:, 0, 2], by_here[:, 1, 2] = moved[:, 1], -moved[:, 0]
        jacobian = white @ np.concatenate([by_here, back, -by_own[:, :, None], -by_wheels], axis=2)
        known = change + by_wheels @ self.constants[:2] + by_own * self.own[:m, None]
        residual = white @ (moved - known)[:, :, None]
        columns = np.empty((m, 3, 9), dtype=np.intp)
        columns[:, :, :6] = (3 * np.arange(m)[:, None] + np.arange(6))[:, None, :]
        columns[:, :, 6] = (3 * len(self.poses) + np.arange(m))[:, None]
        columns[:, :, 7:] = size - 3, size - 2
        return _Rows(columns.reshape(-1, 9), jacobian.reshape(-1, 9), residual.ravel())

    def _stacked_motions(self) -> tuple[Array, ...]:
        if len(self._stacked) != 4 or len(self._stacked[0]) != len(self._motions):
            self._stacked = tuple(np.stack(parts) for parts in zip(*self._motions, strict=True))
        return self._stacked

    def _sighted(self, stack: _Stack, lines: Array, size: int, robust: Robust) -> tuple[_Rows, _Rows]:
        x, y, heading = self.poses[stack.scan].T
        angle, distance = lines[stack.line].T
        normal = heading + stack.bearing + stack.sweep * (self.constants[0] + self.own[stack.scan])
        side = np.where(np.cos(normal - angle) >= 0.0, 1.0, -1.0)  # a thin wall may be seen from behind
        c, s = np.cos(angle), np.sin(angle)
        turn = wrap_angle(normal - angle + np.where(side < 0.0, math.pi, 0.0)) * stack.sure
        sigma, depth = self._config.range_m, stack.range * (1.0 + self.constants[2])
        gap = (side * (distance - x * c - y * s) - depth) / sigma
        weight = np.sqrt(robust(turn**2 + gap**2))
        u, v = weight * stack.sure, side * weight / sigma
        n = len(stack.scan)
        pose, line = 3 * stack.scan, 4 * len(self.poses) + 2 * stack.line
        own, turn_error, scale = 3 * len(self.poses) + stack.scan, np.full(n, size - 3), np.full(n, size - 1)
        turned, longer = u * stack.sweep, -weight * stack.range / sigma
        return (
            _Rows(
                np.column_stack([pose + 2, line, own, turn_error]),
                np.column_stack([u, -u, turned, turned]),
                weight * turn,
            ),
            _Rows(
                np.column_stack([pose, pose + 1, line, line + 1, scale]),
                np.column_stack([-v * c, -v * s, v * (x * s - y * c), v, longer]),
                weight * gap,
            ),
        )


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of the Jacobian that have equally many entries, and their residuals."""

    columns: NDArray[np.intp]
    """Shape (rows, entries)."""
    values: Array
    """Shape (rows, entries)."""
    residual: Array
    """Shape (rows,)."""


@dataclass(frozen=True, eq=False)
class _Stack:
    """All sightings as arrays, shape (n,) each."""

    scan: np.ndarray
    line: np.ndarray
    bearing: Array
    sweep: Array
    range: Array
    sure: Array
    """One over the standard deviation of the bearing, [1/rad]."""

    @staticmethod
    def of(sightings: list[Sighting], column: dict[int, int], config: SmoothingConfig) -> _Stack:
        lines = {chain: k for k, chain in enumerate(sorted(column))}
        return _Stack(
            scan=np.array([s.scan for s in sightings], dtype=np.intp),
            line=np.array([lines[s.chain] for s in sightings], dtype=np.intp),
            bearing=np.array([s.bearing_rad for s in sightings], dtype=float),
            sweep=np.array([s.sweep_rad for s in sightings], dtype=float),
            range=np.array([s.range_m for s in sightings], dtype=float),
            sure=1.0
            / np.sqrt(
                config.bearing_rad**2 / np.array([s.discs for s in sightings], dtype=float)
                + config.bearing_least_rad**2
            ),
        )


def _huber(squared: Array) -> Array:
    """Weight of a squared residual."""
    return np.asarray(1.0 / np.maximum(1.0, np.sqrt(squared) / HUBER))


def _cauchy(squared: Array) -> Array:
    """Weight of a squared residual: what is far off hardly counts."""
    return np.asarray(1.0 / (1.0 + squared / CAUCHY**2))
