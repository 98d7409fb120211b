"""Which wall a ray meets first.

A ray only picks a wall: where it runs need not be known to the last bit, but which wall it meets must be. So the
rays of a fan are made from the direction of the beam by products alone, and a ray that comes within a `blur` of
deciding otherwise (by the end of a wall, along it, between two walls at one place) is followed again from its
bearing, by the arithmetic of the plain form.
"""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel
from sonar_explore.envs.pings.arrays import AX, AY, EX, EY, NONE, START
from sonar_explore.envs.pings.geometry import crossing, mirrored_heading
from sonar_explore.envs.pings.rows import find_met, listed

UNSURE = -2
# rays that meet a wall at a smaller angle [rad] are not sure: their place on it is not known well
GRAZING = 1e-3
# shares of a ray's length by which a wall surely lies behind another, or far behind it, or touches its line;
# and how far beside the fan it then does:
BEHIND, FAR_BEHIND, TOUCHING, ASIDE_M = 1e-5, 1e-2, 1e-9, 1e-3


@inner_kernel
def surely_first(px, py, dx, dy, blur, near_walls, rows, places, count):  # type: ignore[no-untyped-def]
    """The nearest wall on the ray from p to p + d, -1 for none, `UNSURE` where rounding may decide; share of d.

    p and p + d are off by less than `blur`, [m]; `places` are those of the walls that it may meet among the near ones.
    """
    best, hit = 2.0, NONE
    reach = abs(dx) + abs(dy)
    for j in range(count):
        k = places[j]
        ax, ay, ex, ey = rows[AX, k] - px, rows[AY, k] - py, rows[EX, k], rows[EY, k]
        across, along, off = dx * ey - dy * ex, ax * ey - ay * ex, ax * dy - ay * dx
        if across < 0.0:
            across, along, off = -across, -along, -off
        length = abs(ex) + abs(ey)
        doubt = blur * (length + reach)
        if along < -doubt or off < -doubt or along > across + doubt or off > across + doubt:
            continue
        inside = min(min(along, off), across - max(along, off))
        if inside < doubt or across < GRAZING * reach * length:
            return UNSURE, best
        share = along / across
        if abs(share - best) < 1e-6:
            return UNSURE, best
        if share < best:
            best, hit = share, near_walls[k]
    return hit, best


@inner_kernel
def only_mirror(px, py, left_x, left_y, right_x, right_y, blur, rows, places, count):  # type: ignore[no-untyped-def]
    """Place of the one wall that all rays of a fan surely meet first, -1 where none may be or rounding could decide.

    The fan lies between p + left and p + right, `places` are those of the walls in it. A wall that both its sides
    meet is met by all between them, and first where everything else lies behind its line.
    """
    reach = max(abs(left_x) + abs(left_y), abs(right_x) + abs(right_y))
    only, depth, nx, ny, line = NONE, 2.0, 0.0, 0.0, 0.0
    for j in range(count):
        k = places[j]
        ax, ay, ex, ey = rows[AX, k] - px, rows[AY, k] - py, rows[EX, k], rows[EY, k]
        along, length = ax * ey - ay * ex, abs(ex) + abs(ey)
        sign = math.copysign(1.0, along)
        along = sign * along
        left, right = sign * (left_x * ey - left_y * ex), sign * (right_x * ey - right_y * ex)
        off_left, off_right = sign * (ax * left_y - ay * left_x), sign * (ax * right_y - ay * right_x)
        across = min(left, right)
        inside = min(min(off_left, off_right), min(left - off_left, right - off_right))
        inside = min(inside, min(along, across - along))
        unit = reach * length
        if inside > blur * (length + reach) and across > GRAZING * unit and along < depth * left:
            only, depth = k, along / left
            nx, ny, line = sign * ey / unit, -sign * ex / unit, along / unit
    for j in range(count if only >= 0 else START):
        k = places[j]
        x, y = rows[AX, k] - px, rows[AY, k] - py
        a = nx * x + ny * y - line
        b = a + nx * rows[EX, k] + ny * rows[EY, k]
        if k == only or min(a, b) > BEHIND:
            continue
        if b < a:
            x, y = x + rows[EX, k], y + rows[EY, k]
        aside = max(left_x * y - left_y * x, right_y * x - right_x * y) > ASIDE_M * reach
        # it may begin on that line, beside the fan
        if min(a, b) < -TOUCHING or max(a, b) < FAR_BEHIND or not aside:
            return NONE
    return only


@inner_kernel
def first_on_the_way(px, py, dx, dy, blur, near_walls, rows, places, allowed, skip):  # type: ignore[no-untyped-def]
    """`surely_first` of all near walls but one, among those `allowed` (rising; all, if they are as many).

    `places` is room to work in.
    """
    n, kept = len(near_walls), START
    find_met(px, py, dx, dy, blur, n, rows)
    for j in range(listed(n, rows, places)):
        i = near_walls[places[j]]
        if i != skip and (len(allowed) == n or _among(i, allowed)):
            places[kept] = places[j]
            kept += 1
    return surely_first(px, py, dx, dy, blur, near_walls, rows, places, kept)


@inner_kernel
def _among(i, rising):  # type: ignore[no-untyped-def]
    for j in rising:
        if j >= i:
            return j == i
    return False


@inner_kernel
def first_mirror(px, py, bearing, reach, walls, near_walls):  # type: ignore[no-untyped-def]
    """The first wall on a ray, -1 for none, and where it is met, as the plain form has it."""
    c, s = math.cos(bearing), math.sin(bearing)
    w, u = _first_hit(px, py, px + reach * c, py + reach * s, walls, near_walls, NONE)
    return w, px + u * reach * c, py + u * reach * s


@inner_kernel
def second_mirror(px, py, bearing, reach, walls, w1, allowed):  # type: ignore[no-untyped-def]
    """The wall that a ray meets after wall w1, -1 for none, as the plain form has it."""
    c, s = math.cos(bearing), math.sin(bearing)
    ax, ay, bx, by = walls[w1, 0], walls[w1, 1], walls[w1, 2], walls[w1, 3]
    u = crossing(px, py, px + reach * c, py + reach * s, ax, ay, bx, by)
    hx, hy = px + u * reach * c, py + u * reach * s
    ray = mirrored_heading(bearing, walls, w1)
    w2, _ = _first_hit(hx, hy, hx + reach * math.cos(ray), hy + reach * math.sin(ray), walls, allowed, w1)
    return w2


@inner_kernel
def _first_hit(px, py, qx, qy, walls, items, skip):  # type: ignore[no-untyped-def]
    """The nearest wall on the ray p->q: its index, -1 where none, and where, as a share of the ray."""
    best, hit = 2.0, NONE
    for i in items:
        if i == skip:
            continue
        u = crossing(px, py, qx, qy, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3])
        if 1e-9 < u < best:
            best, hit = u, i
    return hit, best
