"""Whether the points heard of late are points that were heard long ago, farther off than a scan alone could tell.

After a long way round, the robot is lost by more than the spaces between points, and a scan hears few of them. But what
it heard over the last score of scans is a map of its own, good to centimetres. That map is moved as one piece, by no
more than the uncertainty of the way allows, to where two of its points fall on two old ones. The move under which most
fall on old ones is taken, if many do and no other move comes near it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel, lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.slam.smoothing.known_points import FIRST, KIND, LAST
from sonar_explore.slam.smoothing.relative import pose_covariance
from sonar_explore.slam.smoothing.smoothing import Smoother

SOLUTIONS = 12  # until a closed loop is given up: over a gap of metres the first ones are far from the best
STANDS = 0.1  # a solution that changes the misfit by less is the last, in squared standard deviations


@dataclass(frozen=True)
class LoopConfig:
    """What closes a loop."""

    recent: int = 20
    """The scans of late: points that none but these heard may be old ones."""
    least: int = 5
    """So many points must fall on old ones."""
    ahead: int = 2
    """And so many more than under any other move."""
    strain: float = 5.0
    """All that was heard may fit worse by so much for each of these points, in squared standard deviations; else they
    are parted again. Bearing and range of five true ones cost 10 together, and more than 25 with a chance of 0.5 %."""
    together_m: float = 0.08
    """What falls on an old point is no farther from it, [m]."""
    apart_m: float = 0.06
    """Two points and the two that they are have distances that differ by no more, [m]."""
    baseline_m: float = 0.5
    """Two points nearer to one another tell no turn, [m]."""
    reach_m: float = 6.0
    """No loop is closed over a larger gap, [m]."""
    gate: float = 16.0
    """Nor over one whose squared Mahalanobis distance, by the way between, is larger: 99.9 % of three dimensions."""
    other_m: float = 0.4
    """A move that puts the robot at least this far off, [m], is another one,"""
    other_rad: float = math.radians(6.0)
    """or that turns it by this much more or less."""


def visits(
    places: Array, last: NDArray[np.intp], recent: NDArray[np.intp], now: int, config: LoopConfig
) -> list[NDArray[np.intp]]:
    """Rows of the old points in reach, those heard about the same time together.

    Args:
        places: of all points, shape (n, 2), [m].
        last: scan that heard each last, shape (n,).
        recent: rows of the points that were first heard of late.
        now: the last scan.
    """
    if len(recent) < config.least:
        return []
    low, high = places[recent].min(axis=0) - config.reach_m, places[recent].max(axis=0) + config.reach_m
    in_reach = ((places >= low) & (places <= high)).all(axis=1)
    old = np.flatnonzero((last <= now - config.recent) & in_reach)
    old = old[np.argsort(last[old], kind="stable")]
    together = np.split(old, np.flatnonzero(np.diff(last[old]) > config.recent) + 1)
    return [rows for rows in together if len(rows) >= config.least]


def may_close(smoother: Smoother, numbers: NDArray[np.int64], places: Array, config: LoopConfig) -> bool:
    """Whether any visit has so many points near what was heard of late that `closed` would look for a move.

    Mostly none has, and this is sooner said than found out step by step.

    Args:
        numbers: of all points of the smoother's, rising, and their `places`.
    """
    counts, gates = (config.recent, config.least), (config.reach_m, config.together_m**2, config.gate)
    rows = smoother.known_points.rows
    return bool(len(numbers) and _may_close(numbers, places, rows, *smoother.solved, counts, gates))


def closed(
    recent: Array, old: Array, alike: NDArray[np.bool_], about: Array, prior: Array, config: LoopConfig
) -> list[tuple[int, int]]:
    """Which of the recent points is which of the old ones: (row of recent, row of old); none where no loop closes.

    Args:
        recent: places of what was heard of late, shape (n, 2), map frame, [m].
        old: places of what was heard long ago, shape (m, 2), map frame, [m].
        alike: which may be the same at all, shape (n, m).
        about: where the robot is now, shape (2,), [m].
        prior: covariance of its x, y [m] and heading [rad] relative to the old points, map frame, shape (3, 3).
    """
    recent, old, near = recent - about, old - about, alike.copy()
    _gate(recent, old, prior, config.together_m**2, config.gate, config.reach_m, near)
    if not _several(near, config.least):
        return []
    rows, columns = np.nonzero(near)
    information = np.linalg.inv(prior + np.diag([1e-4, 1e-4, 1e-5]))
    limits = np.array(
        [config.together_m, config.apart_m, config.baseline_m, config.gate, config.other_m, config.other_rad]
    )
    pairs = np.empty(len(recent), dtype=np.int64)
    most, second = _best(recent, old, rows, columns, information, limits, pairs)
    if most < config.least or most - second < config.ahead:
        return []
    return [(i, j) for i, j in enumerate(pairs.tolist()) if j >= 0]


def settles(smoother: Smoother, worst: float) -> bool:
    """Whether, solved as often as it takes, what was heard has a misfit no worse than this.

    A long way without walls is bent by metres and turned by tens of degrees when its end is tied to its beginning: one
    solution does not get there, and its misfit says nothing of whether the loop is one.
    """
    before = math.inf
    for _ in range(SOLUTIONS):
        smoother.solve()
        misfit = smoother.misfit()
        if misfit <= worst:
            return True
        if abs(before - misfit) < STANDS:
            return False
        before = misfit
    return False


@kernel
def _may_close(  # type: ignore[no-untyped-def]
    numbers, places, rows, scans, last, values, rank, parent, dims, layout, struct, factor, counts, gates
):
    """`may_close` by what `KnownPoints` has and by `Smoother.solved`.

    Args:
        counts: scans of late, least points.
        gates: reach [m], variance of what falls together [m2], gate.
    """
    late, least, now = counts[0], counts[1], len(scans) - 1
    recent, old = np.empty((len(numbers), 2)), np.empty((len(numbers), 2))
    which, kinds = np.empty(len(numbers), dtype=np.int64), np.empty(len(numbers), dtype=np.int64)
    x, y = values[scans[now], 0], values[scans[now], 1]
    n, x0, y0, x1, y1 = 0, np.inf, np.inf, -np.inf, -np.inf
    for k in range(len(numbers)):
        if rows[numbers[k], FIRST] > now - late:
            recent[n, 0], recent[n, 1], kinds[n] = places[k, 0] - x, places[k, 1] - y, rows[numbers[k], KIND]
            x0, y0, x1, y1 = (
                min(x0, places[k, 0]),
                min(y0, places[k, 1]),
                max(x1, places[k, 0]),
                max(y1, places[k, 1]),
            )
            n += 1
    if n < least:
        return False
    x0, y0, x1, y1 = x0 - gates[0], y0 - gates[0], x1 + gates[0], y1 + gates[0]
    m = _long_ago(numbers, places, rows, now - late, (x0, y0, x1, y1), which)
    begin, prior = 0, np.empty((1, 3, 3))
    for end in range(1, m + 1):
        if end < m and rows[numbers[which[end]], LAST] - rows[numbers[which[end - 1]], LAST] <= late:
            continue
        size = end - begin
        if size >= least:
            middle = rows[numbers[which[begin + (size - 1) // 2]], LAST]
            middle += rows[numbers[which[begin + size // 2]], LAST]
            prior[:] = 0.0
            if last >= 0:
                pose_covariance(
                    scans[middle // 2], last, values, rank, parent, dims, layout, struct, factor, prior
                )
            near = np.empty((n, size), dtype=np.bool_)
            for j in range(size):
                k = which[begin + j]
                old[j, 0], old[j, 1] = places[k, 0] - x, places[k, 1] - y
                for i in range(n):
                    near[i, j] = kinds[i] == rows[numbers[k], KIND]
            _gate(recent[:n], old[:size], prior[0], gates[1], gates[2], gates[0], near)
            if _several(near, least):
                return True
        begin = end
    return False


@inner_kernel
def _long_ago(numbers, places, rows, before, box, which):  # type: ignore[no-untyped-def]
    """Which points in a box none heard after this scan, into `which`, in the order of who heard them last: how many."""
    m = 0
    for k in range(len(numbers)):
        heard = rows[numbers[k], LAST]
        inside = box[0] <= places[k, 0] <= box[2] and box[1] <= places[k, 1] <= box[3]
        if heard > before or not inside:
            continue
        at = m
        while at > 0 and rows[numbers[which[at - 1]], LAST] > heard:
            which[at] = which[at - 1]
            at -= 1
        which[at] = k
        m += 1
    return m


@lean_kernel
def _several(near, least):  # type: ignore[no-untyped-def]
    """Whether so many rows, and so many columns, have anything."""
    rows = columns = 0
    for i in range(near.shape[0]):
        for j in range(near.shape[1]):
            if near[i, j]:
                rows += 1
                break
    for j in range(near.shape[1]):
        for i in range(near.shape[0]):
            if near[i, j]:
                columns += 1
                break
    return min(rows, columns) >= least


@lean_kernel
def _gate(recent, old, prior, variance, gate, reach, near):  # type: ignore[no-untyped-def]
    """Which pairs stay `near`: those no farther apart than a move and a turn about the origin may have put them."""
    for i in range(len(recent)):
        x, y = recent[i, 0], recent[i, 1]
        along = prior[0, 0] - 2.0 * y * prior[0, 2] + y * y * prior[2, 2] + variance
        across = prior[1, 1] + 2.0 * x * prior[1, 2] + x * x * prior[2, 2] + variance
        both = prior[0, 1] + x * prior[0, 2] - y * prior[1, 2] - x * y * prior[2, 2]
        determinant = along * across - both * both
        for j in range(len(old)):
            dx, dy = old[j, 0] - x, old[j, 1] - y
            squared = (dx * dx * across - 2.0 * dx * dy * both + dy * dy * along) / determinant
            near[i, j] = near[i, j] and squared <= gate and dx * dx + dy * dy <= reach * reach


@kernel
def _best(recent, old, rows, columns, information, limits, pairs):  # type: ignore[no-untyped-def]
    """The old point of each recent one under the best move into `pairs`, -1 for none; how many there are, and how many
    under the best of the other moves."""
    found, size = np.empty((len(rows) * (len(rows) - 1) // 2, 5)), 0
    here = np.empty(len(recent), dtype=np.int64)
    taken, gap = np.empty(len(old), dtype=np.int64), np.empty(len(recent))
    best, best_score = 0, -np.inf
    pairs[:] = -1
    for a in range(len(rows)):
        for b in range(a):
            i, k, j, m = rows[a], rows[b], columns[a], columns[b]
            if i == k or j == m:
                continue
            bx, by = recent[k, 0] - recent[i, 0], recent[k, 1] - recent[i, 1]
            ax, ay = old[m, 0] - old[j, 0], old[m, 1] - old[j, 1]
            long = math.hypot(bx, by)
            if long < limits[2] or abs(long - math.hypot(ax, ay)) > limits[1]:
                continue
            turn = math.atan2(bx * ay - by * ax, bx * ax + by * ay)
            c, s = math.cos(turn), math.sin(turn)
            mx, my = 0.5 * (recent[i, 0] + recent[k, 0]), 0.5 * (recent[i, 1] + recent[k, 1])
            x = 0.5 * (old[j, 0] + old[m, 0]) - c * mx + s * my
            y = 0.5 * (old[j, 1] + old[m, 1]) - s * mx - c * my
            price = x * x * information[0, 0] + y * y * information[1, 1] + turn * turn * information[2, 2]
            price += 2.0 * (
                x * y * information[0, 1] + x * turn * information[0, 2] + y * turn * information[1, 2]
            )
            if price > limits[3]:
                continue
            count, misfit = _fallen(recent, old, rows, columns, c, s, x, y, limits[0], here, taken, gap)
            score = count - misfit - 0.05 * price
            found[size, 0], found[size, 1], found[size, 2] = x, y, turn
            found[size, 3], found[size, 4] = count, score
            size += 1
            if score > best_score:
                best, best_score = size - 1, score
                pairs[:] = here
    if size == 0:
        return 0, 0
    second = 0.0
    for k in range(size):
        apart = math.hypot(found[k, 0] - found[best, 0], found[k, 1] - found[best, 1])
        if (apart > limits[4] or abs(found[k, 2] - found[best, 2]) > limits[5]) and found[k, 3] > second:
            second = found[k, 3]
    return int(found[best, 3]), int(second)


@kernel
def _fallen(recent, old, rows, columns, c, s, x, y, together, here, taken, gap):  # type: ignore[no-untyped-def]
    """How many recent points fall on an old one each, and the sum of what they miss it by, squared, of the most."""
    here[:], taken[:], gap[:] = -1, -1, np.inf
    for a in range(len(rows)):
        i, j = rows[a], columns[a]
        dx = c * recent[i, 0] - s * recent[i, 1] + x - old[j, 0]
        dy = s * recent[i, 0] + c * recent[i, 1] + y - old[j, 1]
        off = math.hypot(dx, dy)
        if off > together or off >= gap[i]:
            continue
        other = taken[j]
        if other >= 0 and other != i:
            if gap[other] <= off:
                continue
            here[other], gap[other] = -1, np.inf
        if here[i] >= 0:
            taken[here[i]] = -1
        here[i], gap[i], taken[j] = j, off, i
    count, misfit = 0, 0.0
    for i in range(len(recent)):
        if here[i] >= 0:
            count, misfit = count + 1, misfit + (gap[i] / together) ** 2
    return count, misfit
