"""The loops behind the grid: how far each direction is clear, which cells that clears, which a wall passes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.grid import GridFrame, Mask

Counts = NDArray[np.int32]


def cut_at_walls(
    x: float, y: float, heading: float, clear_m: Array, barriers: Array, own: Array, margin_m: float
) -> Array:
    """Shorten each direction to the nearest barrier it meets.

    Args:
        x, y, heading: where the scan was taken, map frame, [m] and [rad].
        clear_m: how far each of n equal sectors about the robot is clear, shape (n,), [m].
        barriers, own: segments in the map frame, shape (k, 4), [m].
        margin_m: how far before a barrier to stop, [m].
    """
    out = clear_m.copy()
    _cut(x, y, heading, out, barriers, margin_m)
    _cut(x, y, heading, out, own, margin_m)
    return np.maximum(out, 0.0)


class Sectors:
    """How many scans have cleared each cell, and where the body has been.

    A scan that moved or was cut anew is taken off and put on again, and with it the way driven since.
    """

    def __init__(self) -> None:
        self._frame: GridFrame | None = None
        self._put: list[tuple[Pose, Array, Array]] = []
        self._trails: list[tuple[Pose, Array]] = []
        self.cleared: Counts = np.zeros((0, 0), dtype=np.int32)
        """By any reading, shape (rows, columns)."""
        self.core: Counts = np.zeros((0, 0), dtype=np.int32)
        """For certain, shape (rows, columns)."""
        self._body: Counts = np.zeros((0, 0), dtype=np.int32)

    def resize(self, frame: GridFrame) -> None:
        """Go over to a grown frame; counts keep their places."""
        old, self._frame = self._frame, frame
        if old == frame:
            return
        for name in ("cleared", "core", "_body"):
            grown = np.zeros(frame.shape, dtype=np.int32)
            if old is not None:
                row = round((old.y0 - frame.y0) / frame.resolution_m)
                column = round((old.x0 - frame.x0) / frame.resolution_m)
                grown[row : row + old.shape[0], column : column + old.shape[1]] = getattr(self, name)
            setattr(self, name, grown)

    def put(self, index: int, pose: Pose, clear_m: Array, core_m: Array) -> None:
        """What a scan clears by direction, shape (n,) both, [m]; replaces what it cleared before."""
        if index == len(self._put):
            self._put.append((pose, clear_m, core_m))
            self._mark(self._put[index], 1)
            return
        before = self._put[index]
        if before[0] == pose and np.array_equal(before[1], clear_m):
            return
        self._mark(before, -1)
        self._put[index] = (pose, clear_m, core_m)
        self._mark(self._put[index], 1)

    def trail(self, index: int, pose: Pose, points: Array, radius_m: float) -> None:
        """Where the body has been since a scan, shape (n, 2), in that scan's frame, [m]; `points` only ever grow."""
        if index == len(self._trails):
            self._trails.append((pose, np.zeros((0, 2))))
        before, covered = self._trails[index]
        if before != pose:
            self._cover(covered, radius_m, -1)
            covered = covered[:0]
        more = pose.transform(points[len(covered) :])
        self._cover(more, radius_m, 1)
        self._trails[index] = (pose, np.vstack([covered, more]))

    @property
    def body(self) -> Mask:
        """Cells that the body has covered, shape (rows, columns)."""
        return self._body > 0

    def _cover(self, points: Array, radius_m: float, count: int) -> None:
        disc = np.full(8, radius_m - 0.5 * self._at[2])
        for x, y in points:
            _mark(self._body, *self._at, x, y, 0.0, disc, count)

    @property
    def _at(self) -> tuple[float, float, float]:
        assert self._frame is not None
        return self._frame.x0, self._frame.y0, self._frame.resolution_m

    def _mark(self, put: tuple[Pose, Array, Array], count: int) -> None:
        pose, clear, core = put
        _mark(self.cleared, *self._at, pose.x, pose.y, pose.heading, clear, count)
        _mark(self.core, *self._at, pose.x, pose.y, pose.heading, core, count)


def mark_segments(frame: GridFrame, evidence: Array, segments: Array, weight: float) -> None:
    """Add a weight to each cell that a segment passes, once per segment; segments in the map frame, (k, 4), [m]."""
    _mark_segments(evidence, frame.x0, frame.y0, frame.resolution_m, segments, weight)


@kernel
def _mark_segments(evidence, x0, y0, resolution, segments, weight):  # type: ignore[no-untyped-def]
    rows, columns = evidence.shape
    for i in range(len(segments)):
        ax, ay = segments[i, 0], segments[i, 1]
        ex, ey = segments[i, 2] - ax, segments[i, 3] - ay
        count = max(1, int(math.ceil(math.hypot(ex, ey) / (0.4 * resolution))))
        last_row, last_column = -1, -1
        for k in range(count + 1):
            row = int(math.floor((ay + ey * k / count - y0) / resolution))
            column = int(math.floor((ax + ex * k / count - x0) / resolution))
            if row == last_row and column == last_column:
                continue
            last_row, last_column = row, column
            if 0 <= row < rows and 0 <= column < columns:
                evidence[row, column] += weight


@kernel
def _cut(x, y, heading, clear, segments, margin):  # type: ignore[no-untyped-def]
    n = len(clear)
    reach = 0.0
    for b in range(n):
        reach = max(reach, clear[b])
    reach += margin
    for i in range(len(segments)):
        ax, ay = segments[i, 0] - x, segments[i, 1] - y
        bx, by = segments[i, 2] - x, segments[i, 3] - y
        ex, ey = bx - ax, by - ay
        length2 = ex * ex + ey * ey
        if length2 < 1e-12:
            continue
        t = min(1.0, max(0.0, -(ax * ex + ay * ey) / length2))
        if math.hypot(ax + t * ex, ay + t * ey) > reach:
            continue
        start = (math.atan2(ay, ax) - heading) / (2.0 * math.pi) * n
        turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by) / (2.0 * math.pi) * n
        if turn < 0.0:
            start += turn
            turn = -turn
        # sectors whose middle ray meets the segment, and the ones that hold its ends
        for b in range(int(math.floor(start)), int(math.floor(start + turn)) + 1):
            middle = (b + 0.5) / n * 2.0 * math.pi + heading
            c, s = math.cos(middle), math.sin(middle)
            denominator = c * ey - s * ex
            r = reach
            if abs(denominator) > 1e-9:
                r = (ax * ey - ay * ex) / denominator
                along = (c * r - ax) * ex + (s * r - ay) * ey
                if along < 0.0 or along > length2 or r < 0.0:
                    r = min(math.hypot(ax, ay), math.hypot(bx, by))
            clear[b % n] = min(clear[b % n], r - margin)


@kernel
def _mark(counts, x0, y0, resolution, x, y, heading, clear, weight):  # type: ignore[no-untyped-def]
    n = len(clear)
    rows, columns = counts.shape
    reach = 0.0
    for b in range(n):
        reach = max(reach, clear[b])
    if reach <= 0.0:
        return
    r0 = max(0, int(math.floor((y - reach - y0) / resolution)))
    r1 = min(rows - 1, int(math.floor((y + reach - y0) / resolution)))
    c0 = max(0, int(math.floor((x - reach - x0) / resolution)))
    c1 = min(columns - 1, int(math.floor((x + reach - x0) / resolution)))
    for row in range(r0, r1 + 1):
        dy = y0 + (row + 0.5) * resolution - y
        for column in range(c0, c1 + 1):
            dx = x0 + (column + 0.5) * resolution - x
            distance = math.hypot(dx, dy)
            if distance > reach:
                continue
            b = int(math.floor((math.atan2(dy, dx) - heading) / (2.0 * math.pi) * n)) % n
            if distance <= clear[b]:
                counts[row, column] += weight
