# mypy: ignore-errors
# ruff: noqa: SIM109
"""What `sonar_explore.envs.pings` must equal to the last bit: every ping by itself, with nothing left out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sonar_explore.beam import EDGE_STRENGTH, S_RAD, THRESHOLD
from sonar_explore.compiled import kernel
from sonar_explore.envs.pings import CORNER, CYLINDER, EDGE, GHOST, NOTHING, PLANE, RIGHT_CORNER, ROUGH
from sonar_explore.geometry import Array

_COS_WIDEST = math.cos(math.radians(20.0))
_FAN_RAD = tuple(math.radians(d) for d in (0.0, -4.0, 4.0, -8.0, 8.0))
_NONE = np.int64(-1)  # a plain -1 would be compiled apart, as a constant


class Near(NamedTuple):
    """The world, and which rows of its arrays lie near the disc."""

    walls: Array
    wedges: Array
    cylinders: Array
    wall_rows: Array
    wedge_rows: Array
    cylinder_rows: Array


class Way(NamedTuple):
    """The disc, its images in the first mirror and in the last, and which walls the mirrors are."""

    px: float
    py: float
    q1x: float
    q1y: float
    qx: float
    qy: float
    mirror_1: int
    mirror_2: int


def plain_echoes(scene, discs, physics):
    """As `sonar_explore.envs.acoustics.echoes`."""
    ranges = np.empty(len(discs))
    kinds = np.empty(len(discs), dtype=np.int64)
    mirrors = (physics.ghost_order - 1, physics.bounce_loss, physics.range_max_m)
    _fire_all(discs, scene.things, scene.index, *mirrors, ranges, kinds)
    return ranges, kinds


@kernel
def _fire_all(discs, things, index, mirrors, loss, range_max, ranges, kinds):
    """First echo of each disc, into `ranges` and `kinds`."""
    for n in range(len(discs)):
        px, py, heading = discs[n, 0], discs[n, 1], discs[n, 2]
        ranges[n] = range_max
        kinds[n] = NOTHING
        cell = _cell(px, py, index.frame)
        if cell < 0:
            continue
        near = Near(
            things.walls,
            things.wedges,
            things.cylinders,
            index.wall_items[index.wall_first[cell] : index.wall_first[cell + 1]],
            index.wedge_items[index.wedge_first[cell] : index.wedge_first[cell + 1]],
            index.cylinder_items[index.cylinder_first[cell] : index.cylinder_first[cell + 1]],
        )
        r, k = _nearest_source(Way(px, py, px, py, px, py, _NONE, _NONE), heading, 1.0, range_max, near)
        if k == NOTHING and mirrors > 0:
            r, k = _ghost(px, py, heading, mirrors, loss, range_max, near)
        ranges[n] = r
        kinds[n] = k


@kernel
def _cell(x, y, frame):
    """Index cell that holds a point; -1 outside."""
    x0, y0, size, rows, columns = frame[0], frame[1], frame[2], int(frame[3]), int(frame[4])
    column = int(math.floor((x - x0) / size))
    row = int(math.floor((y - y0) / size))
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return -1
    return row * columns + column


@kernel
def _ghost(px, py, heading, mirrors, loss, range_max, near):
    """Nearest source heard by way of the walls that a fan of rays inside the beam meets."""
    walls = near.walls
    best, kind = range_max, NOTHING
    seen_1 = -1
    seen_2 = -1
    for offset in _FAN_RAD:
        w1 = _first_hit(px, py, heading + offset, range_max, near, -1)
        if w1 < 0 or w1 == seen_1 or w1 == seen_2:
            continue
        seen_2 = seen_1
        seen_1 = w1
        q1x, q1y = _mirror(px, py, walls, w1)
        h1 = _mirrored_heading(heading, walls, w1)
        r, k = _nearest_source(Way(px, py, q1x, q1y, q1x, q1y, w1, _NONE), h1, loss**2, best, near)
        if k != NOTHING:
            best, kind = r, k + GHOST
        if mirrors < 2 or kind != NOTHING:
            continue
        ray = _mirrored_heading(heading + offset, walls, w1)
        dx, dy = range_max * math.cos(heading + offset), range_max * math.sin(heading + offset)
        u = _crossing_wall(px, py, px + dx, py + dy, walls, w1)
        hx = px + u * range_max * math.cos(heading + offset)
        hy = py + u * range_max * math.sin(heading + offset)
        w2 = _first_hit(hx, hy, ray, range_max, near, w1)
        if w2 < 0:
            continue
        q2x, q2y = _mirror(q1x, q1y, walls, w2)
        h2 = _mirrored_heading(h1, walls, w2)
        r, k = _nearest_source(Way(px, py, q1x, q1y, q2x, q2y, w1, w2), h2, loss**4, best, near)
        if k != NOTHING:
            best, kind = r, k + 2 * GHOST
    return best, kind


@kernel
def _nearest_source(way, heading, gain, range_max, near):
    """Nearest source above the threshold as seen from the disc's last image: range [m] and kind."""
    best, kind = _nearest_wall(way, heading, gain, range_max, near)
    best, kind = _nearest_wedge(way, heading, gain, best, kind, near)
    return _nearest_cylinder(way, heading, gain, best, kind, near)


@kernel
def _nearest_wall(way, heading, gain, range_max, near):
    """The nearest plane or rough wall that is nearer than `range_max`."""
    qx, qy, walls = way.qx, way.qy, near.walls
    c, s = math.cos(heading), math.sin(heading)
    best, kind = range_max, NOTHING
    last_mirror = way.mirror_2 if way.mirror_2 >= 0 else way.mirror_1
    for i in near.wall_rows:
        if i == last_mirror:
            continue
        ax, ay = walls[i, 0], walls[i, 1]
        ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
        t = ((qx - ax) * ex + (qy - ay) * ey) / (ex * ex + ey * ey)
        if 0.0 <= t <= 1.0:
            fx, fy = ax + t * ex, ay + t * ey
            dx, dy = fx - qx, fy - qy
            r = math.hypot(dx, dy)
            along = c * dx + s * dy
            if (
                1e-6 <= r < best
                and along >= _COS_WIDEST * r
                and _heard(gain / r, along, c * dy - s * dx)
                and _reachable(way, fx, fy, i, -1, near)
            ):
                best, kind = r, PLANE
        if walls[i, 4] > 0.0:
            u = _crossing_wall(qx, qy, qx + best * c, qy + best * s, walls, i)
            r = u * best
            if r > 1e-6:
                cos_incidence = abs(c * ey - s * ex) / math.hypot(ex, ey)
                on_axis = gain * walls[i, 4] * cos_incidence / r
                if on_axis >= THRESHOLD and _reachable(way, qx + r * c, qy + r * s, i, -1, near):
                    best, kind = r, ROUGH
    return best, kind


@kernel
def _nearest_wedge(way, heading, gain, best, kind, near):
    """The nearest corner or edge that is nearer than the best so far."""
    qx, qy, wedges = way.qx, way.qy, near.wedges
    c, s = math.cos(heading), math.sin(heading)
    for i in near.wedge_rows:
        x, y = wedges[i, 0], wedges[i, 1]
        dx, dy = x - qx, y - qy
        r = math.hypot(dx, dy)
        along = c * dx + s * dy
        if r < 1e-6 or r >= best or along < _COS_WIDEST * r:
            continue
        inside = (math.atan2(-dy, -dx) - wedges[i, 2]) % (2.0 * math.pi)
        if inside > wedges[i, 3]:
            continue
        corner = wedges[i, 4] == RIGHT_CORNER
        on_axis = gain / r if corner else gain * EDGE_STRENGTH * r**-1.5
        if _heard(on_axis, along, c * dy - s * dx) and _reachable(way, x, y, -1, -1, near):
            best, kind = r, CORNER if corner else EDGE
    return best, kind


@kernel
def _nearest_cylinder(way, heading, gain, best, kind, near):
    """The nearest column that is nearer than the best so far."""
    qx, qy, cylinders = way.qx, way.qy, near.cylinders
    c, s = math.cos(heading), math.sin(heading)
    for i in near.cylinder_rows:
        dx, dy = cylinders[i, 0] - qx, cylinders[i, 1] - qy
        radius = cylinders[i, 2]
        centre = math.hypot(dx, dy)
        r = centre - radius
        along = c * dx + s * dy
        if r < 1e-6 or r >= best or along < _COS_WIDEST * centre:
            continue
        sx, sy = qx + dx * r / centre, qy + dy * r / centre
        on_axis = gain / r * math.sqrt(radius / (radius + r))
        if _heard(on_axis, along, c * dy - s * dx) and _reachable(way, sx, sy, -1, i, near):
            best, kind = r, CYLINDER
    return best, kind


@kernel
def _heard(on_axis, along, across):
    """Whether a source with this amplitude on the axis is above the threshold where it lies."""
    theta = math.atan2(across, along)
    return on_axis * math.exp(-(theta * theta) / (S_RAD * S_RAD)) >= THRESHOLD


@kernel
def _reachable(way, sx, sy, own_wall, own_cylinder, near):
    """Whether sound comes from the disc, by way of up to two mirrors, to the source s and back."""
    walls, px, py = near.walls, way.px, way.py
    if way.mirror_1 < 0:
        return _clear(px, py, sx, sy, near, own_wall, -1, own_cylinder)
    tx, ty, skip, cylinder = sx, sy, own_wall, own_cylinder
    if way.mirror_2 >= 0:
        w = way.mirror_2
        u = _crossing_wall(way.qx, way.qy, tx, ty, walls, w)
        if u <= 0.0 or u >= 1.0:
            return False
        hx, hy = way.qx + u * (tx - way.qx), way.qy + u * (ty - way.qy)
        if not _clear(hx, hy, tx, ty, near, w, skip, cylinder):
            return False
        tx, ty, skip, cylinder = hx, hy, w, -1
    w = way.mirror_1
    u = _crossing_wall(way.q1x, way.q1y, tx, ty, walls, w)
    if u <= 0.0 or u >= 1.0:
        return False
    hx, hy = way.q1x + u * (tx - way.q1x), way.q1y + u * (ty - way.q1y)
    return _clear(hx, hy, tx, ty, near, w, skip, cylinder) and _clear(px, py, hx, hy, near, w, -1, -1)


@kernel
def _clear(px, py, qx, qy, near, skip_a, skip_b, skip_cylinder):
    """Whether nothing stands between p and q, but for the walls and the cylinder to skip."""
    length = math.hypot(qx - px, qy - py)
    if length < 2e-6:
        return True
    last = 1.0 - 1e-6 / length
    first = 1e-6 / length
    for i in near.wall_rows:
        if i == skip_a or i == skip_b:
            continue
        if first < _crossing_wall(px, py, qx, qy, near.walls, i) < last:
            return False
    for i in near.cylinder_rows:
        if i == skip_cylinder:
            continue
        cx, cy, radius = near.cylinders[i, 0], near.cylinders[i, 1], near.cylinders[i, 2]
        u = ((cx - px) * (qx - px) + (cy - py) * (qy - py)) / (length * length)
        u = min(1.0, max(0.0, u))
        if math.hypot(px + u * (qx - px) - cx, py + u * (qy - py) - cy) < radius:
            return False
    return True


@kernel
def _first_hit(px, py, heading, reach, near, skip):
    """The nearest wall on a ray: its index, -1 where none."""
    qx, qy = px + reach * math.cos(heading), py + reach * math.sin(heading)
    best, hit = 2.0, -1
    for i in near.wall_rows:
        if i == skip:
            continue
        u = _crossing_wall(px, py, qx, qy, near.walls, i)
        if 1e-9 < u < best:
            best, hit = u, i
    return hit


@kernel
def _crossing_wall(px, py, qx, qy, walls, i):
    """Where p->q crosses wall i, as a share of p->q; -1 where it does not."""
    ax, ay = walls[i, 0], walls[i, 1]
    dx, dy = qx - px, qy - py
    ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
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


@kernel
def _mirror(x, y, walls, i):
    """Image of a point in wall i's line."""
    ax, ay = walls[i, 0], walls[i, 1]
    ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
    t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    return 2.0 * (ax + t * ex) - x, 2.0 * (ay + t * ey) - y


@kernel
def _mirrored_heading(heading, walls, i):
    """Heading of the image of a beam in wall i's line."""
    return 2.0 * math.atan2(walls[i, 3] - walls[i, 1], walls[i, 2] - walls[i, 0]) - heading
