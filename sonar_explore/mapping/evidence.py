"""The evidence of all scans in the map frame: placed anew where a scan is believed to stand elsewhere."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.mapping.grid import Mask
from sonar_explore.mapping.looks import BINS, Look


class Rows:
    """Rows of all scans, one scan after the other."""

    def __init__(self, columns: int) -> None:
        self._held: Array = np.empty((64, columns))
        self._first: NDArray[np.int64] = np.zeros(65, dtype=np.int64)
        self._scans = 0

    @property
    def all(self) -> Array:
        """Shape (rows, columns)."""
        return self._held[: self._first[self._scans]]

    @property
    def first(self) -> NDArray[np.int64]:
        """Those of scan i are the rows from `first[i]` to `first[i + 1]`, shape (scans + 1,)."""
        return self._first[: self._scans + 1]

    def put(self, scan: int, rows: Array) -> None:
        """Those of a scan, shape (n, columns), instead of those of before; new ones come in order."""
        if scan == self._scans:
            self._make_room(len(rows))
            self._scans += 1
            self._first[scan + 1] = self._first[scan] + len(rows)
        more = len(rows) - int(self._first[scan + 1] - self._first[scan])
        if more:
            end, after = self._first[scan + 1], self.all[self._first[scan + 1] :].copy()
            self._make_room(max(0, more))
            self._held[end + more : end + more + len(after)] = after
            self._first[scan + 1 :] += more
        self._held[self._first[scan] : self._first[scan + 1]] = rows

    def _make_room(self, more: int) -> None:
        """For one scan, and for so many rows."""
        if self._scans + 2 > len(self._first):
            self._first = np.concatenate([self._first, np.zeros_like(self._first)])
        while self._first[self._scans] + more > len(self._held):
            self._held = np.concatenate([self._held, np.empty_like(self._held)])


def others(new: Sequence[object], old: Sequence[object]) -> list[int]:
    """Where one is not the very one that was there before, as far as there was any."""
    found: list[int] = np.flatnonzero(np.fromiter(map(operator.is_not, new, old), dtype=bool)).tolist()
    return found


class Standing:
    """Pieces of wall that stand with a scan each, map frame: placed anew where the scan is."""

    def __init__(self) -> None:
        self._by: list[Pose] = []
        self._pieces: list[Array] = []
        self._placed: Array = np.zeros((0, 4))

    def at(self, poses: Sequence[Pose], pieces: Sequence[tuple[int, Array]]) -> Array:
        """Where they stand, shape (n, 4), [m].

        Args:
            poses: of all scans.
            pieces: index of the scan and ends in its frame, shape (1, 4), of each, [m].
        """
        by, own = [poses[scan] for scan, _ in pieces], [piece for _, piece in pieces]
        known, before = len(self._by), self._placed
        changed = {*others(by, self._by), *others(own, self._pieces), *range(known, len(by))}
        self._placed = np.empty((len(by), 4))
        self._placed[:known] = before[: len(by)]
        for i in changed:
            self._placed[i] = by[i].transform(own[i].reshape(-1, 2)).reshape(-1)
        self._by, self._pieces = by, own
        return self._placed


class Evidence:
    """What scans say, by scan, and where each stands; map frame, [m] and [rad]."""

    def __init__(self, still_m: float, far_still_m: float, lever_m: float) -> None:
        """
        Args:
            still_m: a scan that no point of moved farther than this stays where it is,
            far_still_m: and one that is far away if they moved no farther than this,
            lever_m: if its points are no farther from it than this.
        """
        self._still_m, self._far_still_m, self._lever_m = still_m, far_still_m, lever_m
        self.waits = False
        """Whether scans that are far away stand elsewhere than they are placed."""
        self.version = 0
        """Counts what was placed anew."""
        self.poses: list[Pose] = []
        """Where the scans are placed."""
        self._told: list[Pose] = []
        """Where they are said to stand,"""
        self._told_at: Array = np.empty((64, 3))
        """and the same as rows, x y heading; there is room for more."""
        self._looks: list[Look] = []
        self._believed = Rows(3)
        """Where they were believed to stand when somebody last asked whether they are to be placed anew."""
        self.at = Rows(3)
        """`poses`, x y heading."""
        self.clear_m, self.core_m, self.reach_m = Rows(BINS), Rows(BINS), Rows(1)
        """As `Look` has them."""
        self.walls, self.continuations, self.bounds, self.points = Rows(4), Rows(4), Rows(4), Rows(2)
        self._kinds = self.walls, self.continuations, self.bounds, self.points

    def place(self, poses: Sequence[Pose], looks: Sequence[Look], fresh_m: float = math.inf) -> None:
        """Place what scans say that are new or stand elsewhere now.

        Args:
            poses, looks: of all scans.
            fresh_m: scans farther than this from the last, [m], may wait until they have moved farther.
        """
        known, now = len(self.poses), self._as_rows(poses)
        again = np.ones(len(poses), dtype=bool)  # new ones
        again[:known] = (now[:known] != self._believed.all).any(axis=1)
        told = others(looks, self._looks)
        again[told] = False
        moved = np.flatnonzero(again[:known])
        waits = moved[self._may_wait(moved, now, fresh_m)] if len(moved) and fresh_m < math.inf else moved[:0]
        self.waits, again[waits], again[told] = len(waits) > 0, False, True
        for i in np.flatnonzero(again).tolist():
            self._put(i, poses[i], looks[i])

    @property
    def believed_at(self) -> Array:
        """Where they were last believed to stand, x y, shape (scans, 2)."""
        return self._believed.all[:, :2]

    def _as_rows(self, poses: Sequence[Pose]) -> Array:
        """x y heading of all scans: most are the very poses of the last time."""
        known = len(self._told)
        new = [*others(poses, self._told), *range(known, len(poses))]
        while len(poses) > len(self._told_at):
            self._told_at = np.concatenate([self._told_at, np.empty_like(self._told_at)])
        if new:
            self._told_at[new] = [poses[i].as_row() for i in new]
        self._told = list(poses)
        return self._told_at[: len(poses)]

    def _may_wait(self, scans: NDArray[np.intp], now: Array, fresh_m: float) -> Mask:
        """Which of these scans, that moved, are far from the last one and have moved little, shape (n,); `now`: where
        all stand, shape (scans, 3)."""
        here, stand, stood = now[-1, :2], now[scans], self.at.all[scans]
        nearest = np.minimum(np.hypot(*(stand[:, :2] - here).T), np.hypot(*(stood[:, :2] - here).T))
        return np.asarray((nearest > fresh_m) & (self.moved_m(stand, stood) <= self._far_still_m))

    def moved_m(self, now: Array, was: Array) -> Array:
        """How far points of scans may have moved, that stand and stood here, x y [m] heading [rad], shape (n, 3)."""
        off = now - was
        return np.asarray(np.hypot(off[:, 0], off[:, 1]) + np.abs(wrap_angle(off[:, 2])) * self._lever_m)

    def _put(self, scan: int, pose: Pose, look: Look) -> None:
        new = scan == len(self.poses) or look is not self._looks[scan]
        self._believed.put(scan, np.array([pose.as_row()]))
        if scan < len(self.poses) and self._is_still(self.poses[scan], pose):
            if not new:
                return
            pose = self.poses[scan]
        self.version += 1
        self.poses[scan : scan + 1] = [pose]
        self.at.put(scan, np.array([pose.as_row()]))
        if new:
            self._looks[scan : scan + 1] = [look]
            self.clear_m.put(scan, look.clear_m[None])
            self.core_m.put(scan, look.core_m[None])
            self.reach_m.put(scan, np.array([[look.reach_m]]))
        placed, begin = pose.transform(look.outline), 0
        for rows, own in zip(self._kinds, look.kinds, strict=True):
            if new or len(own):
                end = begin + own.size // 2
                rows.put(scan, placed[begin:end].reshape(own.shape))
                begin = end

    def _is_still(self, placed: Pose, pose: Pose) -> bool:
        turned_m = abs(wrap_angle(pose.heading - placed.heading)) * self._lever_m
        return placed is pose or placed.distance_to(pose) + turned_m <= self._still_m
