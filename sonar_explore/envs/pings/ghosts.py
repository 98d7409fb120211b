"""Ghosts: what a disc that hears nothing directly hears by way of one or two walls that act as mirrors."""

from __future__ import annotations

import math

from sonar_explore.compiled import inlined_kernel, inner_kernel
from sonar_explore.envs.pings.arrays import (
    BX,
    BY,
    COS,
    FAN_RAD,
    GHOST,
    IN_FAN,
    IN_SIGHT,
    KNOWN_VIEWS,
    NONE,
    NOTHING,
    SPARE,
    VIEWS,
    Circle,
    Disc,
)
from sonar_explore.envs.pings.direct import nearest_source
from sonar_explore.envs.pings.geometry import mirrored, mirrored_heading
from sonar_explore.envs.pings.rays import (
    UNSURE,
    first_mirror,
    first_on_the_way,
    only_mirror,
    second_mirror,
    surely_first,
)
from sonar_explore.envs.pings.rows import find_in_fan, listed
from sonar_explore.envs.pings.views import mirror_view

_OFFSETS_RAD = tuple(step * FAN_RAD for step in (0.0, -1.0, 1.0, -2.0, 2.0))


@inner_kernel
def ghost(silent, heading, allowed, circle, things, near, room, ear, base, known):  # type: ignore[no-untyped-def]
    """Range [m] and kind of the nearest ghost that a silent disc hears, and how many views there are now.

    It is heard by way of the walls that a fan of rays in the beam meets; `allowed` are those near the disc's cell.
    Sources of views stand from row `base` on.
    """
    best, kind = ear.range_max, NOTHING
    walls, rows, lists, reach = things.walls, room.rows, room.lists, ear.range_max
    px, py, c, s = silent.px, silent.py, silent.c, silent.s
    blur = 1e-6 + 1e-11 * (abs(px) + abs(py))
    half_c, half_s = ear.fan_c, ear.fan_s
    turn_c, turn_s = half_c * half_c - half_s * half_s, 2.0 * half_c * half_s
    fan, count = lists[IN_FAN], len(near.walls)
    # no sides where they would be half a turn apart: all walls are in it
    side = reach if turn_c > 0.2 else 0.0
    left_x, left_y = side * (c * turn_c - s * turn_s), side * (s * turn_c + c * turn_s)
    right_x, right_y = side * (c * turn_c + s * turn_s), side * (s * turn_c - c * turn_s)
    find_in_fan(px, py, left_x, left_y, right_x, right_y, blur, count, rows)
    count = listed(count, rows, fan)
    rays, only = 5, only_mirror(px, py, left_x, left_y, right_x, right_y, blur, rows, fan, count)
    if only >= 0:  # mostly: the other rays would find the same
        fan[0], count, rays = only, 1, 1
    places, seen_1, seen_2 = lists[IN_SIGHT], NONE, NONE
    for ray in range(rays):
        bearing, rc, rs = heading + ear.fan * _OFFSETS_RAD[ray], c, s
        if ray > 0:
            along, side = (half_c, half_s) if ray < 3 else (turn_c, turn_s)
            side = side if ray % 2 == 0 else -side
            rc, rs = c * along - s * side, s * along + c * side
        w1, u = surely_first(px, py, reach * rc, reach * rs, blur, near.walls, rows, fan, count)
        hx, hy = px + u * reach * rc, py + u * reach * rs
        if w1 == UNSURE:
            w1, hx, hy = first_mirror(px, py, bearing, reach, walls, near.walls)
        if w1 < 0 or w1 in (seen_1, seen_2):
            continue
        seen_2 = seen_1
        seen_1 = w1
        w2 = NONE
        h1, v1 = _reflected(c, s, walls, w1)
        for mirror_count in range(1, 1 + min(ear.mirrors, 2)):
            if mirror_count == 2:
                if kind != NOTHING:
                    break
                rc, rs = _reflected(rc, rs, walls, w1)
                w2, _ = first_on_the_way(
                    hx, hy, reach * rc, reach * rs, blur, near.walls, rows, lists[SPARE], allowed, w1
                )
                if w2 == UNSURE:
                    w2 = second_mirror(px, py, bearing, reach, walls, w1, allowed)
                if w2 < 0:
                    break
                h1, v1 = _reflected(h1, v1, walls, w2)
            place, known = _view_by(w1, w2, circle, things, near, room, ear, base, known)
            in_sight = _in_sight(
                h1, v1, room.source, lists[KNOWN_VIEWS, place + 2], lists[KNOWN_VIEWS, place + 3], places
            )
            if in_sight == 0:
                continue
            image, by = _image(px, py, heading, circle, w1, w2, walls, ear.loss)
            r, k = nearest_source(image, by, best, things, near, room, places, in_sight, ear)
            if k != NOTHING:
                best, kind = r, k + mirror_count * GHOST
    return best, kind, known


@inlined_kernel
def _image(px, py, heading, circle, w1, w2, walls, loss):  # type: ignore[no-untyped-def]
    """The disc in one mirror, or in two, and its circle."""
    h = mirrored_heading(heading, walls, w1)
    q1x, q1y = mirrored(px, py, walls, w1)
    qx, qy, gain = q1x, q1y, loss**2
    if w2 != NONE:
        h = mirrored_heading(h, walls, w2)
        qx, qy = mirrored(q1x, q1y, walls, w2)
        gain = loss**4
    image = Disc(px, py, q1x, q1y, qx, qy, math.cos(h), math.sin(h))
    return image, Circle(circle.x, circle.y, circle.rho, gain, w1, w2)


@inner_kernel
def _reflected(c, s, walls, i):  # type: ignore[no-untyped-def]
    """A direction after its reflection by wall i, but for rounding."""
    ex, ey = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
    twice = 2.0 * (c * ex + s * ey) / (ex * ex + ey * ey)
    return twice * ex - c, twice * ey - s


@inlined_kernel
def _in_sight(c, s, source, first, last, places):  # type: ignore[no-untyped-def]
    """Sources of a view that a beam along (c, s), known but for rounding, may hear, into `places`: how many."""
    count = 0
    for k in range(first, last):
        if c * source[k, BX] + s * source[k, BY] >= source[k, COS] - 1e-9:
            places[count] = k
            count += 1
    return count


@inner_kernel
def _view_by(w1, w2, circle, things, near, room, ear, base, known):  # type: ignore[no-untyped-def]
    """The view by way of these mirrors, made at its first use: where it stands among them, and how many there are.

    Four numbers each: the mirrors, the first source, the end.
    """
    views = room.lists[KNOWN_VIEWS]
    for j in range(known):
        k = known - 1 - j  # the latest first: neighbouring rays ask for the same
        if views[4 * k] == w1 and views[4 * k + 1] == w2:
            return 4 * k, known
    first = views[4 * known - 1] if known > 0 else base
    most = 2 * len(near.walls) + len(near.wedges) + len(near.cylinders) + 1
    if 4 * known + 4 > VIEWS or first + most > len(room.source):
        known, first = 0, base
    last = mirror_view(w1, w2, circle, things, near, room, first, ear)
    k = 4 * known
    views[k], views[k + 1], views[k + 2], views[k + 3] = w1, w2, first, last
    return k, known + 1
