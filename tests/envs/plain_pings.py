# mypy: ignore-errors
# ruff: noqa: SIM109
"""What `sonar_explore.envs.pings` must equal to the last bit: every ping by itself, with nothing left out."""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.beam import EDGE_STRENGTH, S_RAD, THRESHOLD
from sonar_explore.compiled import kernel
from sonar_explore.envs.pings import RIGHT_CORNER

_COS_WIDEST = math.cos(math.radians(20.0))
NOTHING, PLANE, CORNER, EDGE, CYLINDER, ROUGH = 0, 1, 2, 3, 4, 5
GHOST = 10
_FAN_RAD = tuple(math.radians(d) for d in (0.0, -4.0, 4.0, -8.0, 8.0))


def plain_echoes(scene, discs, physics):
    """As `sonar_explore.envs.acoustics.echoes`."""
    ranges = np.empty(len(discs))
    kinds = np.empty(len(discs), dtype=np.int64)
    mirrors = (physics.ghost_order - 1, physics.bounce_loss, physics.range_max_m)
    _fire_all(*(discs, *scene.things, *scene.index, *mirrors, ranges, kinds))
    return ranges, kinds


@kernel
def _cell(x, y, x0, y0, size, rows, columns):  # type: ignore[no-untyped-def]
    """Index cell that holds a point; -1 outside."""
    column = int(math.floor((x - x0) / size))
    row = int(math.floor((y - y0) / size))
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return -1
    return row * columns + column


@kernel
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


@kernel
def _clear(px, py, qx, qy, walls, cylinders, near_walls, near_cylinders, skip_a, skip_b, skip_cylinder):  # type: ignore[no-untyped-def]
    """Whether nothing stands between p and q, but for the walls and the cylinder to skip."""
    length = math.hypot(qx - px, qy - py)
    if length < 2e-6:
        return True
    last = 1.0 - 1e-6 / length
    first = 1e-6 / length
    for i in near_walls:
        if i == skip_a or i == skip_b:
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


@kernel
def _first_hit(px, py, heading, reach, walls, near_walls, skip):  # type: ignore[no-untyped-def]
    """The nearest wall on a ray: its index, -1 where none."""
    qx, qy = px + reach * math.cos(heading), py + reach * math.sin(heading)
    best, hit = 2.0, -1
    for i in near_walls:
        if i == skip:
            continue
        u = _crossing(px, py, qx, qy, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3])
        if 1e-9 < u < best:
            best, hit = u, i
    return hit


@kernel
def _mirror(x, y, walls, i):  # type: ignore[no-untyped-def]
    """Image of a point in wall i's line."""
    ax, ay = walls[i, 0], walls[i, 1]
    ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
    t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    return 2.0 * (ax + t * ex) - x, 2.0 * (ay + t * ey) - y


@kernel
def _reachable(
    px,
    py,
    q1x,
    q1y,
    q2x,
    q2y,
    sx,
    sy,
    mirror_1,
    mirror_2,
    own_wall,
    own_cylinder,
    walls,
    cylinders,
    near_walls,
    near_cylinders,
):  # type: ignore[no-untyped-def]
    """Whether sound comes from p, by way of up to two mirrors (q1, q2 its images), to the source s and back."""
    if mirror_1 < 0:
        return _clear(
            px, py, sx, sy, walls, cylinders, near_walls, near_cylinders, own_wall, -1, own_cylinder
        )
    tx, ty, skip, cylinder = sx, sy, own_wall, own_cylinder
    if mirror_2 >= 0:
        w = mirror_2
        u = _crossing(q2x, q2y, tx, ty, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3])
        if u <= 0.0 or u >= 1.0:
            return False
        hx, hy = q2x + u * (tx - q2x), q2y + u * (ty - q2y)
        if not _clear(hx, hy, tx, ty, walls, cylinders, near_walls, near_cylinders, w, skip, cylinder):
            return False
        tx, ty, skip, cylinder = hx, hy, w, -1
    w = mirror_1
    u = _crossing(q1x, q1y, tx, ty, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3])
    if u <= 0.0 or u >= 1.0:
        return False
    hx, hy = q1x + u * (tx - q1x), q1y + u * (ty - q1y)
    return _clear(hx, hy, tx, ty, walls, cylinders, near_walls, near_cylinders, w, skip, cylinder) and _clear(
        px, py, hx, hy, walls, cylinders, near_walls, near_cylinders, w, -1, -1
    )


@kernel
def _heard(on_axis, along, across):  # type: ignore[no-untyped-def]
    """Whether a source with this amplitude on the axis is above the threshold where it lies."""
    theta = math.atan2(across, along)
    return on_axis * math.exp(-(theta * theta) / (S_RAD * S_RAD)) >= THRESHOLD


@kernel
def _nearest_source(
    px,
    py,
    q1x,
    q1y,
    q2x,
    q2y,
    qx,
    qy,
    heading,
    gain,
    mirror_1,
    mirror_2,
    range_max,
    walls,
    wedges,
    cylinders,
    near_walls,
    near_wedges,
    near_cylinders,
):  # type: ignore[no-untyped-def]
    """Nearest source above the threshold as seen from the image q of the sonar p: range [m] and kind."""
    c, s = math.cos(heading), math.sin(heading)
    best, kind = range_max, NOTHING
    last_mirror = mirror_2 if mirror_2 >= 0 else mirror_1
    for i in near_walls:
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
                1e-6 < r < best
                and along >= _COS_WIDEST * r
                and _heard(gain / r, along, c * dy - s * dx)
                and _reachable(
                    px,
                    py,
                    q1x,
                    q1y,
                    q2x,
                    q2y,
                    fx,
                    fy,
                    mirror_1,
                    mirror_2,
                    i,
                    -1,
                    walls,
                    cylinders,
                    near_walls,
                    near_cylinders,
                )
            ):
                best, kind = r, PLANE
        if walls[i, 4] > 0.0:
            u = _crossing(qx, qy, qx + best * c, qy + best * s, ax, ay, walls[i, 2], walls[i, 3])
            r = u * best
            if r > 1e-6:
                cos_incidence = abs(c * ey - s * ex) / math.hypot(ex, ey)
                hx, hy = qx + r * c, qy + r * s
                if gain * walls[i, 4] * cos_incidence / r >= THRESHOLD and _reachable(
                    px,
                    py,
                    q1x,
                    q1y,
                    q2x,
                    q2y,
                    hx,
                    hy,
                    mirror_1,
                    mirror_2,
                    i,
                    -1,
                    walls,
                    cylinders,
                    near_walls,
                    near_cylinders,
                ):
                    best, kind = r, ROUGH
    for i in near_wedges:
        dx, dy = wedges[i, 0] - qx, wedges[i, 1] - qy
        r = math.hypot(dx, dy)
        along = c * dx + s * dy
        if r < 1e-6 or r >= best or along < _COS_WIDEST * r:
            continue
        inside = (math.atan2(-dy, -dx) - wedges[i, 2]) % (2.0 * math.pi)
        if inside > wedges[i, 3]:
            continue
        corner = wedges[i, 4] == RIGHT_CORNER
        on_axis = gain / r if corner else gain * EDGE_STRENGTH * r**-1.5
        if _heard(on_axis, along, c * dy - s * dx) and _reachable(
            px,
            py,
            q1x,
            q1y,
            q2x,
            q2y,
            wedges[i, 0],
            wedges[i, 1],
            mirror_1,
            mirror_2,
            -1,
            -1,
            walls,
            cylinders,
            near_walls,
            near_cylinders,
        ):
            best, kind = r, CORNER if corner else EDGE
    for i in near_cylinders:
        dx, dy = cylinders[i, 0] - qx, cylinders[i, 1] - qy
        radius = cylinders[i, 2]
        centre = math.hypot(dx, dy)
        r = centre - radius
        along = c * dx + s * dy
        if r < 1e-6 or r >= best or along < _COS_WIDEST * centre:
            continue
        sx, sy = qx + dx * r / centre, qy + dy * r / centre
        on_axis = gain / r * math.sqrt(radius / (radius + r))
        if _heard(on_axis, along, c * dy - s * dx) and _reachable(
            px,
            py,
            q1x,
            q1y,
            q2x,
            q2y,
            sx,
            sy,
            mirror_1,
            mirror_2,
            -1,
            i,
            walls,
            cylinders,
            near_walls,
            near_cylinders,
        ):
            best, kind = r, CYLINDER
    return best, kind


@kernel
def _mirrored_heading(heading, walls, i):  # type: ignore[no-untyped-def]
    """Heading of the image of a beam in wall i's line."""
    return 2.0 * math.atan2(walls[i, 3] - walls[i, 1], walls[i, 2] - walls[i, 0]) - heading


@kernel
def _ghost(
    px,
    py,
    heading,
    mirrors,
    loss,
    range_max,
    walls,
    wedges,
    cylinders,
    near_walls,
    near_wedges,
    near_cylinders,
):  # type: ignore[no-untyped-def]
    """Nearest source heard by way of the walls that a fan of rays inside the beam meets."""
    best, kind = range_max, NOTHING
    seen_1 = -1
    seen_2 = -1
    for offset in _FAN_RAD:
        w1 = _first_hit(px, py, heading + offset, range_max, walls, near_walls, -1)
        if w1 < 0 or w1 == seen_1 or w1 == seen_2:
            continue
        seen_2 = seen_1
        seen_1 = w1
        q1x, q1y = _mirror(px, py, walls, w1)
        h1 = _mirrored_heading(heading, walls, w1)
        r, k = _nearest_source(
            px,
            py,
            q1x,
            q1y,
            q1x,
            q1y,
            q1x,
            q1y,
            h1,
            loss**2,
            w1,
            -1,
            best,
            walls,
            wedges,
            cylinders,
            near_walls,
            near_wedges,
            near_cylinders,
        )
        if k != NOTHING:
            best, kind = r, k + GHOST
        if mirrors < 2 or kind != NOTHING:
            continue
        ray = _mirrored_heading(heading + offset, walls, w1)
        u = _crossing(
            px,
            py,
            px + range_max * math.cos(heading + offset),
            py + range_max * math.sin(heading + offset),
            walls[w1, 0],
            walls[w1, 1],
            walls[w1, 2],
            walls[w1, 3],
        )
        hx, hy = (
            px + u * range_max * math.cos(heading + offset),
            py + u * range_max * math.sin(heading + offset),
        )
        w2 = _first_hit(hx, hy, ray, range_max, walls, near_walls, w1)
        if w2 < 0:
            continue
        q2x, q2y = _mirror(q1x, q1y, walls, w2)
        h2 = _mirrored_heading(h1, walls, w2)
        r, k = _nearest_source(
            px,
            py,
            q1x,
            q1y,
            q2x,
            q2y,
            q2x,
            q2y,
            h2,
            loss**4,
            w1,
            w2,
            best,
            walls,
            wedges,
            cylinders,
            near_walls,
            near_wedges,
            near_cylinders,
        )
        if k != NOTHING:
            best, kind = r, k + 2 * GHOST
    return best, kind


@kernel
def _fire_all(
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
    mirrors,
    loss,
    range_max,
    ranges,
    kinds,
):  # type: ignore[no-untyped-def]
    """First echo of each disc, into `ranges` and `kinds`."""
    for n in range(len(discs)):
        px, py, heading = discs[n, 0], discs[n, 1], discs[n, 2]
        ranges[n] = range_max
        kinds[n] = NOTHING
        cell = _cell(px, py, frame[0], frame[1], frame[2], int(frame[3]), int(frame[4]))
        if cell < 0:
            continue
        near_walls = wall_items[wall_first[cell] : wall_first[cell + 1]]
        near_wedges = wedge_items[wedge_first[cell] : wedge_first[cell + 1]]
        near_cylinders = cylinder_items[cylinder_first[cell] : cylinder_first[cell + 1]]
        r, k = _nearest_source(
            px,
            py,
            px,
            py,
            px,
            py,
            px,
            py,
            heading,
            1.0,
            -1,
            -1,
            range_max,
            walls,
            wedges,
            cylinders,
            near_walls,
            near_wedges,
            near_cylinders,
        )
        if k == NOTHING and mirrors > 0:
            r, k = _ghost(
                px,
                py,
                heading,
                mirrors,
                loss,
                range_max,
                walls,
                wedges,
                cylinders,
                near_walls,
                near_wedges,
                near_cylinders,
            )
        ranges[n] = r
        kinds[n] = k
