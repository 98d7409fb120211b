"""Views: the sources that any ping from a small circle could hear, and what could hide them."""

from __future__ import annotations

import math
from typing import NamedTuple

from sonar_explore.compiled import inlined_kernel, inner_kernel
from sonar_explore.envs.pings.arrays import (
    BX,
    BY,
    COLUMN,
    COLUMNS_FROM,
    COLUMNS_TO,
    COS,
    EPS_M,
    FOUND,
    HIDDEN_BY,
    LOUD,
    MUTE,
    NEAREST,
    OPENS,
    RIGHT_CORNER,
    ROUGH_WALL,
    START,
    WALL,
    WALLS_FROM,
    WALLS_TO,
    WEDGE,
    WHAT,
    WHICH,
    WIDE,
    Circle,
)
from sonar_explore.envs.pings.geometry import mirrored, must_cross
from sonar_explore.envs.pings.rows import find_between, find_feet, find_wedges, shut

HIDDEN = -2


class Gates(NamedTuple):
    """What sound must pass on its way from a view to a source, seen as a straight line; the middle is at (0, 0)."""

    ax: float
    """Ends of the last mirror, [m]."""
    ay: float
    bx: float
    by: float
    side_ab: float
    """On which side of it the middle lies, 0 where parts of the circle lie on either: [m] times the mirror's length."""
    apart_ab: float
    """The square of what is on either side."""
    cx: float
    """The same of the first mirror's image in the last; of the last again where there is one."""
    cy: float
    dx: float
    dy: float
    side_cd: float
    apart_cd: float


OPEN = Gates(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No gates: what is seen from the discs themselves."""


@inner_kernel
def _side(ax, ay, bx, by, slack):  # type: ignore[no-untyped-def]
    """`side_ab` and `apart_ab` of a gate."""
    ex, ey = bx - ax, by - ay
    side, apart = ey * ax - ex * ay, slack * slack * (ex * ex + ey * ey)
    return side if side * side > apart else 0.0, apart


@inner_kernel
def amplitude(what, r, gain, i, things, ear):  # type: ignore[no-untyped-def]
    """On the axis, of a plane, a wedge or a column at range r."""
    if what == WEDGE and things.wedges[i, 4] != RIGHT_CORNER:
        return gain * ear.edge_strength * r**-1.5
    if what == COLUMN:
        radius = things.cylinders[i, 2]
        return gain / r * math.sqrt(radius / (radius + r))
    return gain / r


@inner_kernel
def _put(source, place, what, i, dx, dy, off, spread, circle, things, narrow, ear):  # type: ignore[no-untyped-def]
    """Fill in a source seen at (dx, dy) from the middle of a view; False where no ping of the view can hear it.

    `off` is what its range is shorter than that distance, `spread` how far the bearing's vector may be off, both [m].
    The window is as `narrow` as can be where many pings will use it, else a little wider and sooner computed.
    """
    rho = circle.rho + EPS_M
    distance = math.sqrt(dx * dx + dy * dy)
    nearest = max(distance - off - rho, 1e-6)
    if nearest >= ear.range_max:
        return False
    ratio = amplitude(what, nearest, circle.gain, i, things, ear) / ear.threshold
    if ratio < 1.0 - 1e-9:
        return False
    loud = -1.0
    if narrow:
        log_ratio = math.log(ratio)
        least = amplitude(what, distance + rho, circle.gain, i, things, ear)  # farther than any: the softest
        loud = ear.s * ear.s * math.log(least / ear.threshold) * (1.0 - 1e-9) - 1e-9
    else:
        log_ratio = (ratio - 1.0) / math.sqrt(ratio)  # at least the logarithm
    mute = ear.s * ear.s * log_ratio * (1.0 + 1e-9) + 1e-9
    source[place, MUTE], source[place, LOUD], source[place, NEAREST] = mute, loud, nearest
    if distance <= 2.0 * rho + spread + EPS_M:
        source[place, BX], source[place, BY], source[place, COS] = 1.0, 0.0, -2.0
    else:
        half = math.sqrt(min(mute, ear.square_widest)) + 1e-6
        k = spread / distance
        source[place, BX], source[place, BY] = dx / distance, dy / distance
        source[place, COS] = (1.0 - 0.5 * half * half) * math.sqrt(1.0 - k * k) - half * k - 1e-9
    return True


@inner_kernel
def mirror_view(w1, w2, circle, things, near, room, first, ear):  # type: ignore[no-untyped-def]
    """The sources that a ping from the circle may hear by way of mirror w1, and w2 (-1: no second): where they end."""
    walls, slack = things.walls, circle.rho + EPS_M
    ax, ay, bx, by = walls[w1, 0], walls[w1, 1], walls[w1, 2], walls[w1, 3]
    cx, cy, dx, dy = ax, ay, bx, by
    qx, qy = mirrored(circle.x, circle.y, walls, w1)
    gain = ear.loss * ear.loss
    if w2 >= 0:
        qx, qy = mirrored(qx, qy, walls, w2)
        cx, cy = mirrored(ax, ay, walls, w2)
        dx, dy = mirrored(bx, by, walls, w2)
        ax, ay, bx, by = walls[w2, 0], walls[w2, 1], walls[w2, 2], walls[w2, 3]
        gain *= gain
    ax, ay, bx, by = ax - qx, ay - qy, bx - qx, by - qy
    t = -(ax * (bx - ax) + ay * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
    t = min(1.0, max(0.0, t))
    to_mirror = math.sqrt((ax + t * (bx - ax)) ** 2 + (ay + t * (by - ay)) ** 2)
    if to_mirror - slack >= ear.range_max:  # whatever is heard lies behind it
        return first
    cx, cy, dx, dy = cx - qx, cy - qy, dx - qx, dy - qy
    side_ab, apart_ab = _side(ax, ay, bx, by, slack)
    side_cd, apart_cd = _side(cx, cy, dx, dy, slack)
    gates = Gates(ax, ay, bx, by, side_ab, apart_ab, cx, cy, dx, dy, side_cd, apart_cd)
    edge_reach = ear.edge_reach * ear.edge_loss * (ear.edge_loss if w2 >= 0 else 1.0)
    image = Circle(qx, qy, circle.rho, gain, w1, w2)
    return view(image, gates, min(ear.range_max, edge_reach), things, near, room, first, WIDE, ear)


@inner_kernel
def view(circle, gates, edge_reach, things, near, room, n, narrow, ear):  # type: ignore[no-untyped-def]
    """The sources that a ping from the circle may hear through its gates, from row n on: where they end.

    Edges farther than `edge_reach` are not heard, [m].
    """
    source, ids, rows, slack = room.source, room.ids, room.rows, circle.rho + EPS_M
    last_mirror = circle.mirror_2 if circle.mirror_2 >= 0 else circle.mirror_1
    find_feet(circle, gates, len(near.walls), rows)
    for k in range(len(near.walls)):
        if rows[FOUND, k] > 0.0 and near.walls[k] != last_mirror:
            n = _view_wall(circle, near.walls[k], things, source, ids, n, narrow, ear)
    find_wedges(circle, gates, ear.range_max, edge_reach, len(near.wedges), rows)
    for k in range(len(near.wedges)):
        if rows[FOUND, k] > 0.0:
            i = near.wedges[k]
            ids[n, WHAT], ids[n, WHICH], ids[n, OPENS] = WEDGE, i, rows[FOUND, k] > 1.0
            dx, dy = things.wedges[i, 0] - circle.x, things.wedges[i, 1] - circle.y
            n += _put(source, n, WEDGE, i, dx, dy, 0.0, slack, circle, things, narrow, ear)
    for i in near.cylinders:
        ids[n, WHAT], ids[n, WHICH], ids[n, OPENS] = COLUMN, i, 0
        dx, dy = things.cylinders[i, 0] - circle.x, things.cylinders[i, 1] - circle.y
        if not shut(dx, dy, slack, gates) and _put(
            source, n, COLUMN, i, dx, dy, things.cylinders[i, 2], slack, circle, things, narrow, ear
        ):
            n += 1
    return n


@inlined_kernel
def _view_wall(circle, i, things, source, ids, n, narrow, ear):  # type: ignore[no-untyped-def]
    walls, vx, vy = things.walls, circle.x, circle.y
    if walls[i, 4] > 0.0:  # heard at any angle
        for what in (WALL, ROUGH_WALL):
            ids[n, WHAT], ids[n, WHICH], ids[n, OPENS] = what, i, 0
            source[n, BX], source[n, BY], source[n, COS] = 1.0, 0.0, -2.0
            source[n, NEAREST], source[n, MUTE], source[n, LOUD] = 0.0, 1e9, -1.0
            n += 1
        return n
    ids[n, WHAT], ids[n, WHICH], ids[n, OPENS] = WALL, i, 0
    ax, ay = walls[i, 0], walls[i, 1]
    ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
    t = ((vx - ax) * ex + (vy - ay) * ey) / (ex * ex + ey * ey)
    sx, sy = ax + t * ex, ay + t * ey
    return n + _put(source, n, WALL, i, sx - vx, sy - vy, 0.0, 1e-6, circle, things, narrow, ear)


@inner_kernel
def hidden_by(circle, things, near, room, n):  # type: ignore[no-untyped-def]
    """List for each of n sources what could hide it from the circle; drop those hidden for good: how many stay."""
    source, ids, hiding, used, kept = room.source, room.ids, room.lists[HIDDEN_BY], START, START
    for k in range(n):
        what, i = ids[k, WHAT], ids[k, WHICH]
        start, middle, used = _list_hiding(circle, what, i, things, near, room.rows, hiding, used)
        if start == HIDDEN:
            continue
        for column in range(LOUD + 1):
            source[kept, column] = source[k, column]
        ids[kept, WHAT], ids[kept, WHICH], ids[kept, OPENS] = what, i, ids[k, OPENS]
        ids[kept, WALLS_FROM], ids[kept, WALLS_TO] = start, middle
        ids[kept, COLUMNS_FROM], ids[kept, COLUMNS_TO] = middle, used
        kept += 1
    return kept


@inlined_kernel
def _list_hiding(circle, what, i, things, near, rows, hiding, used):  # type: ignore[no-untyped-def]
    """Walls, then columns, that could hide source i, from place `used` on: where walls and columns begin, the end.

    They begin at -1 where there is no list: anything near could hide it; at `HIDDEN` where a wall surely does.
    """
    walls, cylinders = things.walls, things.cylinders
    vx, vy, slack = circle.x, circle.y, circle.rho + EPS_M
    if what == ROUGH_WALL or (what == WALL and walls[i, 4] != 0.0):
        return -1, -1, used
    own, thick, start = -1, 0.0, used
    if what == WALL:
        own = i
        ax, ay = walls[i, 0], walls[i, 1]
        ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
        t = ((vx - ax) * ex + (vy - ay) * ey) / (ex * ex + ey * ey)
        sx, sy = ax + t * ex, ay + t * ey
    elif what == WEDGE:
        sx, sy = things.wedges[i, 0], things.wedges[i, 1]
    else:
        sx, sy, thick = cylinders[i, 0], cylinders[i, 1], cylinders[i, 2]
    find_between(vx, vy, sx, sy, slack, len(near.walls), rows)
    for k in range(len(near.walls)):
        j = near.walls[k]
        if rows[FOUND, k] < 0.0 or j == own:
            continue
        ax, ay, bx, by = walls[j, 0], walls[j, 1], walls[j, 2], walls[j, 3]
        if must_cross(vx, vy, sx, sy, slack, slack + thick, ax, ay, bx, by):
            return HIDDEN, HIDDEN, start
        if used == len(hiding):
            return -1, -1, start
        hiding[used] = j
        used += 1
    middle = used
    dx, dy = sx - vx, sy - vy
    squared = max(dx * dx + dy * dy, 1e-12)
    for j in near.cylinders:
        mx, my = cylinders[j, 0] - vx, cylinders[j, 1] - vy
        u = min(1.0, max(0.0, (mx * dx + my * dy) / squared))
        ox, oy = mx - u * dx, my - u * dy
        if (what == COLUMN and j == i) or ox * ox + oy * oy > (cylinders[j, 2] + slack) ** 2:
            continue
        if used == len(hiding):
            return -1, -1, start
        hiding[used] = j
        used += 1
    return start, middle, used
