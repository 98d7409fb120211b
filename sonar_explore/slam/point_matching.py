"""Which points of a scan are which of those known: the whole scan is moved until most of them fit.

A door has four edges, two of them a wall's thickness apart: taken one by one, the nearest may be the wrong one. Here
the scan as a whole is moved to where one or two of its points fall on known ones. Of all such places, and the one where
it is believed to be, that one is taken that explains most for the least move: truncated least squares, with the
uncertainty of the pose as prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array


@dataclass(frozen=True)
class MatchingConfig:
    """What counts as the same point met again."""

    reach_m: float = 0.5
    """How far a point may be from where it was expected, [m]."""
    sure_m: float = 0.06
    """A known point or chain whose place is less sure than this, seen from here, waits for a loop to be closed, [m]."""
    place_m: float = 0.02
    """Standard deviation of where a point is heard, [m]."""
    unmatched: float = 3.5
    """What a point costs that is none of those known, in squared standard deviations: one farther off is another."""
    apart_m: float = 0.04
    """Two points and the two that they are have distances that differ by no more, [m]."""


def matched(
    here: Array,
    about: Array,
    prior: Array,
    known: Array,
    spread: Array,
    config: MatchingConfig,
    alike: NDArray[np.bool_] | None = None,
) -> NDArray[np.intp]:
    """For each point of a scan the index of the known one that it is, -1 for a new one; shape (n,).

    Args:
        here: where the points are, by the pose believed, shape (n, 2), map frame, [m].
        about: x y of that pose, shape (2,), [m].
        prior: covariance of x, y [m] and heading [rad] of that pose, shape (3, 3).
        known: places of the known points, shape (m, 2), [m].
        spread: how unsure each of these is, seen from the scan before, variance in each direction, shape (m,), [m2].
        alike: which points may be which of the known ones at all, shape (n, m); None for any.
    """
    out = np.full(len(here), -1)
    off = known[None] - here[:, None]
    unlike = np.zeros(off.shape[:2], dtype=bool) if alike is None else ~alike
    rows, columns = np.nonzero((np.hypot(off[..., 0], off[..., 1]) <= config.reach_m) & ~unlike)
    if not len(rows):
        return out
    moves = _moves(here[rows] - about, known[columns] - about, rows, columns, config)
    information = np.linalg.inv(prior + 1e-8 * np.eye(3))
    price = np.einsum("hi,ij,hj->h", moves, information, moves)
    variance = spread + config.place_m**2
    costs = np.stack([_squared(here, about, known, variance, move) for move in moves])
    costs[:, unlike] = np.inf
    nearest = costs.min(axis=2)
    best = int(np.argmin(price + np.minimum(nearest, config.unmatched).sum(axis=1)))
    cost = costs[best]
    for i in range(len(here)):
        j = int(np.argmin(cost[i]))
        if cost[i, j] < config.unmatched and int(np.argmin(cost[:, j])) == i:
            out[i] = j
    return out


def _squared(here: Array, about: Array, known: Array, variance: Array, move: Array) -> Array:
    """Of each point of the moved scan to each known one, in squared standard deviations, shape (n, m)."""
    c, s = math.cos(move[2]), math.sin(move[2])
    moved = (here - about) @ np.array([[c, s], [-s, c]]) + about + move[:2]
    gap = known[None] - moved[:, None]
    return np.asarray((gap**2).sum(axis=2) / variance)


def _moves(
    points: Array, targets: Array, rows: NDArray[np.intp], columns: NDArray[np.intp], config: MatchingConfig
) -> Array:
    """Moves x, y [m], turn [rad] about the pose that put one point, or two, on known ones; and none; shape (h, 3)."""
    first, second = np.triu_indices(len(rows), 1)
    two = (rows[first] != rows[second]) & (columns[first] != columns[second])
    first, second = first[two], second[two]
    before, after = points[second] - points[first], targets[second] - targets[first]
    alike = np.abs(np.hypot(*before.T) - np.hypot(*after.T)) <= config.apart_m
    first, second, before, after = first[alike], second[alike], before[alike], after[alike]
    turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
    middle, aim = 0.5 * (points[first] + points[second]), 0.5 * (targets[first] + targets[second])
    c, s = np.cos(turn), np.sin(turn)
    turned = np.column_stack([c * middle[:, 0] - s * middle[:, 1], s * middle[:, 0] + c * middle[:, 1]])
    pairs = np.column_stack([aim - turned, turn])
    alone = np.column_stack([targets - points, np.zeros(len(points))])
    return np.vstack([np.zeros((1, 3)), alone, pairs])
