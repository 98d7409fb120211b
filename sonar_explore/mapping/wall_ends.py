"""How a wall goes on beyond where it was heard: to the edge, the corner or the wall that ends it.

A scan meets a wall's normal only from in front of it, and never beside a corner, where the robot has no room. What is
left open there looks like a way out. But an opening has jambs, and jambs answer: where none did, the wall goes on.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array

_Sorted = tuple[NDArray[np.intp], Array]

ALIKE = math.sin(math.radians(15.0))  # sine of the angle between walls that may be one
ACROSS = math.sin(math.radians(30.0))  # and of those that may meet in a corner


def continued(walls: Array, points: Array, beside_m: float, reach_m: float) -> Array:
    """Pieces of wall from the ends of walls to what ends them, shape (k, 4), [m].

    A wall goes on until something ends it, and what does answers: an edge at a jamb, a corner, another wall. No scan
    meets its normal beside a corner, and a wide corner sends nothing back: two walls that head for each other meet.

    Args:
        walls: cut at the points that lie on them, shape (n, 4), map frame, [m].
        points: edges and corners, shape (k, 2), map frame, [m].
        beside_m: so far beside its line, [m], is on it.
        reach_m: a wall that nothing ends so near goes nowhere, [m].
    """
    if len(walls) < 2:
        return np.zeros((0, 4))
    middle, half = 0.5 * (walls[:, :2] + walls[:, 2:]), 0.5 * (walls[:, 2:] - walls[:, :2])
    length = np.maximum(np.hypot(*half.T), 1e-9)
    lines = np.column_stack([middle, half / length[:, None], length])
    longest_m = float(length.max())
    strip_m = 2.0 * (longest_m + reach_m) + beside_m  # walls that meet have their middles no farther apart
    (order, line_at), (points_order, point_at), long_m = _by_strips(lines, points, strip_m)
    lines, points = lines.take(order, axis=0), points.take(points_order, axis=0)
    open_m, pieces = np.zeros((len(lines), 2)), np.empty((2 * len(lines), 4))
    strips = strip_m, long_m
    _open_ends(lines, line_at, points, point_at, strips, longest_m, beside_m, reach_m, open_m)
    return pieces[: _meet(lines, line_at, strips, longest_m, beside_m, reach_m, open_m, pieces)]


def _by_strips(lines: Array, points: Array, strip_m: float) -> tuple[_Sorted, _Sorted, float]:
    """The order of rows that begin with x y by strips of y, and by x within each: and where each lies if strip follows
    strip along one line, so long each, with room between."""
    x = np.concatenate([lines[:, 0], points[:, 0]])
    least, most = float(x.min()), float(x.max())
    long_m = most - least + 2.0 * strip_m + 1.0
    found = []
    for places in (lines, points):
        at = np.floor(places[:, 1] / strip_m) * long_m + places[:, 0] - least
        order = np.argsort(at)
        found.append((order, at[order]))
    return found[0], found[1], long_m


@inner_kernel
def _first_from(at, least):  # type: ignore[no-untyped-def]
    """The first of rising numbers that is not less, by halves."""
    first, end = 0, len(at)
    while first < end:
        middle = (first + end) >> 1
        if at[middle] < least:
            first = middle + 1
        else:
            end = middle
    return first


@inner_kernel
def _covered(lines, line_at, strips, i, sign, within, beside):  # type: ignore[no-untyped-def]
    """Whether an end of a wall lies on another one, whose middle is no farther than so much from its own: the next ones
    first."""
    below, above = i - 1, i + 1
    while below >= 0 or above < len(lines):
        if below >= 0:
            if line_at[below] < line_at[i] - within:
                below = -1
            elif _lies_on(lines, i, sign, below, beside):
                return True
            below -= 1
        if above < len(lines):
            if line_at[above] > line_at[i] + within:
                above = len(lines)
            elif _lies_on(lines, i, sign, above, beside):
                return True
            above += 1
    up = lines[i, 1] - math.floor(lines[i, 1] / strips[0]) * strips[0]
    for strip in (-1, 1):
        if (strip < 0 and up > within) or (strip > 0 and strips[0] - up > within):
            continue
        here = line_at[i] + strip * strips[1]
        for j in range(_first_from(line_at, here - within), len(lines)):
            if line_at[j] > here + within:
                break
            if _lies_on(lines, i, sign, j, beside):
                return True
    return False


@inner_kernel
def _lies_on(lines, i, sign, j, beside):  # type: ignore[no-untyped-def]
    """Whether an end of one wall lies on another that is as good as parallel."""
    x, y, ux, uy, half = lines[i]
    dx, dy = x + sign * half * ux - lines[j, 0], y + sign * half * uy - lines[j, 1]
    if abs(ux * lines[j, 3] - uy * lines[j, 2]) > ALIKE or abs(dx * lines[j, 3] - dy * lines[j, 2]) > beside:
        return False
    along = dx * lines[j, 2] + dy * lines[j, 3]
    onward = sign * (ux * lines[j, 2] + uy * lines[j, 3])
    return abs(along + 0.5 * beside * onward) <= lines[j, 4]


@kernel
def _open_ends(lines, line_at, points, point_at, strips, longest, beside, reach, open_m):  # type: ignore[no-untyped-def]
    """How far each end may go on: to the nearest point ahead, or beyond reach; 0 where a point or another wall is at
    the end. Points are looked for in the box about the way ahead."""
    for i in range(len(lines)):
        x, y, ux, uy, half = lines[i]
        for side in range(2):
            sign = 2.0 * side - 1.0
            if _covered(lines, line_at, strips, i, sign, half + longest + 2.0 * beside, beside):
                continue
            ahead, far = 2.0 * reach, sign * (half + reach)
            low_x, high_x = min(0.0, far * ux) - beside, max(0.0, far * ux) + beside
            low_y, high_y = y + min(0.0, far * uy) - beside, y + max(0.0, far * uy) + beside
            own, first = math.floor(y / strips[0]), math.floor(low_y / strips[0])
            for strip in range(first, math.floor(high_y / strips[0]) + 1):
                here = line_at[i] + (strip - own) * strips[1]
                for k in range(_first_from(point_at, here + low_x), len(points)):
                    if point_at[k] > here + high_x:
                        break
                    dx, dy = points[k, 0] - x, points[k, 1] - y
                    at = sign * (dx * ux + dy * uy)
                    if at > 0.0 and at - half >= -beside and abs(dx * uy - dy * ux) <= beside:
                        ahead = min(ahead, at - half)
            if ahead > beside:
                open_m[i, side] = ahead


@kernel
def _meet(lines, line_at, strips, longest, beside, reach, open_m, pieces):  # type: ignore[no-untyped-def]
    """From each open end that does not go too far until it meets a point or a wall, or where another open end gets to,
    a piece; first ends before second ones. How many."""
    count = 0
    for side in range(2):
        sign = 2.0 * side - 1.0
        for i in range(len(lines)):
            x, y, ux, uy, half = lines[i]
            nearest = open_m[i, side]
            if nearest <= 0.0:
                continue
            vx, vy = sign * ux, sign * uy
            x0, y0 = x + half * vx, y + half * vy
            within = half + longest + 2.0 * reach + beside
            for strip in (0, -1, 1):
                here = line_at[i] + strip * strips[1]
                for j in range(_first_from(line_at, here - within), len(lines)):
                    if line_at[j] > here + within:
                        break
                    if j == i:
                        continue
                    wx, wy = lines[j, 2], lines[j, 3]
                    dx, dy = lines[j, 0] - x0, lines[j, 1] - y0
                    cross = vx * wy - vy * wx
                    if abs(cross) <= ALIKE:
                        if abs(dx * vy - dy * vx) <= beside:
                            at = dx * vx + dy * vy - lines[j, 4]
                            if at > 0.0:
                                nearest = min(nearest, at)
                    elif abs(cross) >= ACROSS:
                        at = (dx * wy - dy * wx) / cross
                        if 0.0 < at < nearest:
                            on = (dx * vy - dy * vx) / cross
                            more = min(reach, open_m[j, 1 if on > 0.0 else 0])
                            if abs(on) <= lines[j, 4] + more:
                                nearest = at
            if nearest <= reach:
                end, beyond = sign * half, sign * (half + nearest)
                pieces[count, 0], pieces[count, 1] = x + ux * end, y + uy * end
                pieces[count, 2], pieces[count, 3] = x + ux * beyond, y + uy * beyond
                count += 1
    return count
