"""The kernels of a ping: which echo comes first, for many pings fired from nearly one place.

The answer is defined ping by ping, and tests/envs/plain_pings.py says it so: go through every wall, wedge
and column near the disc, keep the nearest that is in the beam, loud enough and not hidden; where nothing is
heard, look again from the mirror images of the disc. Here the pings of one scan, whose discs all lie on a
small circle, share what is the same for all of them:

- a *view* is the circle, or its image in one or two mirrors, and the sources that any of its pings could
  hear, each with the window of headings and the ranges at which it could;
- from the circle itself, each source also knows the walls and columns that could hide it;
- walls stand in bins by bearing, for the rays of the fan that look for mirrors.

Views and bins only leave out what cannot answer, with a margin far wider than rounding, and keep the order.
What is left is decided by the same arithmetic as in the plain form: results agree to the last bit.

A scene travels as its arrays: walls (n, 5) x1 y1 x2 y2 roughness; wedges (k, 5) x y start opening kind;
cylinders (m, 3) x y radius.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sonar_explore.beam import S_RAD, Beam
from sonar_explore.compiled import inner_kernel

NOTHING, PLANE, CORNER, EDGE, CYLINDER, ROUGH = 0, 1, 2, 3, 4, 5
RIGHT_CORNER, CONVEX_EDGE = 1.0, 2.0  # kinds of wedge
GHOST = 10
"""Added to the kind of source, once per mirror, for an echo heard by way of mirrors."""

_NEAREST_M = 0.02  # nothing nearer is asked for
_WIDEST_RAD = math.radians(80.0)
_FAN_RAD = tuple(math.radians(d) for d in (0.0, -4.0, 4.0, -8.0, 8.0))  # of the AmigoBot's beam
_TOGETHER_M = 0.5  # discs in a box of this size share their views
_EPS_M = 1e-5  # margin of every test that leaves something out: rounding is a millionth of it
_BINS = 72
_NONE = np.int64(-1)  # a plain -1 would be compiled apart, as a constant
_CELLS = 4  # of 1 m, that a box of this size may touch
_VIEWS = 256
_LISTS = 11
_HIDING = 4096  # places for the lists of what could hide a source

# A beam as the kernels take it: S [rad], THRESHOLD and EDGE strength of `Beam`, COS and SQUARE [rad^2] of an angle
# beyond which nothing is heard, and how much wider than the AmigoBot's its FAN is.
_S, _THRESHOLD, _EDGE, _COS_WIDEST, _SQUARE_WIDEST, _FAN = range(6)

# A source in a view: BX BY mean bearing, COS of the widest angle off it, NEAREST range [m], and the squares of
# sine and tangent between which loudness must be computed: above MUTE none is heard, below LOUD all are.
_BX, _BY, _COS, _NEAREST, _MUTE, _LOUD = range(6)
# and WHAT it is, WHICH row of its array, whether a wedge surely opens to the view, and its lists of what could hide it.
_WHAT, _WHICH, _OPENS, _WALLS_FROM, _WALLS_TO, _COLUMNS_FROM, _COLUMNS_TO = range(7)
_WALL, _WEDGE, _COLUMN, _ROUGH_WALL = 0, 1, 2, 3


@inner_kernel
def cell_of(x, y, x0, y0, size, rows, columns):  # type: ignore[no-untyped-def]
    """Index cell that holds a point; -1 outside."""
    column = int(math.floor((x - x0) / size))
    row = int(math.floor((y - y0) / size))
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return -1
    return row * columns + column


# --- geometry of one path ---------------------------------------------------------------------------------


@inner_kernel
def _crossing(px, py, qx, qy, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Where p->q crosses a-b, as a share of p->q; -1 where it does not. The last micrometre does not count."""
    dx, dy = qx - px, qy - py
    ex, ey = bx - ax, by - ay
    denominator = dx * ey - dy * ex
    if denominator == 0.0:
        return -1.0
    u = ((ax - px) * ey - (ay - py) * ex) / denominator
    if u < 0.0 or u > 1.0:
        return -1.0
    v = ((ax - px) * dy - (ay - py) * dx) / denominator
    if v < 0.0 or v > 1.0:
        return -1.0
    return u


@inner_kernel
def _clear(px, py, qx, qy, walls, cylinders, near_walls, near_cylinders, skip_a, skip_b, skip_cylinder):  # type: ignore[no-untyped-def]
    """Whether nothing stands between p and q, but for the walls and the cylinder to skip."""
    length = math.hypot(qx - px, qy - py)
    if length < 2e-6:
        return True
    last = 1.0 - 1e-6 / length
    first = 1e-6 / length
    for i in near_walls:
        if i in (skip_a, skip_b):
            continue
        u = _crossing(px, py, qx, qy, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3])
        if first < u < last:
            return False
    for i in near_cylinders:
        if i == skip_cylinder:
            continue
        cx, cy, radius = cylinders[i, 0], cylinders[i, 1], cylinders[i, 2]
        u = ((cx - px) * (qx - px) + (cy - py) * (qy - py)) / (length * length)
        u = min(1.0, max(0.0, u))
        if math.hypot(px + u * (qx - px) - cx, py + u * (qy - py) - cy) < radius:
            return False
    return True


@inner_kernel
def _mirror(x, y, walls, i):  # type: ignore[no-untyped-def]
    """Image of a point in wall i's line."""
    ax, ay = walls[i, 0], walls[i, 1]
    ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
    t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    return 2.0 * (ax + t * ex) - x, 2.0 * (ay + t * ey) - y


@inner_kernel
def _mirrored_heading(heading, walls, i):  # type: ignore[no-untyped-def]
    """Heading of the image of a beam in wall i's line."""
    return 2.0 * math.atan2(walls[i, 3] - walls[i, 1], walls[i, 2] - walls[i, 0]) - heading


@inner_kernel
def _reachable(  # type: ignore[no-untyped-def]
    px, py, q1x, q1y, qx, qy, sx, sy, mirror_1, mirror_2, own_wall, own_cylinder, world, near, ids, k, hiding
):
    """Whether sound comes from p, by way of the view's mirrors, to the source s in row k and back."""
    walls, _, cylinders = world
    near_walls, _, near_cylinders = near
    tx, ty, skip, cylinder = sx, sy, own_wall, own_cylinder
    mirror, ix, iy = mirror_2, qx, qy
    if mirror_2 < 0:
        mirror = mirror_1
    while mirror >= 0:  # from the source backwards, from mirror to mirror
        u = _crossing(ix, iy, tx, ty, walls[mirror, 0], walls[mirror, 1], walls[mirror, 2], walls[mirror, 3])
        if u <= 0.0 or u >= 1.0:
            return False
        hx, hy = ix + u * (tx - ix), iy + u * (ty - iy)
        if not _clear(hx, hy, tx, ty, walls, cylinders, near_walls, near_cylinders, mirror, skip, cylinder):
            return False
        tx, ty, skip, cylinder = hx, hy, mirror, _NONE
        ix, iy = q1x, q1y
        mirror = mirror_1 if mirror == mirror_2 else _NONE
    if mirror_1 >= 0 or ids[k, _WALLS_FROM] < 0:
        return _clear(px, py, tx, ty, walls, cylinders, near_walls, near_cylinders, skip, _NONE, cylinder)
    if ids[k, _WALLS_FROM] == ids[k, _COLUMNS_TO]:
        return True
    hiding_walls = hiding[ids[k, _WALLS_FROM] : ids[k, _WALLS_TO]]
    hiding_columns = hiding[ids[k, _COLUMNS_FROM] : ids[k, _COLUMNS_TO]]
    return _clear(px, py, tx, ty, walls, cylinders, hiding_walls, hiding_columns, skip, _NONE, cylinder)


# --- views ------------------------------------------------------------------------------------------------


@inner_kernel
def _may_cross(cx, cy, sx, sy, slack, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """False only where no path between points within `slack` of c and of s meets the wall a-b."""
    dx, dy = sx - cx, sy - cy
    a = dx * (ay - cy) - dy * (ax - cx)
    b = dx * (by - cy) - dy * (bx - cx)
    if a * b > 0.0 and min(a * a, b * b) > slack * slack * (dx * dx + dy * dy):
        return False
    ex, ey = bx - ax, by - ay
    c = ex * (cy - ay) - ey * (cx - ax)
    s = ex * (sy - ay) - ey * (sx - ax)
    return not (c * s > 0.0 and min(c * c, s * s) > slack * slack * (ex * ex + ey * ey))


@inner_kernel
def _must_cross(cx, cy, sx, sy, slack, more, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """True only where every path between points within `slack` of c and `more` of s crosses the wall a-b."""
    dx, dy = sx - cx, sy - cy
    reach = more * math.sqrt(dx * dx + dy * dy)
    a = dx * (ay - cy) - dy * (ax - cx)
    b = dx * (by - cy) - dy * (bx - cx)
    if not ((a > reach and b < -reach) or (a < -reach and b > reach)):
        return False
    ex, ey = bx - ax, by - ay
    length = math.sqrt(ex * ex + ey * ey)
    c = ex * (cy - ay) - ey * (cx - ax)
    s = ex * (sy - ay) - ey * (sx - ax)
    near, far = slack * length, more * length
    return (c > near and s < -far) or (c < -near and s > far)


@inner_kernel
def _through(vx, vy, sx, sy, slack, mirror_1, mirror_2, walls):  # type: ignore[no-untyped-def]
    """False only where no path from a view within `slack` of v to one within `slack` of s meets its mirrors."""
    if mirror_1 < 0:
        return True
    w = mirror_1 if mirror_2 < 0 else mirror_2
    if not _may_cross(vx, vy, sx, sy, slack, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]):
        return False
    if mirror_2 < 0:
        return True
    ax, ay = _mirror(walls[mirror_1, 0], walls[mirror_1, 1], walls, mirror_2)
    bx, by = _mirror(walls[mirror_1, 2], walls[mirror_1, 3], walls, mirror_2)
    return _may_cross(vx, vy, sx, sy, slack, ax, ay, bx, by)


@inner_kernel
def _amplitude(what, r, gain, i, wedges, cylinders, beam):  # type: ignore[no-untyped-def]
    """On the axis, of a plane, a wedge or a column at range r."""
    if what == _WEDGE and wedges[i, 4] != RIGHT_CORNER:
        return gain * beam[_EDGE] * r**-1.5
    if what == _COLUMN:
        radius = cylinders[i, 2]
        return gain / r * math.sqrt(radius / (radius + r))
    return gain / r


@inner_kernel
def _put(source, place, what, i, dx, dy, off, spread, rho, gain, range_max, wedges, cylinders, beam):  # type: ignore[no-untyped-def]
    """Fill in a source seen at (dx, dy) from the middle of a view; False where no ping of the view can hear it.

    `off` is what its range is shorter than that distance, `spread` how far the bearing's vector may be off, both [m].
    """
    distance = math.sqrt(dx * dx + dy * dy)
    nearest = max(distance - off - rho, 1e-6)
    if nearest >= range_max:
        return False
    loudest = _amplitude(what, nearest, gain, i, wedges, cylinders, beam)
    if loudest < beam[_THRESHOLD] * (1.0 - 1e-9):
        return False
    least = _amplitude(
        what, distance + rho, gain, i, wedges, cylinders, beam
    )  # farther than any: the softest it can be
    mute = beam[_S] * beam[_S] * math.log(loudest / beam[_THRESHOLD]) * (1.0 + 1e-9) + 1e-9
    source[place, _MUTE] = mute
    source[place, _LOUD] = beam[_S] * beam[_S] * math.log(least / beam[_THRESHOLD]) * (1.0 - 1e-9) - 1e-9
    source[place, _NEAREST] = nearest
    if distance <= 2.0 * rho + spread + _EPS_M:
        source[place, _BX], source[place, _BY], source[place, _COS] = 1.0, 0.0, -2.0
    else:
        half = math.sqrt(min(mute, beam[_SQUARE_WIDEST])) + 1e-6
        k = spread / distance
        source[place, _BX], source[place, _BY] = dx / distance, dy / distance
        source[place, _COS] = (1.0 - 0.5 * half * half) * math.sqrt(1.0 - k * k) - half * k - 1e-9
    return True


@inner_kernel
def _opens(wedges, i, dx, dy, rho):  # type: ignore[no-untyped-def]
    """Whether wedge i at (dx, dy) opens to all of a circle of radius rho (1), to none of it (-1), or to some (0)."""
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= 2.0 * rho + _EPS_M:
        return 0
    turn = 1.1 * rho / distance + 1e-6  # more than asin(rho / distance) up to a half
    inside = (math.atan2(-dy, -dx) - wedges[i, 2]) % (2.0 * math.pi)
    if turn < inside < wedges[i, 3] - turn:
        return 1
    if wedges[i, 3] + turn < inside < 2.0 * math.pi - turn:
        return -1
    return 0


@inner_kernel
def _view(vx, vy, rho, gain, mirror_1, mirror_2, range_max, world, near, source, ids, n, beam):  # type: ignore[no-untyped-def]
    """The sources that a ping from within rho of v may hear by way of the mirrors, from row n on: how many in all."""
    walls, wedges, cylinders = world
    near_walls, near_wedges, near_cylinders = near
    last_mirror = mirror_2 if mirror_2 >= 0 else mirror_1
    slack = rho + _EPS_M
    edge_reach = min(range_max, (gain * beam[_EDGE] / beam[_THRESHOLD]) ** (2.0 / 3.0)) + slack
    for i in near_walls:
        if i == last_mirror:
            continue
        if walls[i, 4] > 0.0:  # heard at any angle
            for what in (_WALL, _ROUGH_WALL):
                ids[n, _WHAT], ids[n, _WHICH], ids[n, _OPENS] = what, i, 0
                source[n, _BX], source[n, _BY], source[n, _COS] = 1.0, 0.0, -2.0
                source[n, _NEAREST], source[n, _MUTE], source[n, _LOUD] = 0.0, 1e9, -1.0
                n += 1
            continue
        ids[n, _WHAT], ids[n, _WHICH], ids[n, _OPENS] = _WALL, i, 0
        ax, ay = walls[i, 0], walls[i, 1]
        ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
        squared = ex * ex + ey * ey
        dot = (vx - ax) * ex + (vy - ay) * ey
        beyond = slack * math.sqrt(squared)
        if dot < -beyond or dot > squared + beyond:
            continue
        t = dot / squared
        sx, sy = ax + t * ex, ay + t * ey
        if _through(vx, vy, sx, sy, slack, mirror_1, mirror_2, walls) and _put(
            source, n, _WALL, i, sx - vx, sy - vy, 0.0, 1e-6, slack, gain, range_max, wedges, cylinders, beam
        ):
            n += 1
    for i in near_wedges:
        dx, dy = wedges[i, 0] - vx, wedges[i, 1] - vy
        reach = range_max + slack if wedges[i, 4] == RIGHT_CORNER else edge_reach
        if dx * dx + dy * dy > reach * reach:
            continue
        if not _through(vx, vy, wedges[i, 0], wedges[i, 1], slack, mirror_1, mirror_2, walls):
            continue
        if not _put(
            source, n, _WEDGE, i, dx, dy, 0.0, slack, slack, gain, range_max, wedges, cylinders, beam
        ):
            continue
        opens = _opens(wedges, i, dx, dy, slack)
        if opens >= 0:
            ids[n, _WHAT], ids[n, _WHICH], ids[n, _OPENS] = _WEDGE, i, opens
            n += 1
    for i in near_cylinders:
        ids[n, _WHAT], ids[n, _WHICH], ids[n, _OPENS] = _COLUMN, i, 0
        cx, cy, radius = cylinders[i, 0], cylinders[i, 1], cylinders[i, 2]
        if _through(vx, vy, cx, cy, slack, mirror_1, mirror_2, walls) and _put(
            source,
            n,
            _COLUMN,
            i,
            cx - vx,
            cy - vy,
            radius,
            slack,
            slack,
            gain,
            range_max,
            wedges,
            cylinders,
            beam,
        ):
            n += 1
    return n


@inner_kernel
def _hidden_by(vx, vy, rho, world, near, source, ids, n, hiding):  # type: ignore[no-untyped-def]
    """List for each of n sources what could hide it from the circle; drop those hidden for good: how many stay."""
    walls, wedges, cylinders = world
    near_walls, _, near_cylinders = near
    slack, used, kept = rho + _EPS_M, 0, 0
    for k in range(n):
        what, i = ids[k, _WHAT], ids[k, _WHICH]
        own, thick = -1, 0.0
        if what in (_WALL, _ROUGH_WALL):
            own = i
            ax, ay = walls[i, 0], walls[i, 1]
            ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
            t = ((vx - ax) * ex + (vy - ay) * ey) / (ex * ex + ey * ey)
            sx, sy = ax + t * ex, ay + t * ey
        elif what == _WEDGE:
            sx, sy = wedges[i, 0], wedges[i, 1]
        else:
            sx, sy, thick = cylinders[i, 0], cylinders[i, 1], cylinders[i, 2]
        start, hidden, listed = used, False, what != _ROUGH_WALL and (what != _WALL or walls[i, 4] == 0.0)
        if listed:
            for j in near_walls:
                if j == own:
                    continue
                ax, ay, bx, by = walls[j, 0], walls[j, 1], walls[j, 2], walls[j, 3]
                if not _may_cross(vx, vy, sx, sy, slack, ax, ay, bx, by):
                    continue
                if _must_cross(vx, vy, sx, sy, slack, slack + thick, ax, ay, bx, by):
                    hidden = True
                    break
                if used == len(hiding):
                    listed = False
                    break
                hiding[used] = j
                used += 1
        if hidden:
            used = start
            continue
        middle = used
        if listed:
            dx, dy = sx - vx, sy - vy
            squared = max(dx * dx + dy * dy, 1e-12)
            for j in near_cylinders:
                if what == _COLUMN and j == i:
                    continue
                mx, my = cylinders[j, 0] - vx, cylinders[j, 1] - vy
                u = min(1.0, max(0.0, (mx * dx + my * dy) / squared))
                ox, oy = mx - u * dx, my - u * dy
                if ox * ox + oy * oy > (cylinders[j, 2] + slack) ** 2:
                    continue
                if used == len(hiding):
                    listed = False
                    break
                hiding[used] = j
                used += 1
        if not listed:
            start, middle, used = -1, -1, start
        for column in range(_LOUD + 1):
            source[kept, column] = source[k, column]
        ids[kept, _WHAT], ids[kept, _WHICH], ids[kept, _OPENS] = what, i, ids[k, _OPENS]
        ids[kept, _WALLS_FROM], ids[kept, _WALLS_TO] = start, middle
        ids[kept, _COLUMNS_FROM], ids[kept, _COLUMNS_TO] = middle, used
        kept += 1
    return kept


# --- one ping ---------------------------------------------------------------------------------------------


@inner_kernel
def _heard(on_axis, along, across, mute, loud, beam):  # type: ignore[no-untyped-def]
    """Whether a source with this amplitude on the axis is above the threshold where it lies.

    sin^2 <= theta^2 <= tan^2: where either already tells, no angle is computed.
    """
    aa, cc = across * across, along * along
    if aa > mute * (aa + cc):
        return False
    if aa < loud * cc:
        return True
    theta = math.atan2(across, along)
    return on_axis * math.exp(-(theta * theta) / (beam[_S] * beam[_S])) >= beam[_THRESHOLD]


@inner_kernel
def _echo(what, i, opens, qx, qy, c, s, gain, best, mute, loud, walls, wedges, cylinders, beam):  # type: ignore[no-untyped-def]
    """Range [m] at which q hears source i in a beam along (c, s), -1 where not or not nearer than `best`; its place."""
    sx, sy, r, along, on_axis = 0.0, 0.0, -1.0, 0.0, 0.0
    if what == _WALL:
        ax, ay = walls[i, 0], walls[i, 1]
        ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
        t = ((qx - ax) * ex + (qy - ay) * ey) / (ex * ex + ey * ey)
        if t < 0.0 or t > 1.0:
            return -1.0, sx, sy
        sx, sy = ax + t * ex, ay + t * ey
        dx, dy = sx - qx, sy - qy
        r = math.hypot(dx, dy)
        along = c * dx + s * dy
        if r <= 1e-6 or r >= best or along < beam[_COS_WIDEST] * r:
            return -1.0, sx, sy
        on_axis = gain / r
    elif what == _ROUGH_WALL:
        ax, ay, bx, by = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
        r = _crossing(qx, qy, qx + best * c, qy + best * s, ax, ay, bx, by) * best
        if r <= 1e-6:
            return -1.0, sx, sy
        ex, ey = bx - ax, by - ay
        cos_incidence = abs(c * ey - s * ex) / math.hypot(ex, ey)
        loud_enough = gain * walls[i, 4] * cos_incidence / r >= beam[_THRESHOLD]
        return r if loud_enough else -1.0, qx + r * c, qy + r * s
    elif what == _WEDGE:
        sx, sy = wedges[i, 0], wedges[i, 1]
        dx, dy = sx - qx, sy - qy
        r = math.hypot(dx, dy)
        along = c * dx + s * dy
        if r < 1e-6 or r >= best or along < beam[_COS_WIDEST] * r:
            return -1.0, sx, sy
        if opens == 0 and (math.atan2(-dy, -dx) - wedges[i, 2]) % (2.0 * math.pi) > wedges[i, 3]:
            return -1.0, sx, sy
        on_axis = _amplitude(what, r, gain, i, wedges, cylinders, beam)
    else:
        dx, dy = cylinders[i, 0] - qx, cylinders[i, 1] - qy
        centre = math.hypot(dx, dy)
        r = centre - cylinders[i, 2]
        along = c * dx + s * dy
        if r < 1e-6 or r >= best or along < beam[_COS_WIDEST] * centre:
            return -1.0, sx, sy
        sx, sy = qx + dx * r / centre, qy + dy * r / centre
        on_axis = _amplitude(what, r, gain, i, wedges, cylinders, beam)
    return r if _heard(on_axis, along, c * dy - s * dx, mute, loud, beam) else -1.0, sx, sy


@inner_kernel
def _kind(what, i, wedges):  # type: ignore[no-untyped-def]
    if what == _WEDGE:
        return CORNER if wedges[i, 4] == RIGHT_CORNER else EDGE
    if what == _WALL:
        return PLANE
    return ROUGH if what == _ROUGH_WALL else CYLINDER


@inner_kernel
def _nearest_source(  # type: ignore[no-untyped-def]
    px,
    py,
    q1x,
    q1y,
    qx,
    qy,
    heading,
    gain,
    mirror_1,
    mirror_2,
    range_max,
    world,
    near,
    source,
    ids,
    first,
    last,
    hiding,
    beam,
):
    """Nearest of a view's sources above the threshold as seen from q, the sonar p or its image: range [m] and kind.

    With two mirrors q1 is the image in the first.
    """
    walls, wedges, cylinders = world
    best, kind = range_max, NOTHING
    c, s = math.cos(heading), math.sin(heading)
    for k in range(first, last):
        if c * source[k, _BX] + s * source[k, _BY] < source[k, _COS] or source[k, _NEAREST] >= best:
            continue
        what, i = ids[k, _WHAT], ids[k, _WHICH]
        r, sx, sy = _echo(
            what,
            i,
            ids[k, _OPENS],
            qx,
            qy,
            c,
            s,
            gain,
            best,
            source[k, _MUTE],
            source[k, _LOUD],
            walls,
            wedges,
            cylinders,
            beam,
        )
        if r < 0.0:
            continue
        wall = i if what in (_WALL, _ROUGH_WALL) else _NONE
        column = i if what == _COLUMN else _NONE
        if _reachable(
            px, py, q1x, q1y, qx, qy, sx, sy, mirror_1, mirror_2, wall, column, world, near, ids, k, hiding
        ):
            best, kind = r, _kind(what, i, wedges)
    return best, kind


# --- mirrors ----------------------------------------------------------------------------------------------


@inner_kernel
def _bins(vx, vy, rho, range_max, walls, near_walls, lows, counts, first, filled, items):  # type: ignore[no-untyped-def]
    """Walls by the bearings under which a ray from the circle may meet them: first and items, ascending in a bin."""
    width, slack = 2.0 * math.pi / _BINS, rho + _EPS_M
    for j in range(_BINS + 1):
        first[j] = 0
    for k in range(len(near_walls)):
        i = near_walls[k]
        ax, ay, bx, by = walls[i, 0] - vx, walls[i, 1] - vy, walls[i, 2] - vx, walls[i, 3] - vy
        ex, ey = bx - ax, by - ay
        t = min(1.0, max(0.0, -(ax * ex + ay * ey) / (ex * ex + ey * ey)))
        nearest = math.sqrt((ax + t * ex) ** 2 + (ay + t * ey) ** 2)
        lows[k], counts[k] = 0, _BINS
        if nearest > range_max + slack:
            counts[k] = 0
        elif nearest > slack:
            a, b = math.atan2(ay, ax), math.atan2(by, bx)
            more_a = math.asin(min(1.0, slack / math.sqrt(ax * ax + ay * ay)))
            more_b = math.asin(min(1.0, slack / math.sqrt(bx * bx + by * by)))
            if ax * by - ay * bx < 0.0:
                a, b, more_a, more_b = b, a, more_b, more_a
            if b < a:
                b += 2.0 * math.pi
            low = int(math.floor((a - more_a) / width - 1e-6))
            high = int(math.floor((b + more_b) / width + 1e-6))
            if high - low + 1 < _BINS:
                lows[k], counts[k] = low, high - low + 1
        for j in range(counts[k]):
            first[(lows[k] + j) % _BINS + 1] += 1
    for j in range(_BINS):
        first[j + 1] += first[j]
        filled[j] = first[j]
    for k in range(len(near_walls)):
        for j in range(counts[k]):
            cell = (lows[k] + j) % _BINS
            items[filled[cell]] = near_walls[k]
            filled[cell] += 1


@inner_kernel
def _first_hit(px, py, qx, qy, walls, items, first, last, skip):  # type: ignore[no-untyped-def]
    """The nearest wall on the ray p->q: its index, -1 where none, and where, as a share of the ray."""
    best, hit = 2.0, -1
    for k in range(first, last):
        i = items[k]
        if i == skip:
            continue
        u = _crossing(px, py, qx, qy, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3])
        if 1e-9 < u < best:
            best, hit = u, i
    return hit, best


# --- all pings --------------------------------------------------------------------------------------------


@inner_kernel
def _near(cells, n_cells, first, items, near, spare):  # type: ignore[no-untyped-def]
    """What is near any of these cells, rising, into `near`: how many."""
    n = 0
    for cell in cells[:n_cells]:
        for k in range(n):
            spare[k] = near[k]
        i, j, had, n = 0, first[cell], n, 0
        while i < had or j < first[cell + 1]:
            if j == first[cell + 1] or (i < had and spare[i] < items[j]):
                near[n] = spare[i]
                i += 1
            else:
                if i < had and spare[i] == items[j]:
                    i += 1
                near[n] = items[j]
                j += 1
            n += 1
    return n


@inner_kernel
def _together(discs, start, frame, cells):  # type: ignore[no-untyped-def]
    """The discs from `start` on that lie together: where they end, their circle, the number of cells."""
    low_x, low_y, high_x, high_y = discs[start, 0], discs[start, 1], discs[start, 0], discs[start, 1]
    n, stop = 0, start
    while stop < len(discs):
        x, y = discs[stop, 0], discs[stop, 1]
        x0, y0, x1, y1 = min(low_x, x), min(low_y, y), max(high_x, x), max(high_y, y)
        if x1 - x0 > _TOGETHER_M or y1 - y0 > _TOGETHER_M:
            break
        low_x, low_y, high_x, high_y = x0, y0, x1, y1
        cell = cell_of(x, y, frame[0], frame[1], frame[2], int(frame[3]), int(frame[4]))
        known = cell < 0
        for k in range(n):
            known = known or cells[k] == cell
        if not known:
            cells[n] = cell
            n += 1
        stop += 1
    vx, vy, rho = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y), 0.0
    for k in range(start, stop):
        rho = max(rho, (discs[k, 0] - vx) ** 2 + (discs[k, 1] - vy) ** 2)
    return stop, vx, vy, math.sqrt(rho), n


@inner_kernel
def fire_all(  # type: ignore[no-untyped-def]
    discs,
    walls,
    wedges,
    cylinders,
    wall_first,
    wall_items,
    wedge_first,
    wedge_items,
    cylinder_first,
    cylinder_items,
    frame,
    source,
    ids,
    lists,
    mirrors,
    loss,
    range_max,
    beam,
    ranges,
    kinds,
):
    """First echo of each disc (x, y, heading), into `ranges` and `kinds`; `source`, `ids` and `lists` are scratch."""
    hiding, cells, views = lists[0], lists[1], lists[2]
    world = (walls, wedges, cylinders)
    stop = 0
    while stop < len(discs):
        start = stop
        stop, vx, vy, rho, n_cells = _together(discs, start, frame, cells)
        for n in range(start, stop):
            ranges[n], kinds[n] = range_max, NOTHING
        if n_cells == 0:
            continue
        near_walls = lists[3, : _near(cells, n_cells, wall_first, wall_items, lists[3], lists[6])]
        near_wedges = lists[4, : _near(cells, n_cells, wedge_first, wedge_items, lists[4], lists[6])]
        near_cylinders = lists[5, : _near(cells, n_cells, cylinder_first, cylinder_items, lists[5], lists[6])]
        near = (near_walls, near_wedges, near_cylinders)
        seen = _view(vx, vy, rho, 1.0, _NONE, _NONE, range_max, world, near, source, ids, 0, beam)
        if stop - start > 3:  # for few pings the lists do not pay
            seen = _hidden_by(vx, vy, rho, world, near, source, ids, seen, hiding)
        else:
            for k in range(seen):
                ids[k, _WALLS_FROM] = -1
        silent = 0
        for n in range(start, stop):
            px, py, heading = discs[n, 0], discs[n, 1], discs[n, 2]
            if cell_of(px, py, frame[0], frame[1], frame[2], int(frame[3]), int(frame[4])) < 0:
                continue
            r, k = _nearest_source(
                px,
                py,
                px,
                py,
                px,
                py,
                heading,
                1.0,
                _NONE,
                _NONE,
                range_max,
                world,
                near,
                source,
                ids,
                0,
                seen,
                hiding,
                beam,
            )
            ranges[n], kinds[n] = r, k
            silent += k == NOTHING
        if silent and mirrors > 0:
            _ghosts(
                discs,
                start,
                stop,
                vx,
                vy,
                rho,
                mirrors,
                loss,
                range_max,
                world,
                near,
                wall_first,
                wall_items,
                frame,
                source,
                ids,
                lists,
                views,
                beam,
                ranges,
                kinds,
            )


@inner_kernel
def _ghosts(  # type: ignore[no-untyped-def]
    discs,
    start,
    stop,
    vx,
    vy,
    rho,
    mirrors,
    loss,
    range_max,
    world,
    near,
    wall_first,
    wall_items,
    frame,
    source,
    ids,
    lists,
    views,
    beam,
    ranges,
    kinds,
):
    """For each silent disc the nearest source heard by way of the walls that a fan of rays in its beam meets."""
    walls, near_walls = world[0], near[0]
    hiding, bin_first, bin_items = lists[0], lists[7], lists[8]
    binned = stop - start > 3
    if binned:
        _bins(vx, vy, rho, range_max, walls, near_walls, lists[9], lists[10], bin_first, lists[6], bin_items)
    room = 2 * len(near[0]) + len(near[1]) + len(near[2]) + 1
    known = 0
    for n in range(start, stop):
        px, py, heading = discs[n, 0], discs[n, 1], discs[n, 2]
        cell = cell_of(px, py, frame[0], frame[1], frame[2], int(frame[3]), int(frame[4]))
        if kinds[n] != NOTHING or cell < 0:
            continue
        best, kind = range_max, NOTHING
        seen_1, seen_2 = -1, -1
        for offset in _FAN_RAD:
            bearing = heading + beam[_FAN] * offset
            c, s = math.cos(bearing), math.sin(bearing)
            if binned:
                b = int(math.floor(bearing / (2.0 * math.pi / _BINS))) % _BINS
                w1, u = _first_hit(
                    px,
                    py,
                    px + range_max * c,
                    py + range_max * s,
                    walls,
                    bin_items,
                    bin_first[b],
                    bin_first[b + 1],
                    _NONE,
                )
            else:
                w1, u = _first_hit(
                    px,
                    py,
                    px + range_max * c,
                    py + range_max * s,
                    walls,
                    near_walls,
                    0,
                    len(near_walls),
                    _NONE,
                )
            if w1 < 0 or w1 in (seen_1, seen_2):
                continue
            seen_2 = seen_1
            seen_1 = w1
            hx, hy = px + u * range_max * c, py + u * range_max * s
            w2 = _NONE
            for mirror_count in range(1, 1 + min(mirrors, 2)):
                if mirror_count == 2:
                    if kind != NOTHING:
                        break
                    ray = _mirrored_heading(bearing, walls, w1)
                    rx, ry = hx + range_max * math.cos(ray), hy + range_max * math.sin(ray)
                    w2, u = _first_hit(
                        hx, hy, rx, ry, walls, wall_items, wall_first[cell], wall_first[cell + 1], w1
                    )
                    if w2 < 0:
                        break
                view, known = _view_by(
                    w1, w2, vx, vy, rho, loss, range_max, world, near, source, ids, views, known, room, beam
                )
                first, last = views[view + 2], views[view + 3]
                if first == last:
                    continue
                h = _mirrored_heading(heading, walls, w1)
                q1x, q1y = _mirror(px, py, walls, w1)
                qx, qy, gain = q1x, q1y, loss**2
                if mirror_count == 2:
                    h = _mirrored_heading(h, walls, w2)
                    qx, qy = _mirror(q1x, q1y, walls, w2)
                    gain = loss**4
                r, k = _nearest_source(
                    px,
                    py,
                    q1x,
                    q1y,
                    qx,
                    qy,
                    h,
                    gain,
                    w1,
                    w2,
                    best,
                    world,
                    near,
                    source,
                    ids,
                    first,
                    last,
                    hiding,
                    beam,
                )
                if k != NOTHING:
                    best, kind = r, k + mirror_count * GHOST
        ranges[n], kinds[n] = best, kind


@inner_kernel
def _view_by(w1, w2, vx, vy, rho, loss, range_max, world, near, source, ids, views, known, room, beam):  # type: ignore[no-untyped-def]
    """The view by way of these mirrors, made at its first use: where it stands in `views`, and how many stand there.

    Four numbers each: the mirrors, the first source, the end.
    """
    walls = world[0]
    for k in range(known):
        if views[4 * k] == w1 and views[4 * k + 1] == w2:
            return 4 * k, known
    first = views[4 * known - 1] if known else 0
    if 4 * known + 4 > _VIEWS or first + room > len(source):
        known, first = 0, 0
    qx, qy = _mirror(vx, vy, walls, w1)
    gain = loss * loss
    if w2 >= 0:
        qx, qy = _mirror(qx, qy, walls, w2)
        gain *= gain
    last = _view(qx, qy, rho, gain, w1, w2, range_max, world, near, source, ids, first, beam)
    k = 4 * known
    views[k], views[k + 1], views[k + 2], views[k + 3] = w1, w2, first, last
    return k, known + 1


@inner_kernel
def turned_discs(x, y, headings, mount_x, mount_y, mount_heading, discs):  # type: ignore[no-untyped-def]
    """Poses of a disc mounted on a body at (x, y) with these headings, into `discs`, shape (n, 3)."""
    for n in range(len(headings)):
        c, s = math.cos(headings[n]), math.sin(headings[n])
        discs[n, 0] = x + c * mount_x - s * mount_y
        discs[n, 1] = y + s * mount_x + c * mount_y
        discs[n, 2] = headings[n] + mount_heading


def beam_numbers(beam: Beam) -> tuple[float, ...]:
    """A beam as the kernels take it."""
    widest = min(_WIDEST_RAD, max(math.radians(20.0), beam.half_angle_rad(1.0 / _NEAREST_M)))
    fan = beam.s_rad / S_RAD
    return beam.s_rad, beam.threshold, beam.edge_strength, math.cos(widest), widest**2, fan


def scratch(counts: Sequence[int], busiest: Sequence[int]) -> tuple[Any, ...]:
    """Room to work in, given how many walls, wedges and columns there are, and how many at most near one cell."""
    near = [min(count, _CELLS * most) for count, most in zip(counts, busiest, strict=True)]
    rows = 4 * (2 * near[0] + near[1] + near[2]) + 64
    longest = max(_HIDING, _VIEWS, _BINS * near[0], *near)
    return (
        np.empty((rows, 6)),
        np.empty((rows, 7), dtype=np.int64),
        np.empty((_LISTS, longest), dtype=np.int64),
    )
