"""The loops behind the grid: which cells a scan clears, where the body has been, and what all that makes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.changes import Spans, no_spans, whole_spans, widen
from sonar_explore.mapping.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, States, grown, place_in
from sonar_explore.mapping.looks import MappingConfig
from sonar_explore.mapping.marks import Marks

Counts = NDArray[np.int32]
_HAIR_M2 = 1e-9  # nearer than this to the square of a limit the exact distance decides
# of what is kept of a cell: its sector, and the bits of what counts it
_SECTOR, _CLEARED, _CORE = 0x3FFF, 14, 15
_RIM = 0.01  # nearer than this share of a sector of 1 degree to its rim the exact angle decides


class Sectors:
    """How many scans have cleared each cell, and where the body has been.

    Each scan keeps the sector of every cell near it, and whether it clears it: where it is cut anew, only cells of
    changed sectors are looked at.
    """

    def __init__(self) -> None:
        self._frame: GridFrame | None = None
        self._trails: list[tuple[Pose, Array]] = []
        self.cleared: Counts = np.zeros((0, 0), dtype=np.int32)
        """By any reading, shape (rows, columns)."""
        self.core: Counts = np.zeros((0, 0), dtype=np.int32)
        """For certain, shape (rows, columns)."""
        self._body: Counts = np.zeros((0, 0), dtype=np.int32)
        self._scans = 0
        self._places: Array = np.zeros((0, 4))
        """x y [m] heading [rad] of each scan, and how far its window reaches, [m]; there is room for more."""
        self._clear_m: Array = np.zeros((0, 2, 0))
        """What it clears by direction, by any reading and for certain, shape (scans, 2, n), [m]; -1 clears nothing."""
        self._windows: NDArray[np.int64] = np.zeros((0, 4), dtype=np.int64)
        """First row and column of its window on the grid, rows and columns."""
        self._sectors: NDArray[np.uint16] = np.zeros((0, 0, 0), dtype=np.uint16)
        """The sector of each cell of its window, n beyond its reach, and whether it is cleared by the scan, by any
        reading and for certain, shape (scans, rows, columns)."""
        self.changed: Spans = no_spans((0, 0))
        """Where something may have changed since the states of cells were asked for."""
        self._states: States = np.zeros((0, 0), dtype=np.uint8)

    def resize(self, frame: GridFrame) -> None:
        """Go over to a grown frame; counts keep their places."""
        old, self._frame = self._frame, frame
        if old == frame:
            return
        at = (0, 0) if old is None else place_in(old, frame)
        for name in ("cleared", "core", "_body"):
            setattr(self, name, grown(getattr(self, name), at, frame.shape, 0))
        self._windows[:, :2] += at
        self.changed, self._states = whole_spans(frame.shape), np.zeros(frame.shape, dtype=np.uint8)

    def clear_m(self, scans: NDArray[np.int64], n: int) -> Array:
        """How far some scans clear by any reading, in each of n directions, shape (k, n), [m]; -1 by one that was not
        put."""
        out = np.full((len(scans), n), -1.0)
        known = np.count_nonzero(scans < self._scans)  # in order
        out[:known] = self._clear_m[scans[:known], 0] if known else -1.0
        return out

    def put(self, scans: NDArray[np.int64], at: Array, clear_m: Array, core_m: Array) -> None:
        """What scans clear by direction, shape (k, n) both, [m]; replaces what they cleared before. New ones come in
        order.

        Args:
            scans: which, shape (k,).
            at: where they stand, x y [m] heading [rad], shape (k, 3).
        """
        if not len(scans):
            return
        after = np.empty((len(scans), 2, clear_m.shape[1]))
        after[:, 0], after[:, 1] = clear_m, core_m
        self._scans = max(self._scans, int(scans[-1]) + 1)
        self._make_room(self._scans, after)
        _put(
            *(scans, at, after, self._at),
            *(self.cleared, self.core, self._places, self._clear_m, self._windows, self._sectors),
            self.changed,
        )

    def _make_room(self, scans: int, after: Array) -> None:
        """For so many scans, and for windows that reach as far as these."""
        side = math.ceil(2.0 * float(after.max()) / self._at[2]) + 2
        known, was = self._sectors.shape[:2]
        if scans <= known and side <= was:
            return
        room, side = max(scans + scans // 2 + 8, known), max(side, was)
        sectors = np.empty((room, side, side), dtype=np.uint16)
        sectors[:known, :was, :was] = self._sectors
        self._sectors = sectors
        more = room - known
        self._places = np.vstack([self._places, np.full((more, 4), np.nan)])
        self._windows = np.vstack([self._windows, np.zeros((more, 4), dtype=np.int64)])
        clear_m = np.full((room, *after.shape[1:]), -1.0)
        clear_m[:known] = self._clear_m[:known] if known else -1.0
        self._clear_m = clear_m

    def trails(
        self, scans: Sequence[int], poses: Sequence[Pose], trails: Sequence[Array], radius_m: float
    ) -> None:
        """Where the body has been since some of all scans, shape (n, 2) each, in that scan's frame, [m]; they only ever
        grow. New scans come in order."""
        left: list[Array] = [np.zeros((0, 2))]
        entered: list[Array] = [np.zeros((0, 2))]
        for i in scans:
            pose, points = poses[i], trails[i]
            if i == len(self._trails):
                self._trails.append((pose, left[0]))
            before, covered = self._trails[i]
            stands = before is pose or before == pose
            if stands and len(points) == len(covered):
                continue
            if not stands:
                left.append(covered)
                covered = covered[:0]
            more = pose.transform(points[len(covered) :])
            entered.append(more)
            self._trails[i] = (pose, np.concatenate([covered, more]) if len(covered) else more)
        self._cover(np.concatenate(left), radius_m, -1)
        self._cover(np.concatenate(entered), radius_m, 1)

    def states(self, marks: Sequence[Marks], config: MappingConfig) -> States:
        """Occupied where there is more evidence of a wall, or of a gap that is none, than against it; free where
        something cleared the cell; else unknown; shape (rows, columns).

        Args:
            marks: walls, those of the last scans, points, gaps.
        """
        walls, fresh, points, gaps = marks
        self._states, spans = self._states.copy(), self.changed
        self.changed = no_spans(self._states.shape)
        weights = (
            *(config.wall_weight, config.fresh_weight, config.point_weight),
            *(config.core_weight, config.body_weight),
        )
        _decide(
            *(spans, walls.counts, fresh.counts, points.counts, gaps.counts, weights),
            *(self.cleared, self.core, self._body, self._states),
        )
        return self._states

    def _cover(self, points: Array, radius_m: float, count: int) -> None:
        _cover(self._body, *self._at, points, radius_m - 0.5 * self._at[2], count, self.changed)

    @property
    def _at(self) -> tuple[float, float, float]:
        assert self._frame is not None
        return self._frame.x0, self._frame.y0, self._frame.resolution_m


@kernel
def _decide(spans, walls, fresh, points, gaps, weights, cleared, core, body, states):  # type: ignore[no-untyped-def]
    """No branches: several cells at a time. `weights`: of a wall, fresh or not, a point, a core and the body."""
    wall_weight, fresh_weight, point_weight, core_weight, body_weight = weights
    for row in range(len(spans)):
        for stripe in range(spans.shape[1]):
            for column in range(spans[row, stripe, 0], spans[row, stripe, 1] + 1):
                been = body[row, column] > 0
                sure = core[row, column]
                wall = wall_weight * walls[row, column] + fresh_weight * fresh[row, column]
                wall += point_weight if points[row, column] > 0 else 0.0
                gap = wall_weight * gaps[row, column]
                against = core_weight * sure + (body_weight if been else 0.0)
                against = against if against > 0.0 else 0.0
                known = been | (cleared[row, column] > 0) | (sure > 0)
                shut = (wall if wall > gap else gap) > against
                states[row, column] = OCCUPIED if shut else (FREE if known else UNKNOWN)


@kernel
def _put(scans, poses, after, frame, cleared, core, places, clear, windows, sectors, spans):  # type: ignore[no-untyped-def]
    """Count what scans clear from these poses, shape (m, 3), as far as `after`, shape (m, 2, n), less what they did.

    Where a scan stands as it did and its window reaches far enough, only cells of changed sectors are looked at.
    """
    n = after.shape[2]
    side = sectors.shape[1]
    changed, squares, turns = np.empty(n + 1, dtype=np.bool_), np.empty((2, n)), np.empty(side)
    unsure = np.empty((side * side, 2), dtype=np.int64)
    for i in range(len(scans)):
        k, farthest = scans[i], 0.0
        for b in range(n):
            farthest = max(farthest, after[i, 0, b], after[i, 1, b])
        place, window = places[k], windows[k]
        stands = place[0] == poses[i, 0] and place[1] == poses[i, 1] and place[2] == poses[i, 2]
        if not stands or farthest > place[3]:
            _take_back(cleared, core, window, sectors[k], spans)
            for b in range(n):
                clear[k, 0, b], clear[k, 1, b] = -1.0, -1.0
            place[0], place[1], place[2], place[3] = poses[i, 0], poses[i, 1], poses[i, 2], farthest
            _sectors_of_cells(
                cleared.shape[0], cleared.shape[1], frame, place, n, window, turns, unsure, sectors[k]
            )
        _change(cleared, core, frame, place, window, sectors[k], clear[k], after[i], changed, squares, spans)


@inner_kernel
def _take_back(cleared, core, window, sectors, spans):  # type: ignore[no-untyped-def]
    """Count no more what was counted."""
    for r in range(window[2]):
        row, column = window[0] + r, window[1]
        widen(spans, row, column, column + window[3] - 1)
        for c in range(window[3]):
            cleared[row, column + c] -= (sectors[r, c] >> _CLEARED) & 1
            core[row, column + c] -= sectors[r, c] >> _CORE


@inner_kernel
def _sectors_of_cells(rows, columns, frame, place, n, window, turns, unsure, sectors):  # type: ignore[no-untyped-def]
    """Which of n sectors about a place each cell near it lies in, n beyond its reach, and which window of the grid that
    is.

    Most cells get their sector from an approximate angle, those of a row in a loop without branches; near the rim of a
    sector `atan2` decides. `turns` is for the angles of a row, `unsure` for rows and columns of cells.
    """
    x0, y0, resolution = frame
    x, y, heading, reach = place[0], place[1], place[2], place[3]
    per_rad = n / (2.0 * math.pi)
    ahead = heading * per_rad
    ahead -= n * math.floor(ahead / n)
    farthest = reach * reach + _HAIR_M2
    r0 = max(0, int(math.floor((y - reach - y0) / resolution)))
    r1 = min(rows - 1, int(math.floor((y + reach - y0) / resolution)))
    c0 = max(0, int(math.floor((x - reach - x0) / resolution)))
    c1 = min(columns - 1, int(math.floor((x + reach - x0) / resolution)))
    window[0], window[1], window[2], window[3] = r0, c0, r1 - r0 + 1, c1 - c0 + 1
    waiting = 0
    for r in range(r1 - r0 + 1):
        dy = y0 + (r0 + r + 0.5) * resolution - y
        for c in range(c1 - c0 + 1):
            dx = x0 + (c0 + c + 0.5) * resolution - x
            u = _nearly_atan2(dy, dx) * per_rad - ahead
            u += n if u < 0.0 else 0.0
            u += n if u < 0.0 else 0.0
            square = dx * dx + dy * dy
            u = u if square >= _HAIR_M2 else 0.0
            turns[c] = u if square <= farthest else -1.0
        for c in range(c1 - c0 + 1):
            u = turns[c]
            b = n if u < 0.0 else int(u)
            if u >= n or (u >= 0.0 and (u - b < _RIM or u - b > 1.0 - _RIM)):
                unsure[waiting, 0], unsure[waiting, 1] = r, c
                waiting += 1
            sectors[r, c] = b
    for k in range(waiting):  # not in the loop above: with this in it that took many times as long
        r, c = unsure[k, 0], unsure[k, 1]
        dx, dy = x0 + (c0 + c + 0.5) * resolution - x, y0 + (r0 + r + 0.5) * resolution - y
        sectors[r, c] = int(math.floor((math.atan2(dy, dx) - heading) / (2.0 * math.pi) * n)) % n


@inner_kernel
def _change(cleared, core, frame, place, window, sectors, before, after, changed, squares, spans):  # type: ignore[no-untyped-def]
    """Count cells whose middle lies within `after` of their sector, shape (2, n), less those that are counted already,
    within `before`; `before` becomes `after`."""
    x0, y0, resolution = frame
    n = before.shape[1]
    changed[n] = False  # beyond its reach
    for b in range(n):
        changed[b] = before[0, b] != after[0, b] or before[1, b] != after[1, b]
        for layer in range(2):
            limit = before[layer, b] = after[layer, b]
            squares[layer, b] = limit * abs(limit)
    farthest, surely = squares[0], squares[1]
    for r in range(window[2]):
        row, first, last, known = window[0] + r, window[3], -1, sectors[r]
        dy = y0 + (row + 0.5) * resolution - place[1]
        for c in range(window[3]):
            kept = np.int64(known[c])
            b = kept & _SECTOR
            if not changed[b]:
                continue
            column = window[1] + c
            dx = x0 + (column + 0.5) * resolution - place[0]
            square = dx * dx + dy * dy
            most, surest = farthest[b], surely[b]
            clears, sure = np.int64(square < most), np.int64(square < surest)
            if abs(square - most) < _HAIR_M2 or abs(square - surest) < _HAIR_M2:
                clears = _within(dx, dy, square, after[0, b], most)
                sure = _within(dx, dy, square, after[1, b], surest)
            now = b | clears << _CLEARED | sure << _CORE
            if now != kept:
                cleared[row, column] += clears - ((kept >> _CLEARED) & 1)
                core[row, column] += sure - (kept >> _CORE)
                known[c] = now
                first, last = min(first, c), c
        if last >= 0:
            widen(spans, row, window[1] + first, window[1] + last)


@inner_kernel
def _within(dx, dy, square, limit, limit_square):  # type: ignore[no-untyped-def]
    """1 where hypot(dx, dy) is at most the limit; near it the squares do not decide."""
    if abs(square - limit_square) < _HAIR_M2:
        return 1 if math.hypot(dx, dy) <= limit else 0
    return 1 if square < limit_square else 0


@inner_kernel
def _nearly_atan2(y, x):  # type: ignore[no-untyped-def]
    """atan2 to 2e-5 rad; its sign and quadrant are exact."""
    ax, ay = abs(x), abs(y)
    longer, shorter = (ax, ay) if ax > ay else (ay, ax)
    t = shorter / (longer + 1e-300)
    q = t * t
    # least maximum error on [0, 1], degree 11
    a = t * (
        0.99997726
        + q * (-0.33262347 + q * (0.19354346 + q * (-0.11643287 + q * (0.05265332 - q * 0.01172120))))
    )
    if ay > ax:
        a = 0.5 * math.pi - a
    if x < 0.0:
        a = math.pi - a
    return -a if y < 0.0 else a


@kernel
def _cover(counts, x0, y0, resolution, points, radius, count, spans):  # type: ignore[no-untyped-def]
    """Add to the cells whose middle lies within a radius of a point, once for each point."""
    rows, columns = counts.shape
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        r0 = max(0, int(math.floor((y - radius - y0) / resolution)))
        r1 = min(rows - 1, int(math.floor((y + radius - y0) / resolution)))
        c0 = max(0, int(math.floor((x - radius - x0) / resolution)))
        c1 = min(columns - 1, int(math.floor((x + radius - x0) / resolution)))
        for row in range(r0, r1 + 1):
            widen(spans, row, c0, c1)
            dy = y0 + (row + 0.5) * resolution - y
            for column in range(c0, c1 + 1):
                dx = x0 + (column + 0.5) * resolution - x
                counts[row, column] += count * _within(dx, dy, dx * dx + dy * dy, radius, radius * radius)
