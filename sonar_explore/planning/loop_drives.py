"""Drives that close a loop which was explored from both sides but not driven round (`loops.py` finds them)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose
from sonar_explore.planning.candidates import Candidate
from sonar_explore.planning.loops import blocks_of, open_loops, went_round
from sonar_explore.planning.paths import path_length
from sonar_explore.planning.put_aside import PutAside
from sonar_explore.planning.surroundings import Anchored, Surroundings
from sonar_explore.slam import Slam

LOOP_TRIPS = 12  # drives to close loops
LOOP_GOAL_M = 0.3  # nearer to where two of them went, none is sent any more
SAME_PLACE_M = 0.05  # nearer to a place put aside is that place: elsewhere the robot has stood


class LoopDrives:
    """Offers the next of these drives, and learns where they went."""

    def __init__(
        self,
        surroundings: Surroundings,
        slam: Slam,
        put_aside: PutAside,
        apart_m: float,
        trips: int,
    ) -> None:
        """There are so many trips; no drive is shorter than `apart_m`."""
        self._surroundings = surroundings
        self._slam = slam
        self._put_aside = put_aside
        self._apart_m = apart_m
        self._trips = trips
        self._goals: list[Anchored] = []
        """Where they ended, or should have, anchored."""

    def went(self, place: tuple[float, float]) -> None:
        """One of them went to this place, x y, map frame, [m]."""
        self._goals.append(self._surroundings.anchored(*place))

    def next(self, pose: Pose) -> tuple[Candidate, ...]:
        """The last stretch of a loop to drive, or where that stretch begins to go to."""
        if not self._trips:
            return ()
        here = self._surroundings
        paths = here.paths(pose)
        offers: list[tuple[bool, Candidate]] = []
        trail, scans = here.way_so_far()
        put_aside, been_sent = self._put_aside.all, here.placed(self._goals)
        for loop in open_loops(trail, scans, here.grid):
            for x, y in loop.goals.tolist():
                path = paths.to(x, y)
                aside = any(math.hypot(x - a, y - b) <= SAME_PLACE_M for a, b in put_aside)
                aside |= sum(math.hypot(x - a, y - b) <= LOOP_GOAL_M for a, b in been_sent) > 1
                if path is None or aside or math.hypot(x - pose.x, y - pose.y) <= self._apart_m:
                    continue
                offers.append((not loop.closed_by(path), _scan_at(x, y, path)))
        if not offers:
            offers = [(False, home) for home in self._home(pose, trail, scans)]
        if not offers:
            return ()
        self._trips -= 1
        return (min(offers, key=lambda offer: (offer[0], offer[1].path_length_m))[1],)

    def _home(self, pose: Pose, trail: Array, scans: NDArray[np.intp]) -> tuple[Candidate, ...]:
        """The first scan position, where the way went round a block and met no wall of the first scan since."""
        round_at = went_round(trail, blocks_of(self._surroundings.grid))
        if round_at is None:
            return ()
        since = int(np.searchsorted(scans, round_at))
        for chain in self._slam.chains.chains:
            seen = {link.scan for link in chain.links}
            if 0 in seen and max(seen) >= since:
                return ()
        x, y = trail[0].tolist()
        path = self._surroundings.paths(pose).to(x, y)
        return () if path is None else (_scan_at(x, y, path),)


def _scan_at(x: float, y: float, path: Array) -> Candidate:
    """A place to go to for its own sake."""
    return Candidate(x, y, path_length(path), 0.0, (), 0.0, ())
