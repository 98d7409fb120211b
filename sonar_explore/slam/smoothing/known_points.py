"""Every point that was heard so far, by its number, in arrays that grow.

A point that one scan alone heard binds nothing yet: it stays where that scan heard it. From the second scan on it is an
unknown of the smoother's.
"""

from __future__ import annotations

import math
from copy import copy

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.slam.smoothing.factor_graph import doubled
from sonar_explore.slam.turn.sighting import Sighting

STATE, VARIABLE, KIND, FIRST, LAST = range(5)
"""Of each number: whether there is such a point, and how it is known; the variable of the point, or of the one scan
that heard it; its `PointKind`; the first and the last scan that heard it."""
NONE, ONCE, BOUND = range(3)
"""States: no point has this number (any more), one scan heard it, it is an unknown."""


class KnownPoints:
    """What the smoother and the association of points both need to know of them."""

    def __init__(self) -> None:
        self.count = 0
        """One more than the greatest number."""
        self._rows: NDArray[np.int64] = np.zeros((64, 5), dtype=np.int64)
        self._heard: Array = np.zeros((64, 4))

    @property
    def rows(self) -> NDArray[np.int64]:
        """State, variable, kind, first and last scan by number, shape (count, 5)."""
        return self._rows[: self.count]

    @property
    def heard(self) -> Array:
        """As first heard: bearing, sweep [rad], range, radius [m], shape (count, 4)."""
        return self._heard[: self.count]

    def state(self, number: int) -> int:
        """`NONE`, `ONCE` or `BOUND`."""
        return int(self._rows[number, STATE]) if number < self.count else NONE

    def variable(self, number: int) -> int:
        """Of a point that is bound, its own; of one heard once, that of the scan."""
        return int(self._rows[number, VARIABLE])

    def first_heard(self, sighting: Sighting, variable: int) -> None:
        """A new one, by the scan that has this variable."""
        while sighting.what >= len(self._rows):
            self._rows, self._heard = doubled(self._rows), doubled(self._heard)
        self.count = max(self.count, sighting.what + 1)
        self._rows[sighting.what] = ONCE, variable, sighting.kind, sighting.scan, sighting.scan
        self._heard[sighting.what] = self.as_heard(sighting)

    def heard_again(self, number: int, scan: int) -> None:
        """By this scan, the last one so far."""
        self._rows[number, LAST] = scan

    def bind(self, number: int, variable: int) -> None:
        """It is an unknown from now on."""
        self._rows[number, STATE], self._rows[number, VARIABLE] = BOUND, variable

    def put_together(self, survivor: int, absorbed: int) -> None:
        """Two are one."""
        self._rows[survivor, LAST] = self._rows[absorbed, LAST]
        self._rows[absorbed, STATE] = NONE

    @staticmethod
    def as_heard(sighting: Sighting) -> tuple[float, float, float, float]:
        """Bearing, sweep [rad], range, radius [m]."""
        return sighting.bearing_rad, sighting.sweep_rad, sighting.range_m, sighting.radius_m

    def place(self, number: int, values: Array) -> list[float]:
        """Of one point."""
        numbers, places = np.empty(1, dtype=np.int64), np.empty((1, 2))
        one = slice(number, number + 1)
        _place(self._rows[one], self._heard[one], values, numbers, places)
        return [float(value) for value in places[0]]

    def places(self, values: Array) -> tuple[NDArray[np.int64], Array]:
        """Numbers, rising, and places x y [m], shape (n, 2), by these values of the variables."""
        numbers, places = np.empty(self.count, dtype=np.int64), np.empty((self.count, 2))
        n = _place(self.rows, self._heard, values, numbers, places)
        return numbers[:n], places[:n]

    def copy(self) -> KnownPoints:
        """As it is now."""
        out = copy(self)
        out._rows, out._heard = self._rows.copy(), self._heard.copy()
        return out


@lean_kernel
def _place(rows, heard, values, numbers, places):  # type: ignore[no-untyped-def]
    """Number and place of each point; how many."""
    count = 0
    for number in range(len(rows)):
        if rows[number, STATE] == NONE:
            continue
        v = rows[number, VARIABLE]
        x, y = values[v, 0], values[v, 1]
        if rows[number, STATE] == ONCE:
            error = values[0, 0] + values[v, 3]
            angle = values[v, 2] + heard[number, 0] + heard[number, 1] * error
            depth = heard[number, 2] * (1.0 + values[0, 2]) + heard[number, 3]
            x += depth * math.cos(angle)
            y += depth * math.sin(angle)
        numbers[count], places[count, 0], places[count, 1] = number, x, y
        count += 1
    return count
