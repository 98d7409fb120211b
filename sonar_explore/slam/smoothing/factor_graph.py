"""Unknowns and what was measured of them, in arrays that grow: the smoother's least-squares problem.

Every measurement is a factor of one variable or two, and of the constants of the robot, which all are tied to.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from copy import copy
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array

CONSTANTS = 0
"""The variable that every factor is tied to: turn error, bend [rad/m] and scale of the ranges."""
NO_LIMITS: Array = np.full(4, np.inf)
"""Of a variable that may be as far from its anchor as it likes."""


T = TypeVar("T", bound=np.generic)


class FactorKind(enum.IntEnum):
    """What a factor says, and what it has in `measured`."""

    START = 0
    """A pose stands here: x, y [m], heading [rad]."""
    ROBOT = 1
    """The constants are about zero: one over the standard deviation of each."""
    TURN = 2
    """Of a pose's own turn: one over its standard deviation; what the discs say, one over the standard deviation of
    that, 0 where they say nothing."""
    ODOMETRY = 3
    """From a pose to another: what whitens it, lower triangle by rows (6); the change (3); its derivatives by the
    wheels, by rows (6), and by the own turn (3)."""
    LINE = 4
    """A pose hears a line: bearing, sweep [rad], range [m]; one over the standard deviations of bearing and range."""
    POINT = 5
    """Likewise a point."""
    COLUMN = 6
    """Likewise a column."""
    RADIUS = 7
    """Of a column: the radius that its widths tell [m], one over its standard deviation."""


class FactorGraph:
    """Variables of up to four numbers each, and factors."""

    def __init__(self) -> None:
        self.variables = 0
        """How many there are."""
        self.factors = 0
        """How many there are."""
        self._values: Array = np.zeros((64, 4))
        self._anchors: Array = np.zeros((64, 4))
        self._limits: Array = np.zeros((64, 4))
        self._dims: NDArray[np.int64] = np.zeros(64, dtype=np.int64)
        self._kinds: NDArray[np.int64] = np.zeros(256, dtype=np.int64)
        self._ends: NDArray[np.int64] = np.zeros((256, 2), dtype=np.int64)
        self._measured: Array = np.zeros((256, 18))
        self._rows: Array = np.zeros((256, 3, 11))
        self._off: Array = np.zeros((256, 3))
        self.shared: Array = np.zeros((3, 4))
        """What all factors have of the constants alone: J'J, and J'r in the last column."""

    @property
    def values(self) -> Array:
        """Of each variable, shape (variables, 4): a pose's x, y [m], heading [rad] and own turn's error; a line's angle
        [rad] and distance [m]; a point's x, y, and a column's radius [m]; the constants."""
        return self._values[: self.variables]

    @property
    def anchors(self) -> Array:
        """The values at which the factors of each variable were linearised, shape (variables, 4)."""
        return self._anchors[: self.variables]

    @property
    def limits(self) -> Array:
        """How far each may be from them before they are linearised anew, shape (variables, 4)."""
        return self._limits[: self.variables]

    @property
    def dims(self) -> NDArray[np.int64]:
        """How many numbers each variable has, shape (variables,)."""
        return self._dims[: self.variables]

    @property
    def kinds(self) -> NDArray[np.int64]:
        """`FactorKind` of each factor, shape (factors,)."""
        return self._kinds[: self.factors]

    @property
    def ends(self) -> NDArray[np.int64]:
        """Its variables beside the constants, the second -1 where there is none, shape (factors, 2)."""
        return self._ends[: self.factors]

    @property
    def measured(self) -> Array:
        """By each factor, as its kind says, shape (factors, 18)."""
        return self._measured[: self.factors]

    @property
    def rows(self) -> Array:
        """What each factor has put into the normal equations: its rows of the Jacobian, by the first variable, by the
        second, by the constants, shape (factors, 3, 11)."""
        return self._rows[: self.factors]

    @property
    def off(self) -> Array:
        """And its residuals, at the anchors, shape (factors, 3)."""
        return self._off[: self.factors]

    def add_variable(self, *values: float, limits: Array = NO_LIMITS) -> int:
        """First guess of a new one, and its `limits`, shape (4,); its number."""
        k = self.variables
        if k == len(self._dims):
            for name in ("_values", "_anchors", "_limits", "_dims"):
                setattr(self, name, doubled(getattr(self, name)))
        self._values[k, : len(values)] = values
        self._anchors[k], self._limits[k], self._dims[k] = self._values[k], limits, len(values)
        self.variables += 1
        return k

    def add_factor(self, kind: FactorKind, first: int, second: int, measured: Sequence[float]) -> int:
        """A new one; its number."""
        k = self.factors
        if k == len(self._kinds):
            for name in ("_kinds", "_ends", "_measured", "_rows", "_off"):
                setattr(self, name, doubled(getattr(self, name)))
        self._kinds[k], self._ends[k, 0], self._ends[k, 1] = kind, first, second
        if measured:
            self._measured[k, : len(measured)] = measured
        self.factors += 1
        return k

    def put_together(self, survivor: int, absorbed: int) -> list[int]:
        """What was heard of two variables is of one; who heard the one that goes."""
        moved = self.ends[:, 1] == absorbed
        self.ends[moved, 1] = survivor
        heard: list[int] = self.ends[moved, 0].tolist()
        return heard

    def drop(self, factor: int) -> None:
        """It says nothing any more."""
        self.measured[factor] = 0.0

    def copy(self) -> FactorGraph:
        """As it is now."""
        out = copy(self)
        names = (
            "_values",
            "_anchors",
            "_limits",
            "_dims",
            "_kinds",
            "_ends",
            "_measured",
            "_rows",
            "_off",
            "shared",
        )
        for name in names:
            setattr(out, name, getattr(self, name).copy())
        return out


def doubled(array: NDArray[T]) -> NDArray[T]:
    """With as many rows again, zeros."""
    return np.concatenate([array, np.zeros_like(array)])
