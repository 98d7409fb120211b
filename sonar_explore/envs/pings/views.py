"""Views: the sources that any ping from a small circle could hear, and what could hide them."""

from __future__ import annotations

import math

from sonar_explore.compiled import inlined_kernel, inner_kernel, lean_kernel
from sonar_explore.envs.pings.arrays import (
    BX,
    BY,
    COLUMN,
    COLUMNS_FROM,
    COLUMNS_TO,
    COS,
    EPS_M,
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
)
from sonar_explore.envs.pings.geometry import may_cross, mirrored, must_cross

HIDDEN = -2


@inner_kernel
def _through(circle, sx, sy, walls):  # type: ignore[no-untyped-def]
    """False only where no path from the circle to points as near to s meets its mirrors."""
    vx, vy, slack, mirror_1, mirror_2 = (
        circle.x,
        circle.y,
        circle.rho + EPS_M,
        circle.mirror_1,
        circle.mirror_2,
    )
    if mirror_1 < 0:
        return True
    w = mirror_1 if mirror_2 < 0 else mirror_2
    if not may_cross(vx, vy, sx, sy, slack, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]):
        return False
    if mirror_2 < 0:
        return True
    ax, ay = mirrored(walls[mirror_1, 0], walls[mirror_1, 1], walls, mirror_2)
    bx, by = mirrored(walls[mirror_1, 2], walls[mirror_1, 3], walls, mirror_2)
    return may_cross(vx, vy, sx, sy, slack, ax, ay, bx, by)


@inner_kernel
def amplitude(what, r, gain, i, things, ear):  # type: ignore[no-untyped-def]
    """On the axis, of a plane, a wedge or a column at range r."""
    if what == WEDGE and things.wedges[i, 4] != RIGHT_CORNER:
        return gain * ear.edge_strength * r**-1.5
    if what == COLUMN:
        radius = things.cylinders[i, 2]
        return gain / r * math.sqrt(radius / (radius + r))
    return gain / r


@lean_kernel
def _put(source, place, what, i, dx, dy, off, spread, circle, things, ear):  # type: ignore[no-untyped-def]
    """Fill in a source seen at (dx, dy) from the middle of a view; False where no ping of the view can hear it.

    `off` is what its range is shorter than that distance, `spread` how far the bearing's vector may be off, both [m].
    """
    rho, gain = circle.rho + EPS_M, circle.gain
    distance = math.sqrt(dx * dx + dy * dy)
    nearest = max(distance - off - rho, 1e-6)
    if nearest >= ear.range_max:
        return False
    loudest = amplitude(what, nearest, gain, i, things, ear)
    if loudest < ear.threshold * (1.0 - 1e-9):
        return False
    least = amplitude(what, distance + rho, gain, i, things, ear)  # farther than any: the softest it can be
    mute = ear.s * ear.s * math.log(loudest / ear.threshold) * (1.0 + 1e-9) + 1e-9
    source[place, MUTE] = mute
    source[place, LOUD] = ear.s * ear.s * math.log(least / ear.threshold) * (1.0 - 1e-9) - 1e-9
    source[place, NEAREST] = nearest
    if distance <= 2.0 * rho + spread + EPS_M:
        source[place, BX], source[place, BY], source[place, COS] = 1.0, 0.0, -2.0
    else:
        half = math.sqrt(min(mute, ear.square_widest)) + 1e-6
        k = spread / distance
        source[place, BX], source[place, BY] = dx / distance, dy / distance
        source[place, COS] = (1.0 - 0.5 * half * half) * math.sqrt(1.0 - k * k) - half * k - 1e-9
    return True


@inner_kernel
def _opens(wedges, i, dx, dy, rho):  # type: ignore[no-untyped-def]
    """Whether wedge i at (dx, dy) opens to all of a circle of radius rho (1), to none of it (-1), or to some (0)."""
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= 2.0 * rho + EPS_M:
        return 0
    turn = 1.1 * rho / distance + 1e-6  # more than asin(rho / distance) up to a half
    inside = (math.atan2(-dy, -dx) - wedges[i, 2]) % (2.0 * math.pi)
    if turn < inside < wedges[i, 3] - turn:
        return 1
    if wedges[i, 3] + turn < inside < 2.0 * math.pi - turn:
        return -1
    return 0


@lean_kernel
def view(circle, things, near, source, ids, n, ear):  # type: ignore[no-untyped-def]
    """The sources that a ping from the circle may hear by way of its mirrors, from row n on: how many in all."""
    last_mirror = circle.mirror_2 if circle.mirror_2 >= 0 else circle.mirror_1
    for i in near.walls:
        if i != last_mirror:
            n = _view_wall(circle, i, things, source, ids, n, ear)
    edge_reach = min(ear.range_max, (circle.gain * ear.edge_strength / ear.threshold) ** (2.0 / 3.0))
    for i in near.wedges:
        n = _view_wedge(circle, i, edge_reach, things, source, ids, n, ear)
    for i in near.cylinders:
        ids[n, WHAT], ids[n, WHICH], ids[n, OPENS] = COLUMN, i, 0
        cx, cy, radius = things.cylinders[i]
        dx, dy, slack = cx - circle.x, cy - circle.y, circle.rho + EPS_M
        if _through(circle, cx, cy, things.walls) and _put(
            source, n, COLUMN, i, dx, dy, radius, slack, circle, things, ear
        ):
            n += 1
    return n


@inlined_kernel
def _view_wall(circle, i, things, source, ids, n, ear):  # type: ignore[no-untyped-def]
    walls, vx, vy, slack = things.walls, circle.x, circle.y, circle.rho + EPS_M
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
    squared = ex * ex + ey * ey
    dot = (vx - ax) * ex + (vy - ay) * ey
    beyond = slack * math.sqrt(squared)
    if dot < -beyond or dot > squared + beyond:
        return n
    t = dot / squared
    sx, sy = ax + t * ex, ay + t * ey
    if _through(circle, sx, sy, walls) and _put(
        source, n, WALL, i, sx - vx, sy - vy, 0.0, 1e-6, circle, things, ear
    ):
        n += 1
    return n


@inlined_kernel
def _view_wedge(circle, i, edge_reach, things, source, ids, n, ear):  # type: ignore[no-untyped-def]
    wedges, slack = things.wedges, circle.rho + EPS_M
    dx, dy = wedges[i, 0] - circle.x, wedges[i, 1] - circle.y
    reach = (ear.range_max if wedges[i, 4] == RIGHT_CORNER else edge_reach) + slack
    if dx * dx + dy * dy > reach * reach or not _through(circle, wedges[i, 0], wedges[i, 1], things.walls):
        return n
    if not _put(source, n, WEDGE, i, dx, dy, 0.0, slack, circle, things, ear):
        return n
    opens = _opens(wedges, i, dx, dy, slack)
    if opens >= 0:
        ids[n, WHAT], ids[n, WHICH], ids[n, OPENS] = WEDGE, i, opens
        n += 1
    return n


@inner_kernel
def hidden_by(circle, things, near, source, ids, n, hiding):  # type: ignore[no-untyped-def]
    """List for each of n sources what could hide it from the circle; drop those hidden for good: how many stay."""
    used, kept = START, START
    for k in range(n):
        what, i = ids[k, WHAT], ids[k, WHICH]
        start, middle, used = _list_hiding(circle, what, i, things, near, hiding, used)
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
def _list_hiding(circle, what, i, things, near, hiding, used):  # type: ignore[no-untyped-def]
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
    for j in near.walls:
        ax, ay, bx, by = walls[j, 0], walls[j, 1], walls[j, 2], walls[j, 3]
        if j == own or not may_cross(vx, vy, sx, sy, slack, ax, ay, bx, by):
            continue
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
