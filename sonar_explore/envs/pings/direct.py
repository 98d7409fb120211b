"""What one disc, or its image, hears of a view's sources."""

from __future__ import annotations

import math

from sonar_explore.compiled import inlined_kernel, inner_kernel
from sonar_explore.envs.pings.arrays import (
    COLUMN,
    COLUMNS_FROM,
    COLUMNS_TO,
    CORNER,
    CYLINDER,
    EDGE,
    HIDDEN_BY,
    LOUD,
    MUTE,
    NEAREST,
    NONE,
    NOTHING,
    OPENS,
    PLANE,
    RIGHT_CORNER,
    ROUGH,
    ROUGH_WALL,
    WALL,
    WALLS_FROM,
    WALLS_TO,
    WEDGE,
    WHAT,
    WHICH,
)
from sonar_explore.envs.pings.geometry import crossing, is_clear
from sonar_explore.envs.pings.views import amplitude


@inlined_kernel
def _echo(what, i, opens, disc, gain, best, mute, loud, things, ear):  # type: ignore[no-untyped-def]
    """Range [m] at which q hears source i in its beam, -1 where not or not nearer than `best`; its place.

    sin^2 <= theta^2 <= tan^2: where either already tells that it is too soft or loud enough, no angle is computed.
    Half of what is asked for is too soft, so that is asked first, before its range is known.
    """
    walls, qx, qy, c, s = things.walls, disc.qx, disc.qy, disc.c, disc.s
    sx, sy, radius = 0.0, 0.0, 0.0
    if what == ROUGH_WALL:
        return _rough_echo(i, disc, gain, best, walls, ear)
    if what == WALL:
        ax, ay = walls[i, 0], walls[i, 1]
        ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
        t = ((qx - ax) * ex + (qy - ay) * ey) / (ex * ex + ey * ey)
        if t < 0.0 or t > 1.0:
            return -1.0, sx, sy
        sx, sy = ax + t * ex, ay + t * ey
    elif what == WEDGE:
        sx, sy = things.wedges[i, 0], things.wedges[i, 1]
    else:
        sx, sy, radius = things.cylinders[i, 0], things.cylinders[i, 1], things.cylinders[i, 2]
    dx, dy = sx - qx, sy - qy
    along, across = c * dx + s * dy, c * dy - s * dx
    cc, aa = along * along, across * across
    if aa > mute * (aa + cc):
        return -1.0, sx, sy
    distance = math.hypot(dx, dy)
    r = distance - radius
    if r < 1e-6 or r >= best or along < ear.cos_widest * distance:
        return -1.0, sx, sy
    if what == WEDGE and opens == 0 and not _is_open(things.wedges, i, dx, dy):
        return -1.0, sx, sy
    if aa >= loud * cc:
        theta = math.atan2(across, along)
        on_axis = amplitude(what, r, gain, i, things, ear)
        if on_axis * math.exp(-(theta * theta) / (ear.s * ear.s)) < ear.threshold:
            return -1.0, sx, sy
    if what == COLUMN:
        sx, sy = qx + dx * r / distance, qy + dy * r / distance
    return r, sx, sy


@inner_kernel
def _is_open(wedges, i, dx, dy):  # type: ignore[no-untyped-def]
    """Whether wedge i, at (dx, dy) from a disc, opens to it."""
    return (math.atan2(-dy, -dx) - wedges[i, 2]) % (2.0 * math.pi) <= wedges[i, 3]


@inner_kernel
def _rough_echo(i, disc, gain, best, walls, ear):  # type: ignore[no-untyped-def]
    """The same of a rough wall, where the beam's axis meets it."""
    qx, qy, c, s = disc.qx, disc.qy, disc.c, disc.s
    ax, ay, bx, by = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
    r = crossing(qx, qy, qx + best * c, qy + best * s, ax, ay, bx, by) * best
    if r <= 1e-6:
        return -1.0, 0.0, 0.0
    ex, ey = bx - ax, by - ay
    cos_incidence = abs(c * ey - s * ex) / math.hypot(ex, ey)
    loud_enough = gain * walls[i, 4] * cos_incidence / r >= ear.threshold
    return r if loud_enough else -1.0, qx + r * c, qy + r * s


@inner_kernel
def _kind(what, i, wedges):  # type: ignore[no-untyped-def]
    if what == WEDGE:
        return CORNER if wedges[i, 4] == RIGHT_CORNER else EDGE
    if what == WALL:
        return PLANE
    return ROUGH if what == ROUGH_WALL else CYLINDER


@inner_kernel
def _reachable(disc, circle, sx, sy, own_wall, own_cylinder, things, near, ids, k, hiding):  # type: ignore[no-untyped-def]
    """Whether sound comes from the disc, by way of the view's mirrors, to the source s in row k and back."""
    walls, cylinders = things.walls, things.cylinders
    tx, ty, skip, cylinder = sx, sy, own_wall, own_cylinder
    mirror, ix, iy = circle.mirror_2, disc.qx, disc.qy
    if circle.mirror_2 < 0:
        mirror = circle.mirror_1
    while mirror >= 0:  # from the source backwards, from mirror to mirror
        u = crossing(ix, iy, tx, ty, walls[mirror, 0], walls[mirror, 1], walls[mirror, 2], walls[mirror, 3])
        if u <= 0.0 or u >= 1.0:
            return False
        hx, hy = ix + u * (tx - ix), iy + u * (ty - iy)
        if not is_clear(hx, hy, tx, ty, walls, cylinders, near.walls, near.cylinders, mirror, skip, cylinder):
            return False
        tx, ty, skip, cylinder = hx, hy, mirror, NONE
        ix, iy = disc.q1x, disc.q1y
        mirror = circle.mirror_1 if mirror == circle.mirror_2 else NONE
    near_walls, near_columns = near.walls, near.cylinders
    if circle.mirror_1 < 0 and ids[k, WALLS_FROM] >= 0:
        if ids[k, WALLS_FROM] == ids[k, COLUMNS_TO]:
            return True
        near_walls = hiding[ids[k, WALLS_FROM] : ids[k, WALLS_TO]]
        near_columns = hiding[ids[k, COLUMNS_FROM] : ids[k, COLUMNS_TO]]
    return is_clear(
        disc.px, disc.py, tx, ty, walls, cylinders, near_walls, near_columns, skip, NONE, cylinder
    )


@inner_kernel
def nearest_source(disc, circle, range_max, things, near, room, places, count, ear):  # type: ignore[no-untyped-def]
    """Nearest of these sources of a view above the threshold as the disc's last image hears it: range [m] and kind."""
    best, kind, source, ids = range_max, NOTHING, room.source, room.ids
    for j in range(count):
        k = places[j]
        if source[k, NEAREST] >= best:
            continue
        what, i, mute, loud = ids[k, WHAT], ids[k, WHICH], source[k, MUTE], source[k, LOUD]
        r, sx, sy = _echo(what, i, ids[k, OPENS], disc, circle.gain, best, mute, loud, things, ear)
        if r < 0.0:
            continue
        wall = i if what in (WALL, ROUGH_WALL) else NONE
        column = i if what == COLUMN else NONE
        if _reachable(disc, circle, sx, sy, wall, column, things, near, ids, k, room.lists[HIDDEN_BY]):
            best, kind = r, _kind(what, i, things.wedges)
    return best, kind
