"""How a wall goes on beyond where it was heard: to the edge, the corner or the wall that ends it.

A scan meets a wall's normal only from in front of it, and never beside a corner, where the robot has no room. What is
left open there looks like a way out. But an opening has jambs, and jambs answer: where none did, the wall goes on.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array

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
    around = length + reach_m + beside_m
    wide = around + length.max() + reach_m  # the middle of a wall that goes on to meet it may lie so far off
    strip_m = float(wide.max())
    lines, around, wide = (rows[_by_strips(lines, strip_m)] for rows in (lines, around, wide))
    points = points[_by_strips(points, strip_m)]
    points_near = _near(lines, points, around, strip_m)
    walls_near = _near(lines, lines, wide, strip_m)
    open_m, pieces = np.zeros((len(lines), 2)), np.empty((2 * len(lines), 4))
    _open_ends(lines, points, points_near, walls_near, beside_m, reach_m, open_m)
    return pieces[: _meet(lines, walls_near, beside_m, reach_m, open_m, pieces)]


def _by_strips(places: Array, strip_m: float) -> NDArray[np.intp]:
    """The order of rows that begin with x y by strips of y, and by x within each."""
    return np.lexsort((places[:, 0], np.floor(places[:, 1] / strip_m)))


def _near(about: Array, places: Array, around_m: Array, strip_m: float) -> NDArray[np.intp]:
    """Of places by strips those that may lie so near to each row of `about`: the first and the last but one of its
    strip and of those beside it, shape (n, 3, 2); none lies farther than a strip is wide."""
    if not len(places):
        return np.zeros((len(about), 3, 2), dtype=np.intp)
    least = min(float(about[:, 0].min()), float(places[:, 0].min()))
    most = max(float(about[:, 0].max()), float(places[:, 0].max()))
    long_m = most - least + 2.0 * strip_m + 1.0  # strip after strip along one line, with room between
    at = np.floor(places[:, 1] / strip_m) * long_m + places[:, 0] - least
    mine = np.floor(about[:, 1] / strip_m)[:, None] + np.array([-1.0, 0.0, 1.0])
    here = mine * long_m + (about[:, 0] - least)[:, None]
    ends = np.stack([here - around_m[:, None], here + around_m[:, None]], axis=2)
    return np.searchsorted(at, ends)


@kernel
def _open_ends(lines, points, points_near, walls_near, beside, reach, open_m):  # type: ignore[no-untyped-def]
    """How far each end may go on: to the nearest point ahead, or beyond reach; 0 where a point or its own wall is at
    the end."""
    for i in range(len(lines)):
        x, y, ux, uy, half = lines[i]
        for side in range(2):
            sign = 2.0 * side - 1.0
            ahead = 2.0 * reach
            for strip in range(3):
                for k in range(points_near[i, strip, 0], points_near[i, strip, 1]):
                    dx, dy = points[k, 0] - x, points[k, 1] - y
                    at = sign * (dx * ux + dy * uy)
                    if at > 0.0 and at - half >= -beside and abs(dx * uy - dy * ux) <= beside:
                        ahead = min(ahead, at - half)
            if ahead <= beside:
                continue
            end_x, end_y = x + sign * half * ux, y + sign * half * uy
            covered = False
            for strip in range(3):
                for j in range(walls_near[i, strip, 0], walls_near[i, strip, 1]):
                    dx, dy = end_x - lines[j, 0], end_y - lines[j, 1]
                    if (
                        abs(ux * lines[j, 3] - uy * lines[j, 2]) <= ALIKE
                        and abs(dx * lines[j, 3] - dy * lines[j, 2]) <= beside
                    ):
                        along = dx * lines[j, 2] + dy * lines[j, 3]
                        onward = sign * (ux * lines[j, 2] + uy * lines[j, 3])
                        if j != i and abs(along + 0.5 * beside * onward) <= lines[j, 4]:
                            covered = True
                            break
                if covered:
                    break
            if not covered:
                open_m[i, side] = ahead


@kernel
def _meet(lines, walls_near, beside, reach, open_m, pieces):  # type: ignore[no-untyped-def]
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
            for strip in range(3):
                for j in range(walls_near[i, strip, 0], walls_near[i, strip, 1]):
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
