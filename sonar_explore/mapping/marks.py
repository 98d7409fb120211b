"""How many walls, points and gaps each cell has: kept from map to map, and marked anew only where they changed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.changes import Spans, widen
from sonar_explore.mapping.grid import GridFrame
from sonar_explore.mapping.rows import differing_rows

Counts = NDArray[np.int16]


class Marks:
    """How many segments of one kind pass each cell."""

    def __init__(self) -> None:
        self.counts: Counts = np.zeros((0, 0), dtype=np.int16)
        """Shape (rows, columns)."""
        self._frame: GridFrame | None = None
        self._segments: Array = np.zeros((0, 4))

    def put(self, frame: GridFrame, segments: Array, spans: Spans) -> tuple[Array, Array]:
        """These and no others; on another frame all are marked anew, for rounding may put them elsewhere there.

        Args:
            segments: shape (n, 4), map frame, [m]; of a point both ends are the same.
            spans: are widened by the cells whose counts change.

        Returns:
            Those that went, and those that came, shape (k, 4) both.
        """
        gone, come = changed = differing_rows(self._segments, segments)
        if frame != self._frame:
            self.counts, self._frame = np.zeros(frame.shape, dtype=np.int16), frame
            gone, come = gone[:0], segments
        at = frame.x0, frame.y0, frame.resolution_m
        _mark_segments(self.counts, *at, gone, -1, spans)
        _mark_segments(self.counts, *at, come, 1, spans)
        self._segments = segments
        return changed


@kernel
def _mark_segments(counts, x0, y0, resolution, segments, one, spans):  # type: ignore[no-untyped-def]
    """Add one to each cell that a segment passes, once for each segment."""
    rows, columns = counts.shape
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
                counts[row, column] += one
                widen(spans, row, column, column)
