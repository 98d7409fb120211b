"""Geometry of one path of sound: crossings, mirrors, what stands between."""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel


@inner_kernel
def crossing(px, py, qx, qy, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Where p->q crosses a-b, as a share of p->q; -1 where it does not. The last micrometre does not count.

    A quotient is below 0 or above 1 exactly where its parts say so: only what is hit is divided.
    """
    dx, dy = qx - px, qy - py
    ex, ey = bx - ax, by - ay
    across = dx * ey - dy * ex
    if across == 0.0:
        return -1.0
    sign = math.copysign(1.0, across)
    along = sign * ((ax - px) * ey - (ay - py) * ex)
    off = sign * ((ax - px) * dy - (ay - py) * dx)
    across = sign * across
    if (along < 0.0) | (along > across) | (off < 0.0) | (off > across):  # one branch: most are missed
        return -1.0
    return along / across


@inner_kernel
def is_clear(px, py, qx, qy, walls, cylinders, near_walls, near_cylinders, skip_a, skip_b, skip_cylinder):  # type: ignore[no-untyped-def]
    """Whether nothing stands between p and q, but for the walls and the cylinder to skip."""
    length = math.hypot(qx - px, qy - py)
    if length < 2e-6:
        return True
    last = 1.0 - 1e-6 / length
    first = 1e-6 / length
    for i in near_walls:
        if i in (skip_a, skip_b):
            continue
        u = crossing(px, py, qx, qy, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3])
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
def mirrored(x, y, walls, i):  # type: ignore[no-untyped-def]
    """Image of a point in wall i's line."""
    ax, ay = walls[i, 0], walls[i, 1]
    ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
    t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    return 2.0 * (ax + t * ex) - x, 2.0 * (ay + t * ey) - y


@inner_kernel
def mirrored_heading(heading, walls, i):  # type: ignore[no-untyped-def]
    """Heading of the image of a beam in wall i's line."""
    return 2.0 * math.atan2(walls[i, 3] - walls[i, 1], walls[i, 2] - walls[i, 0]) - heading


@inner_kernel
def must_cross(cx, cy, sx, sy, slack, more, ax, ay, bx, by):  # type: ignore[no-untyped-def]
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
