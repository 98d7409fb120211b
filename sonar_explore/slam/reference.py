"""The line of a chain that corrections refer to: its root (the paper), or one estimated from all its links (beyond it).

A root keeps the bearing error of the one scan that saw it. Ranges are good to millimetres, bearings to a degree or
two: the feet of the normals seen from several positions fix a wall's direction better than any one RCD does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import lapack

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array, Segment, wrap_undirected
from sonar_explore.slam.chains import Chain
from sonar_explore.sums import fma

ROUNDS = 3
"""Of reweighting: feet far off the line count less each time."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class ReferenceConfig:
    """Root or refined line, and how far a link's foot and direction may be off."""

    refined: bool = False
    """The paper corrects to the root."""
    foot_sigma_m: float = 0.02
    """Standard deviation of a foot across the wall, by range and position, [m]."""
    direction_sigma_rad: float = math.radians(2.0)
    """Standard deviation of the direction of a link that one disc heard, [rad]."""
    direction_least_rad: float = math.radians(0.8)
    """The same, however many discs heard it: that of the pose, [rad]."""


def reference_line(chain: Chain, config: ReferenceConfig) -> Segment:
    """The segment to whose line ADR and NDR are taken."""
    root = chain.root.segment
    if not config.refined or len(chain.links) < 2:
        return root
    x, y, direction = chain.root.foot
    c, s = math.cos(direction), math.sin(direction)
    offset, slope = _fit(
        chain.feet, (x, y, c, s), np.tan(wrap_undirected(chain.feet[:, 2] - direction)), config
    )
    half, angle = 0.5 * root.length, direction + math.atan(slope)
    mx, my = x - s * offset, y + c * offset
    dx, dy = half * math.cos(angle), half * math.sin(angle)
    return Segment(mx - dx, my - dy, mx + dx, my + dy)


def _fit(
    feet: Array, axis: tuple[float, float, float, float], slopes: Array, config: ReferenceConfig
) -> tuple[float, float]:
    """Offset [m] and slope of the line across = offset + slope along, with the directions as slopes too.

    Args:
        feet: of the links, shape (n, 4): see `Chain.feet`.
        axis: the middle of the root, x y [m], and the cosine and sine of its direction.
        slopes: of the links along it, shape (n,).
    """
    n = len(feet)
    rows, values, weights = np.empty((2 * n, 2)), np.empty(2 * n), np.ones(2 * n)
    sigmas = config.foot_sigma_m, config.direction_sigma_rad**2, config.direction_least_rad**2
    _equations(feet, slopes, *axis, *sigmas, rows, values)
    solution = _least_squares(rows, values)
    for _ in range(1, ROUNDS):
        if not _reweighted(rows, values, solution, weights):
            break  # the same once more
        solution = _least_squares(rows * weights[:, None], values * weights)
    offset, slope = solution.tolist()
    return offset, slope


def _least_squares(rows: Array, values: Array) -> Array:
    """`np.linalg.lstsq` for two unknowns: the same routine, without what surrounds it."""
    work, size = _workspace(len(rows))
    found: Array = lapack.dgelsd(rows, values, work, size, EPS * len(rows))[0]
    return found[:2]


@cache
def _workspace(m: int) -> tuple[int, int]:
    """That LAPACK wants for m rows of two unknowns: numbers, and whole numbers."""
    work, size, _ = lapack.dgelsd_lwork(m, 2, 1)
    return int(work), int(size)


@lean_kernel
def _equations(feet, slopes, x, y, c, s, foot_m, direction2, least2, rows, values):  # type: ignore[no-untyped-def]
    """Rows and values of the least squares, each over its standard deviation: the feet, then the directions."""
    n = len(feet)
    foot = 1.0 / foot_m
    for i in range(n):
        dx, dy = feet[i, 0] - x, feet[i, 1] - y
        rows[i, 0], rows[i, 1] = foot, foot * fma(dx, c, dy * s)
        values[i] = foot * fma(dx, -s, dy * c)
        direction = 1.0 / math.sqrt(direction2 / feet[i, 3] + least2)
        rows[n + i, 0], rows[n + i, 1] = 0.0, direction
        values[n + i] = direction * slopes[i]


@lean_kernel
def _reweighted(rows, values, solution, weights):  # type: ignore[no-untyped-def]
    """Huber's weights of what is left over: whether any changed."""
    changed = False
    for i in range(len(values)):
        off = abs(values[i] - fma(rows[i, 0], solution[0], rows[i, 1] * solution[1]))
        weight = math.sqrt(1.0 / max(1.0, off / 1.5))
        changed = changed or weight != weights[i]
        weights[i] = weight
    return changed
