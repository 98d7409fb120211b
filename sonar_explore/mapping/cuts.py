"""How far the directions of a scan are clear before walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel, lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import Mask

_HAIR_M = 1e-6  # more than rounding can do to a distance along a ray that all but runs along a wall
_TOGETHER = 8  # scans taken one after the other that share what is near them: mostly they lie side by side
_HAIR_M2 = 1e-9  # nearer than this to the square of a limit the exact distance decides


def cut_all_at_walls(
    scans: NDArray[np.int64],
    at: Array,
    clear_m: Array,
    barriers: Array,
    own: Array,
    real: Mask,
    first: NDArray[np.int64],
    margin_m: float,
    known: Known,
) -> tuple[Array, Mask]:
    """How far each direction of some of many scans is clear, to the nearest barrier that it meets, shape (k, n), [m];
    and whether that may be otherwise than it was, shape (k,).

    Args:
        scans: which, shape (k,).
        at: x y [m] heading [rad] of all scans, map frame, shape (m, 3).
        clear_m: how far each of n equal sectors about the robot is clear, shape (m, n), [m].
        barriers, own: segments in the map frame, shape (b, 4) and (j, 4), [m]; the own ones of scan i are
            `own[first[i]:first[i + 1]]`, and count where they are `real`, shape (j,).
        margin_m: how far before a barrier to stop, [m].
        known: what is known of it already.
    """
    clear, out, differ = clear_m[scans], known.cut_m.copy(), np.ones(len(scans), dtype=bool)
    if len(scans):
        beams, room = np.empty((3, 2 * out.shape[1] + 8)), np.empty((len(barriers) + len(own), 4))
        walls = barriers, own, real, first, known.gone, known.come
        _cut_all(scans, at, clear, walls, margin_m, known.stands, out, differ, beams, room)
    return out, differ


@dataclass(frozen=True, eq=False)
class Known:
    """How far directions were clear, and what has changed since."""

    stands: Mask
    """Scans that nothing else has changed of, shape (k,)."""
    cut_m: Array
    """How far each direction of those was clear, whatever of the others, shape (k, n), [m]."""
    gone: Array
    """Barriers that are none any more, map frame, shape (g, 4), [m],"""
    come: Array
    """and those that were none, shape (c, 4)."""


def in_reach(places: Array, reach_m: Array, segments: Array) -> Mask:
    """Which places, shape (n, 2), have one of the segments within their reach, shape (n,), [m]."""
    return np.asarray(_in_reach(places, reach_m, segments))


@lean_kernel
def _cut_all(scans, at, clear, walls, margin, stands, out, differ, beams, room):  # type: ignore[no-untyped-def]
    """Where a barrier that has gone may be what a direction ended at, the scan is cut at all of them again; else at
    those alone that have come.

    Sector b of a scan has the cosine and the sine of its middle in column b less the first that there can be of
    `beams`, once it was asked for; its third row is for a scan. `room` is for the segments that may be met.
    """
    barriers, own, real, first, gone, come = walls
    n, near, of_group = clear.shape[1], 0, -1
    for i in range(len(scans)):
        scan, row, cut = scans[i], beams[2], out[i]
        for b in range(beams.shape[1]):
            beams[0, b] = np.inf
        reach = 0.0
        for b in range(n):
            row[b] = clear[i, b]
            reach = max(reach, row[b])
        place, reach, from_nothing = at[scan], reach + margin, not stands[i]
        if not from_nothing:
            _cut(place, row[:n], reach, gone, len(gone), margin, beams)
            for b in range(n):
                ended = row[b] < clear[i, b] and max(row[b], 0.0) <= cut[b] + _HAIR_M
                from_nothing = from_nothing or ended
                row[b] = cut[b]
        if from_nothing:
            if i // _TOGETHER != of_group:
                of_group = i // _TOGETHER
                some = slice(of_group * _TOGETHER, (of_group + 1) * _TOGETHER)
                near = _near(scans[some], at, clear[some], barriers, margin, room)
            count = near
            for k in range(first[scan], first[scan + 1]):
                if real[k]:
                    _copy(own[k], room[count])
                    count += 1
            for b in range(n):
                cut[b] = clear[i, b]
            _cut(place, cut, reach, room, count, margin, beams)
        else:
            _cut(place, cut, reach, come, len(come), margin, beams)
        differ[i] = not stands[i]
        for b in range(n):
            cut[b] = max(cut[b], 0.0)
            differ[i] = differ[i] or cut[b] != row[b]


@inner_kernel
def _near(scans, at, clear, barriers, margin, room):  # type: ignore[no-untyped-def]
    """Which barriers lie near the box about all of these scans, into `room`: how many."""
    reach = 0.0
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for i in range(len(scans)):
        x, y = at[scans[i], 0], at[scans[i], 1]
        low_x, low_y, high_x, high_y = min(low_x, x), min(low_y, y), max(high_x, x), max(high_y, y)
        for b in range(clear.shape[1]):
            reach = max(reach, clear[i, b])
    reach += 2.0 * margin
    count = 0
    for k in range(len(barriers)):
        ax, ay, bx, by = barriers[k, 0], barriers[k, 1], barriers[k, 2], barriers[k, 3]
        beside = max(ax, bx) < low_x - reach or min(ax, bx) > high_x + reach
        if not (beside or max(ay, by) < low_y - reach or min(ay, by) > high_y + reach):
            _copy(barriers[k], room[count])
            count += 1
    return count


@inner_kernel
def _copy(segment, to):  # type: ignore[no-untyped-def]
    for column in range(4):
        to[column] = segment[column]


@inner_kernel
def _beside(ax, ay, bx, by, reach):  # type: ignore[no-untyped-def]
    """Whether a segment lies, by more than rounding can do, beside the square of this half-width about the origin: most
    do, and it is farther off than that."""
    far = reach + _HAIR_M
    return (
        (ax > far and bx > far)
        or (ax < -far and bx < -far)
        or (ay > far and by > far)
        or (ay < -far and by < -far)
    )


@inner_kernel
def _cut(place, clear, reach, segments, count, margin, beams):  # type: ignore[no-untyped-def]
    """Cut what is clear from a place at so many segments; none farther than `reach` cuts anything."""
    n, x, y, heading = len(clear), place[0], place[1], place[2]
    lowest = int(math.floor((-math.pi - heading) / (2.0 * math.pi) * n - 0.5 * n)) - 2
    for i in range(count):
        ax, ay = segments[i, 0] - x, segments[i, 1] - y
        bx, by = segments[i, 2] - x, segments[i, 3] - y
        if _beside(ax, ay, bx, by, reach):
            continue
        ex, ey = bx - ax, by - ay
        length2 = ex * ex + ey * ey
        if length2 < 1e-12:
            continue
        t = min(1.0, max(0.0, -(ax * ex + ay * ey) / length2))
        px, py = ax + t * ex, ay + t * ey
        square = px * px + py * py
        if square > reach * reach + _HAIR_M2 or math.hypot(px, py) > reach:
            continue
        nearest = math.sqrt(square) - margin - _HAIR_M  # no direction is cut shorter than this
        start = (math.atan2(ay, ax) - heading) / (2.0 * math.pi) * n
        turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by) / (2.0 * math.pi) * n
        if turn < 0.0:
            start += turn
            turn = -turn
        # sectors whose middle ray meets the segment, and the ones that hold its ends
        for b in range(int(math.floor(start)), int(math.floor(start + turn)) + 1):
            if clear[b % n] < nearest:
                continue
            if beams[0, b - lowest] == np.inf:
                middle = (b + 0.5) / n * 2.0 * math.pi + heading
                beams[0, b - lowest], beams[1, b - lowest] = math.cos(middle), math.sin(middle)
            c, s = beams[0, b - lowest], beams[1, b - lowest]
            denominator = c * ey - s * ex
            r = reach
            if abs(denominator) > 1e-9:
                r = (ax * ey - ay * ex) / denominator
                along = (c * r - ax) * ex + (s * r - ay) * ey
                if along < 0.0 or along > length2 or r < 0.0:
                    r = min(math.hypot(ax, ay), math.hypot(bx, by))
            clear[b % n] = min(clear[b % n], r - margin)


@kernel
def _in_reach(places, reach, segments):  # type: ignore[no-untyped-def]
    """Which places, shape (n, 2), have a segment within their reach, shape (n,), and a hair more."""
    out = np.zeros(len(places), dtype=np.bool_)
    for i in range(len(places)):
        for k in range(len(segments)):
            ax, ay = segments[k, 0] - places[i, 0], segments[k, 1] - places[i, 1]
            ex, ey = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
            if _beside(ax, ay, ax + ex, ay + ey, reach[i] + 1e-6):
                continue
            t = min(1.0, max(0.0, -(ax * ex + ay * ey) / max(ex * ex + ey * ey, 1e-12)))
            if math.hypot(ax + t * ex, ay + t * ey) <= reach[i] + 1e-6:
                out[i] = True
                break
    return out
