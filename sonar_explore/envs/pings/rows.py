"""What is near, in rows of numbers: questions that are put to all of it at once.

Each loop has no branches, so that the compiler may work on several numbers at a time; it writes into row `FOUND` a
number that is at least 0 for what may answer, and the few that may are looked at one by one.
"""

from __future__ import annotations

import math

from sonar_explore.compiled import inlined_kernel, inner_kernel
from sonar_explore.envs.pings.arrays import (
    AX,
    AY,
    BX,
    BY,
    COS,
    CX,
    CY,
    EPS_M,
    EX,
    EY,
    FOUND,
    IS_ROUGH,
    KIND,
    LANES,
    OPENING,
    RIGHT_CORNER,
    SX,
    SY,
    TX,
    TY,
    WEDGE_COLUMNS,
    WINDOW_COS,
    WINDOW_X,
    WINDOW_Y,
)

NOWHERE_M = 1e9  # where rows are filled up: nothing reaches it


@inner_kernel
def fill_rows(things, near_walls, near_wedges, rows):  # type: ignore[no-untyped-def]
    """Copy what is near into rows."""
    walls, wedges = things.walls, things.wedges
    for k in range(len(near_walls)):
        i = near_walls[k]
        rows[AX, k], rows[AY, k], rows[IS_ROUGH, k] = walls[i, 0], walls[i, 1], walls[i, 4]
        rows[EX, k], rows[EY, k] = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
    for k in range(len(near_walls), padded(len(near_walls))):
        rows[AX, k], rows[AY, k], rows[IS_ROUGH, k] = NOWHERE_M, 2.0 * NOWHERE_M, 0.0
        rows[EX, k], rows[EY, k] = 0.0, 0.0
    for k in range(padded(len(near_wedges))):
        for column in range(WEDGE_COLUMNS):
            rows[CX + column, k] = wedges[near_wedges[k], column] if k < len(near_wedges) else NOWHERE_M


@inner_kernel
def padded(n):  # type: ignore[no-untyped-def]
    """The next multiple of `LANES`."""
    return (n + LANES - 1) // LANES * LANES


@inner_kernel
def find_met(px, py, dx, dy, blur, n, rows):  # type: ignore[no-untyped-def]
    """Walls that the ray from p to p + d may meet, if p and p + d are off by less than `blur`, all [m]."""
    x, y, u, v, found = rows[AX], rows[AY], rows[EX], rows[EY], rows[FOUND]
    reach = abs(dx) + abs(dy)
    for k in range(padded(n)):
        ax, ay, ex, ey = x[k] - px, y[k] - py, u[k], v[k]
        across, along, off = dx * ey - dy * ex, ax * ey - ay * ex, ax * dy - ay * dx
        sign = math.copysign(1.0, across)
        across, along, off = sign * across, sign * along, sign * off
        least = along if along < off else off
        most = along if along > off else off
        inside = least if least < across - most else across - most
        found[k] = inside + blur * (abs(ex) + abs(ey) + reach)


@inner_kernel
def find_in_fan(px, py, left_x, left_y, right_x, right_y, blur, n, rows):  # type: ignore[no-untyped-def]
    """Walls that rays from p between p + left and p + right may meet; these two are less than half a turn apart."""
    x, y, u, v, found = rows[AX], rows[AY], rows[EX], rows[EY], rows[FOUND]
    dx, dy = left_x + right_x, left_y + right_y
    doubt = blur * (abs(dx) + abs(dy))
    for k in range(padded(n)):
        ax, ay = x[k] - px, y[k] - py
        bx, by = ax + u[k], ay + v[k]
        missed = (left_x * ay - left_y * ax > doubt) & (left_x * by - left_y * bx > doubt)
        missed = missed | ((right_x * ay - right_y * ax < -doubt) & (right_x * by - right_y * bx < -doubt))
        missed = missed | ((dx * ax + dy * ay < -doubt) & (dx * bx + dy * by < -doubt))
        found[k] = -1.0 if missed else 1.0


@inner_kernel
def fill_windows(source, n, rows):  # type: ignore[no-untyped-def]
    """Copy the windows of the first n sources into rows."""
    for k in range(n):
        rows[WINDOW_X, k], rows[WINDOW_Y, k], rows[WINDOW_COS, k] = (
            source[k, BX],
            source[k, BY],
            source[k, COS],
        )


@inlined_kernel
def sighted(c, s, n, rows, places):  # type: ignore[no-untyped-def]
    """Sources whose window holds a beam along (c, s), rising, into `places`: how many."""
    x, y, cos, count = rows[WINDOW_X], rows[WINDOW_Y], rows[WINDOW_COS], 0
    for k in range(n):
        places[count] = k
        count += c * x[k] + s * y[k] >= cos[k]
    return count


@inner_kernel
def listed(n, rows, places):  # type: ignore[no-untyped-def]
    """Where among n near things something was found, rising, into `places`: how many."""
    count = 0
    for k in range(n):
        places[count] = k
        count += rows[FOUND, k] >= 0.0
    return count


@inner_kernel
def find_between(cx, cy, sx, sy, slack, n, rows):  # type: ignore[no-untyped-def]
    """Walls that a path between points within `slack` of c and of s may meet."""
    x, y, u, v, found = rows[AX], rows[AY], rows[EX], rows[EY], rows[FOUND]
    dx, dy = sx - cx, sy - cy
    beside = slack * slack * (dx * dx + dy * dy)
    for k in range(padded(n)):
        ax, ay, ex, ey = x[k] - cx, y[k] - cy, u[k], v[k]
        a, c = dx * ay - dy * ax, ey * ax - ex * ay
        b, s = a + dx * ey - dy * ex, c - ey * dx + ex * dy
        apart = slack * slack * (ex * ex + ey * ey)
        passed = (a * b > 0.0) & (a * a > beside) & (b * b > beside)
        missed = passed | ((c * s > 0.0) & (c * c > apart) & (s * s > apart))
        found[k] = -1.0 if missed else 1.0


@inner_kernel
def find_feet(circle, gates, n, rows):  # type: ignore[no-untyped-def]
    """Walls with the foot of a normal that the circle may see through its gates, and all rough ones."""
    x, y, u, v, rough, found = rows[AX], rows[AY], rows[EX], rows[EY], rows[IS_ROUGH], rows[FOUND]
    vx, vy, slack = circle.x, circle.y, circle.rho + EPS_M
    for k in range(padded(n)):
        ax, ay, ex, ey = x[k] - vx, y[k] - vy, u[k], v[k]
        dot, squared, beyond = -(ax * ex + ay * ey), ex * ex + ey * ey, slack * (abs(ex) + abs(ey))
        t = dot / (squared + 1e-30)
        missed = (dot < -beyond) | (dot > squared + beyond) | shut(ax + t * ex, ay + t * ey, slack, gates)
        found[k] = -1.0 if missed & (rough[k] == 0.0) else 1.0


@inner_kernel
def find_wedges(circle, gates, corner_reach, edge_reach, n, rows):  # type: ignore[no-untyped-def]
    """Wedges that open to the circle (2: surely to all of it), and that it may see through its gates within reach.

    Reach: of corners, of edges, [m].
    """
    x, y, opening, kind, found = rows[CX], rows[CY], rows[OPENING], rows[KIND], rows[FOUND]
    start_x, start_y, end_x, end_y = rows[SX], rows[SY], rows[TX], rows[TY]
    vx, vy, slack = circle.x, circle.y, circle.rho + EPS_M
    far_corner, far_edge = (corner_reach + slack) ** 2, (edge_reach + slack) ** 2
    for k in range(padded(n)):
        dx, dy = x[k] - vx, y[k] - vy
        far = far_corner if kind[k] == RIGHT_CORNER else far_edge
        # inside both are positive; one of them, where it opens more than half a turn
        before, after = start_y[k] * dx - start_x[k] * dy, end_x[k] * dy - end_y[k] * dx
        low, high = min(before, after), max(before, after)
        inside = high if opening[k] > math.pi else low
        missed = (inside < -slack) | (dx * dx + dy * dy > far) | shut(dx, dy, slack, gates)
        found[k] = -1.0 if missed else (2.0 if inside > slack else 1.0)


@inner_kernel
def shut(dx, dy, slack, gates):  # type: ignore[no-untyped-def]
    """True only where no path from the circle to points as near to its middle + d passes the gates."""
    beside = slack * slack * (dx * dx + dy * dy)
    a, b = dx * gates.ay - dy * gates.ax, dx * gates.by - dy * gates.bx
    s = gates.side_ab + (gates.bx - gates.ax) * dy - (gates.by - gates.ay) * dx
    closed = (a * b > 0.0) & (a * a > beside) & (b * b > beside)
    closed = closed | ((gates.side_ab * s > 0.0) & (s * s > gates.apart_ab))
    c, d = dx * gates.cy - dy * gates.cx, dx * gates.dy - dy * gates.dx
    s = gates.side_cd + (gates.dx - gates.cx) * dy - (gates.dy - gates.cy) * dx
    closed = closed | ((c * d > 0.0) & (c * c > beside) & (d * d > beside))
    return closed | ((gates.side_cd * s > 0.0) & (s * s > gates.apart_cd))
