"""The rows of the smoother's Jacobian: each kind of measurement, linearised at the unknowns as they are now."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, wrap_angle

Robust = Callable[[Array], Array]
"""Weights of squared residuals, in sigmas."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What is solved for; in the vector of unknowns in this order, all poses first."""

    poses: Array
    """x, y [m], heading [rad] of every scan, shape (n, 3)."""
    own: Array
    """What each scan's own turn has of error beyond that of all turns, relative, shape (n,)."""
    lines: Array
    """Bearing of the normal [rad] and distance from the origin [m] of every chain, shape (k, 2)."""
    points: Array
    """x, y of every point, of the middle of a column, shape (m, 2), [m]."""
    radii: Array
    """Of every column, shape (c,), [m]."""
    constants: Array
    """Turn error, bend [rad/m] and scale of the ranges (true over measured, less one), shape (3,)."""

    @property
    def size(self) -> int:
        """How many numbers they are."""
        return int(self.sizes.sum())

    @property
    def sizes(self) -> NDArray[np.intp]:
        """How many there are of each of the above, shape (6,)."""
        parts = self.poses, self.own, self.lines, self.points, self.radii, self.constants
        return np.array([part.size for part in parts])

    @property
    def first_line(self) -> int:
        """Column of the first line; each has two."""
        return 4 * len(self.poses)

    @property
    def first_point(self) -> int:
        """Column of the first point; each has two."""
        return self.first_line + 2 * len(self.lines)

    @property
    def first_radius(self) -> int:
        """Column of the first radius."""
        return self.first_point + 2 * len(self.points)

    def turn_errors(self, scan: NDArray[np.intp]) -> Array:
        """All that the turns of these scans have of error, relative, shape (n,)."""
        return np.asarray(self.constants[0] + self.own[scan])

    def moved(self, step: Array) -> Unknowns:
        """After a step, shape (size,)."""
        n = len(self.poses)
        return Unknowns(
            self.poses + step[: 3 * n].reshape(n, 3),
            self.own + step[3 * n : 4 * n],
            self.lines + step[self.first_line : self.first_point].reshape(-1, 2),
            self.points + step[self.first_point : self.first_radius].reshape(-1, 2),
            self.radii + step[self.first_radius : -3],
            self.constants + step[-3:],
        )


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of the Jacobian that have equally many entries, and their residuals."""

    columns: NDArray[np.intp]
    """Shape (rows, entries)."""
    values: Array
    """Shape (rows, entries)."""
    residual: Array
    """Shape (rows,)."""


@dataclass(frozen=True, eq=False)
class Heard:
    """Lines or points as scans heard them, as the odometry has it; every array has shape (n,)."""

    scan: NDArray[np.intp]
    what: NDArray[np.intp]
    """Which of the lines, or of the points."""
    bearing: Array
    """Of the normal or of the point, robot frame at the start of the scan, [rad]."""
    sweep: Array
    """How far the robot had turned when it heard it, signed, [rad]."""
    range: Array
    """[m]"""
    sure: Array
    """One over the standard deviation of the bearing, [1/rad]."""


def anchor(at: Unknowns, start: Array, constant_sigmas: Array) -> Rows:
    """The first scan stands at the start, x y heading; wheels and temperature are about right."""
    weight = np.concatenate([np.full(3, 1e4), 1.0 / constant_sigmas])
    columns = np.array([0, 1, 2, at.size - 3, at.size - 2, at.size - 1])
    off = np.concatenate([at.poses[0] - start, at.constants])
    return Rows(columns[:, None], weight[:, None], weight * off)


def own_turns(
    at: Unknowns, sigma: float, scans: NDArray[np.intp], heard: Array, heard_sigma: Array
) -> tuple[Rows, Rows]:
    """Every scan's turn is about as the wheels turn, and some about as their discs heard."""
    n, weight = len(at.poses), 1.0 / heard_sigma
    columns = np.column_stack([3 * n + scans, np.full(len(scans), at.size - 3)])
    return (
        Rows(3 * n + np.arange(n)[:, None], np.full((n, 1), 1.0 / sigma), at.own / sigma),
        Rows(columns, np.column_stack([weight, weight]), weight * (at.turn_errors(scans) - heard)),
    )


def odometry(at: Unknowns, white: Array, change: Array, by_wheels: Array, by_own: Array) -> Rows:
    """From each scan to the next, as `motion.Motion` has it; `white` whitens its covariance."""
    m = len(white)
    here, there = at.poses[:m], at.poses[1 : m + 1]
    c, s = np.cos(here[:, 2]), np.sin(here[:, 2])
    back = np.zeros((m, 3, 3))
    back[:, 0, 0], back[:, 0, 1], back[:, 1, 0], back[:, 1, 1], back[:, 2, 2] = c, s, -s, c, 1.0
    moved = (back @ (there - here)[:, :, None])[:, :, 0]
    by_here = -back
    by_here[:, 0, 2], by_here[:, 1, 2] = moved[:, 1], -moved[:, 0]
    jacobian = white @ np.concatenate([by_here, back, -by_own[:, :, None], -by_wheels], axis=2)
    known = change + by_wheels @ at.constants[:2] + by_own * at.own[:m, None]
    residual = white @ (moved - known)[:, :, None]
    columns = np.empty((m, 3, 9), dtype=np.intp)
    columns[:, :, :6] = (3 * np.arange(m)[:, None] + np.arange(6))[:, None, :]
    columns[:, :, 6] = (3 * len(at.poses) + np.arange(m))[:, None]
    columns[:, :, 7:] = at.size - 3, at.size - 2
    return Rows(columns.reshape(-1, 9), jacobian.reshape(-1, 9), residual.ravel())


def lines_heard(at: Unknowns, heard: Heard, range_m: float, robust: Robust) -> tuple[Rows, Rows]:
    """Bearing and range of features to the lines of their chains."""
    x, y, heading = at.poses[heard.scan].T
    angle, distance = at.lines[heard.what].T
    normal = heading + heard.bearing + heard.sweep * at.turn_errors(heard.scan)
    side = np.where(np.cos(normal - angle) >= 0.0, 1.0, -1.0)  # a thin wall may be seen from behind
    c, s = np.cos(angle), np.sin(angle)
    turn = wrap_angle(normal - angle + np.where(side < 0.0, math.pi, 0.0)) * heard.sure
    gap = (side * (distance - x * c - y * s) - heard.range * (1.0 + at.constants[2])) / range_m
    weight = np.sqrt(robust(turn**2 + gap**2))
    u, v = weight * heard.sure, side * weight / range_m
    pose, line = 3 * heard.scan, at.first_line + 2 * heard.what
    own, turn_error, scale = _of_turn_and_scale(at, heard)
    turned, longer = u * heard.sweep, -weight * heard.range / range_m
    return (
        Rows(
            np.column_stack([pose + 2, line, own, turn_error]),
            np.column_stack([u, -u, turned, turned]),
            weight * turn,
        ),
        Rows(
            np.column_stack([pose, pose + 1, line, line + 1, scale]),
            np.column_stack([-v * c, -v * s, v * (x * s - y * c), v, longer]),
            weight * gap,
        ),
    )


def points_heard(
    at: Unknowns, heard: Heard, radius: NDArray[np.intp], range_m: float, robust: Robust
) -> tuple[Rows, ...]:
    """Bearing and range of points to their places.

    Args:
        radius: which of the radii the point that was heard has, -1 for a thin one, shape (n,).
    """
    dx, dy = (at.points[heard.what] - at.poses[heard.scan, :2]).T
    away, round_ = np.hypot(dx, dy), radius >= 0
    c, s = dx / away, dy / away
    bearing = at.poses[heard.scan, 2] + heard.bearing + heard.sweep * at.turn_errors(heard.scan)
    turn = wrap_angle(bearing - np.arctan2(dy, dx)) * heard.sure
    thick = np.where(round_, np.append(at.radii, 0.0)[radius], 0.0)
    gap = (away - thick - heard.range * (1.0 + at.constants[2])) / range_m
    weight = np.sqrt(robust(turn**2 + gap**2))
    u, v = weight * heard.sure, weight / range_m
    pose, point = 3 * heard.scan, at.first_point + 2 * heard.what
    own, turn_error, scale = _of_turn_and_scale(at, heard)
    turned, across = u * heard.sweep, (u * s / away, u * c / away)
    by_range = (
        np.column_stack([pose, pose + 1, point, point + 1, scale]),
        np.column_stack([-v * c, -v * s, v * c, v * s, -v * heard.range]),
        weight * gap,
    )
    columns, values, residual = (part[round_] for part in by_range)
    return (
        Rows(
            np.column_stack([pose, pose + 1, pose + 2, point, point + 1, own, turn_error]),
            np.column_stack([-across[0], across[1], u, across[0], -across[1], turned, turned]),
            weight * turn,
        ),
        Rows(*(part[~round_] for part in by_range)),
        Rows(
            np.column_stack([columns, at.first_radius + radius[round_]]),
            np.column_stack([values, -v[round_]]),
            residual,
        ),
    )


def radii_told(at: Unknowns, told: Array, sigma: Array) -> Rows:
    """Every column is about as thick as its widths tell, shape (c,) both, [m]."""
    columns = at.first_radius + np.arange(len(told))[:, None]
    return Rows(columns, 1.0 / sigma[:, None], (at.radii - told) / sigma)


def _of_turn_and_scale(at: Unknowns, heard: Heard) -> tuple[NDArray[np.intp], ...]:
    """Columns of each scan's own turn, of the error of all turns and of the scale, shape (n,) each."""
    n = len(heard.scan)
    return 3 * len(at.poses) + heard.scan, np.full(n, at.size - 3), np.full(n, at.size - 1)
