"""Ghosts: what a disc that hears nothing directly hears by way of one or two walls that act as mirrors."""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel
from sonar_explore.envs.pings.arrays import (
    BIN_FIRST,
    BIN_ITEMS,
    BINS,
    COUNTS,
    EPS_M,
    GHOST,
    HIDDEN_BY,
    KNOWN_VIEWS,
    LOWS,
    NONE,
    NOTHING,
    SPARE,
    START,
    VIEWS,
    Circle,
    Disc,
    cell_of,
)
from sonar_explore.envs.pings.direct import nearest_source
from sonar_explore.envs.pings.geometry import crossing, mirrored, mirrored_heading
from sonar_explore.envs.pings.views import view

_FAN_RAD = tuple(math.radians(d) for d in (0.0, -4.0, 4.0, -8.0, 8.0))  # of the AmigoBot's beam


@inner_kernel
def _bins(circle, range_max, walls, near_walls, lists):  # type: ignore[no-untyped-def]
    """Walls by the bearings under which a ray from the circle may meet them: first and items, ascending in a bin."""
    lows, counts, first, filled, items = (
        lists[LOWS],
        lists[COUNTS],
        lists[BIN_FIRST],
        lists[SPARE],
        lists[BIN_ITEMS],
    )
    vx, vy, width, slack = circle.x, circle.y, 2.0 * math.pi / BINS, circle.rho + EPS_M
    for j in range(BINS + 1):
        first[j] = 0
    for k in range(len(near_walls)):
        i = near_walls[k]
        ax, ay, bx, by = walls[i, 0] - vx, walls[i, 1] - vy, walls[i, 2] - vx, walls[i, 3] - vy
        ex, ey = bx - ax, by - ay
        t = min(1.0, max(0.0, -(ax * ex + ay * ey) / (ex * ex + ey * ey)))
        nearest = math.sqrt((ax + t * ex) ** 2 + (ay + t * ey) ** 2)
        lows[k], counts[k] = 0, BINS
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
            if high - low + 1 < BINS:
                lows[k], counts[k] = low, high - low + 1
        for j in range(counts[k]):
            first[(lows[k] + j) % BINS + 1] += 1
    for j in range(BINS):
        first[j + 1] += first[j]
        filled[j] = first[j]
    for k in range(len(near_walls)):
        for j in range(counts[k]):
            cell = (lows[k] + j) % BINS
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
        u = crossing(px, py, qx, qy, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3])
        if 1e-9 < u < best:
            best, hit = u, i
    return hit, best


@inner_kernel
def ghosts(discs, start, stop, circle, things, index, near, room, ear, ranges, kinds):  # type: ignore[no-untyped-def]
    """For each silent disc the nearest source heard by way of the walls that a fan of rays in its beam meets."""
    binned = stop - start > 3
    if binned:
        _bins(circle, ear.range_max, things.walls, near.walls, room.lists)
    known = START
    for n in range(start, stop):
        if kinds[n] == NOTHING:
            ranges[n], kinds[n], known = _ghost(
                discs[n], circle, things, index, near, room, ear, binned, known
            )


@inner_kernel
def _ghost(disc, circle, things, index, near, room, ear, binned, known):  # type: ignore[no-untyped-def]
    """Range [m] and kind of the nearest ghost that one disc hears, and how many views there are now."""
    px, py, heading = disc[0], disc[1], disc[2]
    best, kind = ear.range_max, NOTHING
    cell = cell_of(px, py, index.frame)
    if cell < 0:
        return best, kind, known
    walls, lists = things.walls, room.lists
    seen_1, seen_2 = -1, -1
    for offset in _FAN_RAD:
        bearing = heading + ear.fan * offset
        w1, hx, hy = _first_mirror(px, py, bearing, ear.range_max, walls, near.walls, lists, binned)
        if w1 < 0 or w1 in (seen_1, seen_2):
            continue
        seen_2 = seen_1
        seen_1 = w1
        w2 = NONE
        for mirror_count in range(1, 1 + min(ear.mirrors, 2)):
            if mirror_count == 2:
                if kind != NOTHING:
                    break
                ray = mirrored_heading(bearing, walls, w1)
                rx, ry = hx + ear.range_max * math.cos(ray), hy + ear.range_max * math.sin(ray)
                first, last = index.wall_first[cell], index.wall_first[cell + 1]
                w2, _ = _first_hit(hx, hy, rx, ry, walls, index.wall_items, first, last, w1)
                if w2 < 0:
                    break
            place, known = _view_by(w1, w2, circle, things, near, room, known, ear)
            first, last = lists[KNOWN_VIEWS, place + 2], lists[KNOWN_VIEWS, place + 3]
            if first == last:
                continue
            h = mirrored_heading(heading, walls, w1)
            q1x, q1y = mirrored(px, py, walls, w1)
            qx, qy, gain = q1x, q1y, ear.loss**2
            if mirror_count == 2:
                h = mirrored_heading(h, walls, w2)
                qx, qy = mirrored(q1x, q1y, walls, w2)
                gain = ear.loss**4
            image = Disc(px, py, q1x, q1y, qx, qy, h)
            by = Circle(circle.x, circle.y, circle.rho, gain, w1, w2)
            r, k = nearest_source(
                image, by, best, things, near, room.source, room.ids, first, last, lists[HIDDEN_BY], ear
            )
            if k != NOTHING:
                best, kind = r, k + mirror_count * GHOST
    return best, kind, known


@inner_kernel
def _first_mirror(px, py, bearing, range_max, walls, near_walls, lists, binned):  # type: ignore[no-untyped-def]
    """The first wall on a ray from the disc, -1 for none, and where it is met."""
    c, s = math.cos(bearing), math.sin(bearing)
    items, first, last = near_walls, 0, len(near_walls)
    if binned:
        b = int(math.floor(bearing / (2.0 * math.pi / BINS))) % BINS
        items, first, last = lists[BIN_ITEMS], lists[BIN_FIRST, b], lists[BIN_FIRST, b + 1]
    w, u = _first_hit(px, py, px + range_max * c, py + range_max * s, walls, items, first, last, NONE)
    return w, px + u * range_max * c, py + u * range_max * s


@inner_kernel
def _view_by(w1, w2, circle, things, near, room, known, ear):  # type: ignore[no-untyped-def]
    """The view by way of these mirrors, made at its first use: where it stands among them, and how many there are.

    Four numbers each: the mirrors, the first source, the end.
    """
    views, walls = room.lists[KNOWN_VIEWS], things.walls
    for k in range(known):
        if views[4 * k] == w1 and views[4 * k + 1] == w2:
            return 4 * k, known
    first = views[4 * known - 1] if known else 0
    most = 2 * len(near.walls) + len(near.wedges) + len(near.cylinders) + 1
    if 4 * known + 4 > VIEWS or first + most > len(room.source):
        known, first = 0, 0
    qx, qy = mirrored(circle.x, circle.y, walls, w1)
    gain = ear.loss * ear.loss
    if w2 >= 0:
        qx, qy = mirrored(qx, qy, walls, w2)
        gain *= gain
    last = view(Circle(qx, qy, circle.rho, gain, w1, w2), things, near, room.source, room.ids, first, ear)
    k = 4 * known
    views[k], views[k + 1], views[k + 2], views[k + 3] = w1, w2, first, last
    return k, known + 1
