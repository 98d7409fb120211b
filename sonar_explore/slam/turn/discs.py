"""What the discs of the turning robot agree on: which echoes are of one thing, and how wrong the turn was."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from sonar_explore.compiled import inner_allocating_kernel, inner_kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.sums import dot, total

PULL, WEIGHT = range(2)
"""Of the turn's error, as what several discs heard adds to them."""


@dataclass(frozen=True)
class TurnError:
    """By how much more the robot truly turned than its odometry says, as what its discs heard tells it."""

    relative: float
    """True turn over counted turn, less one."""
    sigma: float
    """Its standard deviation, relative as well."""

    @classmethod
    def of(cls, sums: Array, noise_rad: float) -> TurnError | None:
        """Least squares over what several discs heard: each has one bearing, less the error times the turn by then.

        Args:
            sums: what `adds_to_turn` added up, shape (2,).
            noise_rad: standard deviation of one disc's bearing, [rad].
        """
        pull, weight = sums.tolist()
        return cls(-pull / weight, noise_rad / math.sqrt(weight)) if weight > 0.0 else None


@cache
def aside(mount: Pose) -> float:
    """How far the axis of a disc passes from the turning axis, to its left, [m]."""
    return mount.y * math.cos(mount.heading) - mount.x * math.sin(mount.heading)


@inner_kernel
def adds_to_turn(sweep, bearing, sums):  # type: ignore[no-untyped-def]
    """One thing: how far the robot had turned when each disc heard it, and at what bearing; uses up `sweep`."""
    middle = total(sweep) / len(sweep)
    for i in range(len(sweep)):
        sweep[i] -= middle
    sums[PULL] += dot(sweep, bearing)
    for i in range(len(sweep)):
        sweep[i] *= sweep[i]
    sums[WEIGHT] += total(sweep)


@inner_allocating_kernel
def agreeing(distance, disc, order, least_discs, members, ends):  # type: ignore[no-untyped-def]
    """Rows of each thing that enough discs heard, one row a disc: what most discs heard first, then the closest.

    One thing after the other into `members`, where each one's rows end into `ends`; how many things. `distance` is inf
    where two rows cannot be one thing; `disc` rises; of equals the least in `order` comes first.
    """
    n = len(disc)
    discs = disc[n - 1] + 1 if n else 0
    nearest, best = np.empty(discs, dtype=np.int64), np.empty(discs, dtype=np.int64)
    count, spread, known = np.empty(n, dtype=np.int64), np.empty(n), np.zeros(n, dtype=np.bool_)
    near, many, free = (
        np.empty((n, n + 1), dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.ones(n, dtype=np.bool_),
    )
    for i in range(n):
        for j in range(n):
            near[i, many[i]] = j
            many[i] += distance[i, j] < np.inf
    things = used = 0
    while True:
        most, least, seed = 0, np.inf, -1
        for i in range(n):
            if not free[i]:
                continue
            if not known[i]:
                count[i], spread[i] = _nearest(distance[i], near[i, : many[i]], free, disc, nearest)
                known[i] = True
            closer = seed < 0 or spread[i] < least or (spread[i] == least and order[i] < order[seed])
            if count[i] > most or (count[i] == most and closer):
                most, least, seed = count[i], spread[i], i
        if seed < 0 or most < least_discs:
            return things
        _nearest(distance[seed], near[seed, : many[seed]], free, disc, best)
        for k in range(discs):
            if best[k] >= 0:
                members[used] = best[k]
                used += 1
                free[best[k]] = False
                for i in range(n):
                    known[i] = known[i] and distance[i, best[k]] == np.inf
        ends[things] = used
        things += 1


@inner_kernel
def _nearest(distance, near, free, disc, nearest):  # type: ignore[no-untyped-def]
    """The nearest free row of each disc, -1 where all are far: of how many discs, and the sum of their distances."""
    for k in range(len(nearest)):
        nearest[k] = -1
    for i in near:
        at = nearest[disc[i]]
        if free[i] and (at < 0 or distance[i] < distance[at]):
            nearest[disc[i]] = i
    count, spread = 0, 0.0
    for k in range(len(nearest)):
        if nearest[k] >= 0:
            count += 1
            spread += distance[nearest[k]]
    return count, np.rint(spread * 1e9) / 1e9
