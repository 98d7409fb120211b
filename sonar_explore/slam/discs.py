"""What the discs of the turning robot agree on: which echoes are of one thing, and how wrong the turn was."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, Pose


@dataclass(frozen=True)
class TurnError:
    """By how much more the robot truly turned than its odometry says, as what its discs heard tells it."""

    relative: float
    """True turn over counted turn, less one."""
    sigma: float
    """Its standard deviation, relative as well."""


def turn_error(heard: Sequence[tuple[Array, Array]], noise_rad: float) -> TurnError | None:
    """Least squares over what several discs heard: each has one bearing, less the error times the turn by then.

    Args:
        heard: how far the robot had turned when each disc heard it, and at what bearing, shape (n,) both, [rad].
        noise_rad: standard deviation of one disc's bearing, [rad].
    """
    swept = [sweep - mean(sweep) for sweep, _ in heard]
    pull = sum(float(sweep @ bearing) for sweep, (_, bearing) in zip(swept, heard, strict=True))
    weight = sum(float((sweep**2).sum()) for sweep in swept)
    if weight <= 0.0:
        return None
    return TurnError(-pull / weight, noise_rad / math.sqrt(weight))


@cache
def aside(mount: Pose) -> float:
    """How far the axis of a disc passes from the turning axis, to its left, [m]."""
    return mount.y * math.cos(mount.heading) - mount.x * math.sin(mount.heading)


def agreeing(distance: Array, disc: NDArray[np.int64], order: Array, least: int) -> list[np.ndarray]:
    """Rows of each thing that enough discs heard, one row a disc: what most discs heard first, then the closest.

    Args:
        distance: between what was heard, inf where it cannot be one thing, shape (n, n); is used up.
        disc: which one heard it, rising, shape (n,).
        order: decides between equals, the least first, shape (n,).
        least: how many discs must agree.
    """
    n = len(disc)
    members, ends = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    count = _group(distance, disc, order, least, members, ends)
    return np.split(members[: ends[count - 1]], ends[: count - 1]) if count else []


@kernel
def _group(distance, disc, order, least_discs, members, ends):  # type: ignore[no-untyped-def]
    """The rows of one thing after the other into `members`, where each one's end into `ends`; how many things."""
    n = len(disc)
    discs = disc[n - 1] + 1 if n else 0
    nearest, best = np.empty(discs, dtype=np.int64), np.empty(discs, dtype=np.int64)
    things = used = 0
    while True:
        most, least, seed = 0, np.inf, -1
        for i in range(n):
            count, spread = _nearest(distance[i], disc, nearest)
            spread = np.rint(spread * 1e9) / 1e9
            closer = seed < 0 or spread < least or (spread == least and order[i] < order[seed])
            if count > most or (count == most and closer):
                most, least, seed = count, spread, i
        if seed < 0 or most < least_discs:
            return things
        _nearest(distance[seed], disc, best)
        for k in range(discs):
            if best[k] >= 0:
                members[used] = best[k]
                used += 1
                for i in range(n):
                    distance[best[k], i] = distance[i, best[k]] = np.inf
        ends[things] = used
        things += 1


@inner_kernel
def _nearest(distance, disc, nearest):  # type: ignore[no-untyped-def]
    """The nearest row of each disc, -1 where all are far: of how many discs, and the sum of their distances."""
    for k in range(len(nearest)):
        nearest[k] = -1
    for i in range(len(distance)):
        at = nearest[disc[i]]
        if distance[i] < (distance[at] if at >= 0 else np.inf):
            nearest[disc[i]] = i
    count, spread = 0, 0.0
    for k in range(len(nearest)):
        if nearest[k] >= 0:
            count += 1
            spread += distance[nearest[k]]
    return count, spread


def mean(values: Array) -> float:
    """`values.mean()`, without its overhead."""
    return float(np.add.reduce(values)) / len(values)
