"""Segments of wall features: which are no walls, where they end, and what joins them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel, lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import Mask


def pivot_points(walls: Array, scan: NDArray[np.int64], within_m: float, turn_rad: float) -> Mask:
    """Which wall features are no walls: another scan met the same foot under another normal; shape (n,).

    A plane answers each scan position from another foot under one normal; an edge, a corner or a thin column
    answers all of them from one place, under normals that turn about it. The body keeps the feet of two true
    walls that meet farther apart than `within_m`.

    Args:
        walls: segments of the features, shape (n, 4), map frame, [m].
        scan: which scan each is of, shape (n,).
        within_m: feet this close are one place, [m].
        turn_rad: normals that differ by this much are two, [rad].
    """
    out = np.zeros(len(walls), dtype=bool)
    if len(walls) < 2:
        return out
    feet = 0.5 * (walls[:, :2] + walls[:, 2:])
    tangent = np.arctan2(walls[:, 3] - walls[:, 1], walls[:, 2] - walls[:, 0])
    _mark_pivots(np.argsort(feet[:, 0]), feet, tangent, scan, within_m, turn_rad, out)
    return out


@lean_kernel
def _mark_pivots(order, feet, tangent, scan, within, turn, out):  # type: ignore[no-untyped-def]
    """`order`: of the feet, by their x."""
    for n in range(len(order)):
        for m in range(n + 1, len(order)):
            i, j = min(order[n], order[m]), max(order[n], order[m])
            dx, dy = feet[order[m], 0] - feet[order[n], 0], feet[j, 1] - feet[i, 1]
            if dx > within:
                break
            if dx * dx + dy * dy <= within * within and scan[i] != scan[j]:
                turned = math.pi - (math.pi - (tangent[i] - tangent[j])) % (2.0 * math.pi)
                if abs(turned) >= turn:
                    out[i], out[j] = True, True


def trimmed(walls: Array, points: Array, within_m: float) -> Array:
    """Wall segments, shape (n, 4), cut at the edges and corners that lie on them, [m].

    Only the foot of a normal is sure to be wall. The rest of its segment ends where an edge was heard: at a jamb. Where
    the foot itself is at the jamb the wall goes on to one side, and this scan does not tell to which: it is believed no
    farther than `within_m` to either.
    """
    if not len(walls) or not len(points):
        return walls
    out = np.empty_like(walls)
    points = points.take(np.argsort(points[:, 0]), axis=0)
    first = np.searchsorted(points[:, 0], np.minimum(walls[:, 0], walls[:, 2]) - 2.0 * within_m)
    last = np.searchsorted(points[:, 0], np.maximum(walls[:, 0], walls[:, 2]) + 2.0 * within_m)
    _trim(walls, points, first, last, within_m, out)
    return out


@kernel
def _trim(walls, points, first, last, within, out):  # type: ignore[no-untyped-def]
    """`points` by their x; none but those from the first to the last can lie on a wall."""
    for i in range(len(walls)):
        x, y = 0.5 * (walls[i, 0] + walls[i, 2]), 0.5 * (walls[i, 1] + walls[i, 3])
        dx, dy = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
        half = 0.5 * math.hypot(dx, dy)
        ux, uy = dx / max(2.0 * half, 1e-9), dy / max(2.0 * half, 1e-9)
        forward = backward = half
        for k in range(first[i], last[i]):
            px, py = points[k, 0] - x, points[k, 1] - y
            if abs(px * uy - py * ux) <= within:
                at = px * ux + py * uy
                if at > within:
                    forward = min(forward, at)
                elif at < -within:
                    backward = min(backward, -at)
                else:
                    forward, backward = min(forward, within), min(backward, within)
        out[i, 0], out[i, 1] = x - ux * backward, y - uy * backward
        out[i, 2], out[i, 3] = x + ux * forward, y + uy * forward


def shortened(walls: Array, half_m: float) -> Array:
    """Wall segments, shape (n, 4), cut to this much on either side of their middle, [m]."""
    middle, half = 0.5 * (walls[:, :2] + walls[:, 2:]), 0.5 * (walls[:, 2:] - walls[:, :2])
    half = half * np.minimum(1.0, half_m / np.maximum(np.hypot(*half.T), 1e-9))[:, None]
    return np.hstack([middle - half, middle + half])


def bridges(walls: Array, gap_m: float) -> Array:
    """Segments across gaps between wall ends that the body cannot pass, shape (k, 4), [m]."""
    if len(walls) < 2:
        return np.zeros((0, 4))
    ends = np.vstack([walls[:, :2], walls[:, 2:]])
    return np.asarray(_bridges(np.argsort(ends[:, 0]), ends, gap_m))


@kernel
def _bridges(order, ends, gap):  # type: ignore[no-untyped-def]
    """`ends`: the first ends of all walls, then the second ones; `order`: of them, by their x."""
    walls = len(ends) // 2
    found, count = np.empty((len(ends), 4)), 0
    for n in range(len(order)):
        i = order[n]
        for m in range(n + 1, len(order)):
            j = order[m]
            dx, dy = ends[j, 0] - ends[i, 0], ends[j, 1] - ends[i, 1]
            if dx > gap:
                break
            if dx * dx + dy * dy > gap * gap or i % walls == j % walls:
                continue
            if count == len(found):
                more = np.empty((2 * count, 4))
                for k in range(count):
                    for column in range(4):
                        more[k, column] = found[k, column]
                found = more
            first, last = min(i, j), max(i, j)
            found[count, 0], found[count, 1] = ends[first, 0], ends[first, 1]
            found[count, 2], found[count, 3] = ends[last, 0], ends[last, 1]
            count += 1
    return found[:count]
