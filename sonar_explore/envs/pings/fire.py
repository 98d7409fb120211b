"""All pings of a scan: discs that lie together share one view."""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel, lean_kernel
from sonar_explore.envs.pings.arrays import (
    EPS_M,
    IN_SIGHT,
    NEAR_CELLS,
    NEAR_COLUMNS,
    NEAR_WALLS,
    NEAR_WEDGES,
    NONE,
    NOTHING,
    SPARE,
    START,
    TOGETHER_M,
    WALLS_FROM,
    Circle,
    Disc,
    Ear,
    Index,
    Near,
    Scratch,
    Things,
    cell_of,
)
from sonar_explore.envs.pings.direct import nearest_source
from sonar_explore.envs.pings.ghosts import ghost
from sonar_explore.envs.pings.rows import fill_rows, fill_windows, sighted
from sonar_explore.envs.pings.views import OPEN, hidden_by, view


@lean_kernel
def fire_all(discs, things, index, room, ear, ranges, kinds):  # type: ignore[no-untyped-def]
    """First echo of each disc (x, y, heading), into `ranges` and `kinds`; the four in the middle as plain tuples."""
    things, index, room, ear = Things(*things), Index(*index), Scratch(*room), Ear(*ear)
    stop = START
    while stop < len(discs):
        start = stop
        stop, circle, n_cells = _together(discs, start, index.frame, room.lists[NEAR_CELLS])
        for n in range(start, stop):
            ranges[n], kinds[n] = ear.range_max, NOTHING
        if n_cells > 0:
            _fire_together(discs, start, stop, circle, n_cells, things, index, room, ear, ranges, kinds)


@inner_kernel
def _fire_together(discs, start, stop, circle, n_cells, things, index, room, ear, ranges, kinds):  # type: ignore[no-untyped-def]
    """The same for discs that share a view: what is heard directly, and where nothing is, ghosts."""
    reach, rows, in_sight = ear.range_max, room.rows, room.lists[IN_SIGHT]
    near, many, known = _all_near(index, room.lists, n_cells), stop - start > 3, START
    fill_rows(things, near.walls, near.wedges, rows)
    seen = view(circle, OPEN, min(reach, ear.edge_reach), things, near, room, START, many, ear)
    if many:
        seen = hidden_by(circle, things, near, room, seen)
    else:  # for few pings the lists do not pay
        for k in range(seen):
            room.ids[k, WALLS_FROM] = -1
    fill_windows(room.source, seen, rows)
    all_inside = _is_inside(circle, index.frame)
    for n in range(start, stop):
        px, py, heading = discs[n, 0], discs[n, 1], discs[n, 2]
        if not all_inside and cell_of(px, py, index.frame) < 0:
            continue
        disc = Disc(px, py, px, py, px, py, math.cos(heading), math.sin(heading))
        count = sighted(disc.c, disc.s, seen, rows, in_sight)
        r, k = reach, NOTHING
        if count > 0:
            r, k = nearest_source(disc, circle, reach, things, near, room, in_sight, count, ear)
        if k == NOTHING and ear.mirrors > 0:
            cell = cell_of(px, py, index.frame)
            allowed = index.wall_items[index.wall_first[cell] : index.wall_first[cell + 1]]
            r, k, known = ghost(disc, heading, allowed, circle, things, near, room, ear, seen, known)
        ranges[n], kinds[n] = r, k


@inner_kernel
def _is_inside(circle, frame):  # type: ignore[no-untyped-def]
    """Whether all discs are surely in cells of the index."""
    x, y, rho = circle.x, circle.y, circle.rho + EPS_M
    return cell_of(x - rho, y - rho, frame) >= 0 and cell_of(x + rho, y + rho, frame) >= 0


@inner_kernel
def _all_near(index, lists, n_cells):  # type: ignore[no-untyped-def]
    """What is near any of the first cells of the list."""
    cells, spare, c = lists[NEAR_CELLS], lists[SPARE], lists[NEAR_CELLS, 0]
    if n_cells == 1:
        return Near(
            index.wall_items[index.wall_first[c] : index.wall_first[c + 1]],
            index.wedge_items[index.wedge_first[c] : index.wedge_first[c + 1]],
            index.cylinder_items[index.cylinder_first[c] : index.cylinder_first[c + 1]],
        )
    walls = _near(cells, n_cells, index.wall_first, index.wall_items, lists[NEAR_WALLS], spare)
    wedges = _near(cells, n_cells, index.wedge_first, index.wedge_items, lists[NEAR_WEDGES], spare)
    columns = _near(cells, n_cells, index.cylinder_first, index.cylinder_items, lists[NEAR_COLUMNS], spare)
    return Near(lists[NEAR_WALLS, :walls], lists[NEAR_WEDGES, :wedges], lists[NEAR_COLUMNS, :columns])


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
        if x1 - x0 > TOGETHER_M or y1 - y0 > TOGETHER_M:
            break
        low_x, low_y, high_x, high_y = x0, y0, x1, y1
        cell = cell_of(x, y, frame)
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
    return stop, Circle(vx, vy, math.sqrt(rho), 1.0, NONE, NONE), n


@lean_kernel
def turned_discs(x, y, headings, mounts, discs):  # type: ignore[no-untyped-def]
    """Poses of discs mounted so (x y heading, shape (n, 3)) on a body at (x, y) with these headings, into `discs`."""
    for n in range(len(headings)):
        c, s = math.cos(headings[n]), math.sin(headings[n])
        discs[n, 0] = x + c * mounts[n, 0] - s * mounts[n, 1]
        discs[n, 1] = y + s * mounts[n, 0] + c * mounts[n, 1]
        discs[n, 2] = headings[n] + mounts[n, 2]
