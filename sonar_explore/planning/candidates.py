"""Candidate scan positions: where the robot can go, what it may see there, and which chains it would meet."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel, lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import Cells, Mask
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.planning.expected import ChainRows, ChainSpans, expected_chains, links_met
from sonar_explore.planning.paths import SafePaths
from sonar_explore.planning.unseen import new_area
from sonar_explore.slam.chains import Chain

_HAIR_M = 1e-6  # more than rounding can do to the length of a way
_HAIR_M2 = 1e-9  # nearer than this to the square of a limit the exact distance decides


@dataclass(frozen=True)
class CandidateConfig:
    """Which places are worth a scan."""

    spacing_m: float = 0.25
    """Distance between neighbouring places on the lattice, [m]."""
    view_m: float = 1.5
    """How far a scan is expected to clear, [m]."""
    least_room_m: float = 0.38
    """Distance of a place from known walls, [m]: nearer ones are in the dead zone, 0.20 m before the disc."""
    least_room_narrow_m: float = 0.25
    """And in a door narrower than twice that, where nothing else is left, [m]: from before it little is seen."""
    chain_grows_m: float = 0.4
    """How far beyond its links a chain is expected to go on, [m]: a new link may lie half a door away."""
    least_area_m2: float = 0.5
    """New area below which a place is not worth a scan, [m2],"""
    area_per_m: float = 0.1
    """and how much more for each metre of the way there: nobody crosses a building for a crumb, [m2/m];"""
    enough_m2: float = 1.5
    """but so much is worth any way, [m2]: a room is more than a crumb however far off it is."""
    apart_m: float = 0.30
    """Least distance from every earlier scan position and from places put aside, [m]."""
    most: int = 32
    """Candidates offered at once."""


@dataclass(frozen=True)
class Candidate:
    """One place for the next scan."""

    x: float
    """Map frame, [m]."""
    y: float
    """[m]"""
    path_length_m: float
    """Cheapest safe path from here, weighted by discomfort, [m]."""
    new_area_m2: float
    """Unknown area that the body could occupy, within view and in line of sight, [m2]."""
    chains: tuple[int, ...]
    """Ids of the chains that should answer there: the foot of the normal lies on them, near and in sight."""
    certainty: float
    """Sum of P(root) of those chains, by the better of each direction: 2 where two walls across each other are sure."""
    missing_links: tuple[int, ...]
    """Ids of dangling chains that should answer there together with a normal chain."""


class CandidateFinder:
    """Finds candidate scan positions on a lattice over the reachable free space."""

    def __init__(
        self, config: CandidateConfig, body_radius_m: float, range_min_m: float, range_max_m: float
    ) -> None:
        self._config = config
        self._body = body_radius_m
        self._heard = range_min_m, range_max_m, config.chain_grows_m
        """How near and how far a chain is heard, and how far beyond its links it is expected to go on, [m]."""
        self._spans = ChainSpans()

    def find(
        self,
        grid: OccupancyGrid,
        paths: SafePaths,
        chains: Sequence[Chain],
        scanned: Array,
        put_aside: Array,
        tried: Mapping[int, int] | None,
        worth: CandidateConfig | None = None,
    ) -> tuple[Candidate, ...]:
        """The most promising places, the largest new area per path first.

        Args:
            grid: the map.
            paths: safe paths from where the robot is.
            chains: the chain map.
            scanned: scan positions so far, shape (n, 2), map frame, [m].
            put_aside: places that could not be got to, shape (k, 2), map frame, [m].
            tried: how often the missing link of each dangling chain was looked for; None where none is any more.
            worth: which places are worth a scan; None as configured.
        """
        worth = worth or self._config
        cells = paths.roomiest(grid.to_walls_m, worth.least_room_m, worth.spacing_m)
        places = grid.frame.centres(cells)
        away = _away_from(places, np.concatenate([scanned, put_aside]), worth.apart_m)
        cells, places = cells[away], places[away]
        if not len(cells):
            return ()
        area = new_area(grid, cells, self._body, worth.view_m)
        known = self._spans.of(chains)
        spans, dangling = known.spans, _sought(known, tried)
        meets = np.zeros(len(places), dtype=bool)
        if dangling.any():
            meets = links_met(places, spans, dangling, grid, *self._heard)
        limits = worth.least_area_m2, worth.area_per_m, max(worth.least_area_m2, worth.enough_m2)
        farthest = np.empty(len(places))  # how long the way to others is nobody asks
        x, y = grid.frame.centres(np.array([paths.start]))[0].tolist()
        _reach_worth(places, area, meets, x, y, limits, farthest)
        worthy = farthest >= 0.0
        if not worthy.any():
            return ()
        cells, places, area, meets = cells[worthy], places[worthy], area[worthy], meets[worthy]
        length, score = paths.costs_to_m(cells, farthest[worthy]), np.empty(len(cells))
        if not _score(area, length, meets, limits, score):
            return ()
        chosen = self._spread(places, score)
        answers = expected_chains(places[chosen], spans, grid, *self._heard)
        place, answering = np.nonzero(answers)
        certainty = _certainty(known.certain, known.directions, place, answering, len(chosen))
        ids = [known.ids[i] for i in answering.tolist()]
        missing = dangling[answering].tolist()
        ends = np.cumsum(np.bincount(place, minlength=len(chosen))).tolist()
        return tuple(
            Candidate(
                x=x,
                y=y,
                path_length_m=length_m,
                new_area_m2=area_m2,
                chains=tuple(ids[first:end]),
                certainty=sure,
                missing_links=tuple(compress(ids[first:end], missing[first:end])) if meeting else (),
            )
            for (x, y), length_m, area_m2, meeting, sure, first, end in zip(
                places[chosen].tolist(),
                length[chosen].tolist(),
                area[chosen].tolist(),
                meets[chosen].tolist(),
                certainty.tolist(),
                [0, *ends],
                ends,
                strict=False,
            )
        )

    def roomy(self, grid: OccupancyGrid, cells: Cells) -> Mask:
        """Which cells, shape (n, 2), are far enough from known walls for a scan, shape (n,)."""
        return np.asarray(grid.to_walls_m[cells[:, 0], cells[:, 1]] >= self._config.least_room_m)

    def _spread(self, places: Array, score: Array) -> NDArray[np.int64]:
        """The best places, none within twice the lattice spacing of a better one while others are left."""
        order = np.argsort(-score, kind="stable")
        order = order[: np.count_nonzero(score > 0.0)]
        chosen = np.empty(min(self._config.most, len(order)), dtype=np.int64)
        _apart(places[order], 2.0 * self._config.spacing_m, chosen)
        return np.asarray(order[chosen])


def _sought(known: ChainRows, tried: Mapping[int, int] | None) -> Mask:
    """The chains whose missing link is worth looking for, shape (n,)."""
    sought = np.zeros(len(known.ids), dtype=bool)
    if tried is not None:
        for i in np.flatnonzero(known.dangling).tolist():
            sought[i] = tried.get(known.ids[i], 0) < 2
    return sought


def _away_from(places: Array, taken: Array, least_m: float) -> Mask:
    """Which places, shape (n, 2), have none of those taken, shape (k, 2), within a distance, shape (n,)."""
    return np.asarray(_none_near(places, taken[np.argsort(taken[:, 0])], least_m))


@kernel
def _none_near(places, taken, least):  # type: ignore[no-untyped-def]
    """`taken`: by their x."""
    away = np.ones(len(places), dtype=np.bool_)
    for i in range(len(places)):
        first, end = 0, len(taken)  # the first that is not too far to the left, by halves
        while first < end:
            middle = (first + end) >> 1
            if taken[middle, 0] <= places[i, 0] - least - 1e-9:
                first = middle + 1
            else:
                end = middle
        for j in range(first, len(taken)):
            dx, dy = taken[j, 0] - places[i, 0], abs(places[i, 1] - taken[j, 1])
            if dx >= least:
                break
            if dy < least and math.hypot(dx, dy) < least:
                away[i] = False
                break
    return away


@lean_kernel
def _reach_worth(places, area, meets, x, y, limits, farthest):  # type: ignore[no-untyped-def]
    """How far each place may be from x y, by ways weighted by discomfort, to be worth a scan, and a hair more;
    -1 where it is none however near, or lies farther even as the crow flies."""
    least, per_m, most = limits
    for i in range(len(places)):
        reach = -1.0
        if meets[i] or area[i] >= most:
            reach = np.inf
        elif area[i] >= least:
            reach = (area[i] - least) / max(per_m, 1e-9) + _HAIR_M
        off = math.hypot(places[i, 0] - x, places[i, 1] - y)
        farthest[i] = reach if off <= reach else -1.0


@lean_kernel
def _score(area, length, meets, limits, score):  # type: ignore[no-untyped-def]
    """New area per path of places worth a scan, of the others 0; whether there are any."""
    least, per_m, most = limits
    some = False
    for i in range(len(area)):
        enough = area[i] >= min(least + per_m * length[i], most)
        some |= enough or meets[i]
        score[i] = ((area[i] if enough else 0.0) + 0.2 * meets[i]) / (1.0 + length[i])
    return some


@kernel
def _apart(places, least, chosen):  # type: ignore[no-untyped-def]
    """Which places, best first: those with none of them that are better within a distance, then others; as many as
    there is room for."""
    count, left, others = 0, 0, np.empty(len(places), dtype=np.int64)
    for i in range(len(places)):
        if count == len(chosen):
            break
        alone = True
        for k in range(count):
            dx, dy = places[i, 0] - places[chosen[k], 0], places[i, 1] - places[chosen[k], 1]
            square = dx * dx + dy * dy
            if square < least * least - _HAIR_M2 or (
                square < least * least + _HAIR_M2 and math.hypot(dx, dy) < least
            ):
                alone = False
                break
        if alone:
            chosen[count] = i
            count += 1
        else:
            others[left] = i
            left += 1
    for k in range(len(chosen) - count):
        chosen[count + k] = others[k]


def _certainty(
    probabilities: Array,
    directions: Array,
    place: NDArray[np.intp],
    answering: NDArray[np.intp],
    places: int,
) -> Array:
    """How sure the position is across and along the surest chain that answers at each of so many places: 0 to 2.

    Args:
        probabilities, directions: P(root) and direction [rad] of each chain, shape (k,).
        place, answering: at which place which chain answers, by places, shape (n,) both.
    """
    out = np.zeros(places)
    if len(place):
        certain = probabilities[answering]
        begins = np.flatnonzero(np.diff(place, prepend=-1))
        most = np.maximum.reduceat(certain, begins)
        which = np.cumsum(np.diff(place, prepend=place[0]) > 0)
        first = np.flatnonzero(certain == most[which])  # the surest ones, of each place the first
        surest = answering[first[np.searchsorted(first, begins)]]
        crossing = np.abs(np.sin(directions[answering] - directions[surest][which])) * certain
        out[place[begins]] = most + np.maximum.reduceat(crossing, begins)
    return out
