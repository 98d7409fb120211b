"""Places that the robot was kept from: which of them are not worth another try, here and now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sonar_explore.geometry import Array, Pose
from sonar_explore.planning.surroundings import Anchored, Surroundings

SHUT_NEAR_M = 1.5  # stopped farther from a place than this, the way was shut and not the place


@dataclass
class _Shut:
    """A drive that found its way shut."""

    place: Anchored
    """Where it was going,"""
    at: Anchored
    """and where it ended."""
    left: bool = False
    """Whether the robot has gone elsewhere since."""


class PutAside:
    """Drives that found their way shut, anchored to scans: they move with a correction. True where there are any."""

    def __init__(self, surroundings: Surroundings, apart_m: float) -> None:
        """Places within `apart_m` of each other are one."""
        self._surroundings = surroundings
        self._apart_m = apart_m
        self._shut: list[_Shut] = []

    def __bool__(self) -> bool:
        return bool(self._shut)

    def add(self, place: tuple[float, float], here: Pose) -> None:
        """On the way to this place x y, [m], the robot was stopped here; map frame both."""
        anchored = self._surroundings.anchored
        self._shut.append(_Shut(anchored(*place), anchored(here.x, here.y)))

    def forget(self) -> None:
        """All of them."""
        self._shut = []

    @property
    def all(self) -> list[tuple[float, float]]:
        """Every such place, x y, map frame, [m]."""
        return self._surroundings.placed([shut.place for shut in self._shut])

    def at(self, pose: Pose) -> list[tuple[float, float]]:
        """Places not to be offered here, x y, [m]: the robot was stopped near them, or on two ways there.

        One that it was stopped far from is another matter once the robot has gone elsewhere: there may be a way from
        there.
        """
        if not self._shut:
            return []
        places = np.array(self.all)
        stops = np.array(self._surroundings.placed([shut.at for shut in self._shut]))
        for shut, gone in zip(self._shut, _apart(stops, (pose.x, pose.y)) > SHUT_NEAR_M, strict=True):
            shut.left |= bool(gone)
        left = np.array([shut.left for shut in self._shut])
        aside = _has_others(places, self._apart_m) | ~left | (_apart(places, stops) <= SHUT_NEAR_M)
        return [(x, y) for x, y in places[aside].tolist()]


def _apart(places: Array, others: ArrayLike) -> Array:
    """Distances between places x y, shape (..., 2) both, [m]."""
    return np.asarray(np.hypot(*np.moveaxis(places - np.asarray(others), -1, 0)))


def _has_others(places: Array, within_m: float) -> NDArray[np.bool_]:
    """Which places x y, shape (n, 2), have another one of them so near, shape (n,), [m]."""
    x, y = places.T
    i, j = np.nonzero((np.abs(x[:, None] - x) <= within_m) & (np.abs(y[:, None] - y) <= within_m))
    near = _apart(places[i], places[j]) <= within_m
    return np.bincount(i[near], minlength=len(places)) > 1
