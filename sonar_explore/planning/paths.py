"""Safe paths: clearance from everything that is not known to be free, with a preference for the middle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.distance import Distances
from sonar_explore.mapping.grid import OCCUPIED, GridFrame, Mask, States
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.mapping.regions import WithoutHoles
from sonar_explore.planning.cheapest import cheapest_costs, cheapest_way
from sonar_explore.planning.polyline import fewer_corners

TOLERANCES_M = (0.10, 0.05, 0.025)  # how far a straightened path may leave the cells of the cheapest one


@dataclass(frozen=True)
class PlanningConfig:
    """How much room a path keeps."""

    margin_m: float = 0.04
    """Least room beside the body, [m]."""
    comfort_m: float = 0.45
    """Distance from walls below which a path costs more, [m]."""
    comfort_weight: float = 6.0
    """How many times dearer a cell at the least room is than one in the open."""
    speck_m2: float = 0.05
    """Unknown specks up to this size inside free space do not shut it, [m2]."""
    leg_m: float = 1.5
    """A longer way is driven in legs of about this length, with a scan after each, [m]."""
    close_loops: bool = True
    """When nothing is left to explore, drive the last stretch of loops that were seen all round, and back to the first
    scan where none of its walls was met again."""
    unknown_credit_m: float = 0.08
    """When nothing else is left, the unknown may come nearer than a wall by this, [m]."""
    daring_margin_m: float = -0.02
    """And gaps that the map draws too narrow are tried: the ring of eight knows better there, [m]."""
    escape_m: float = 0.30
    """A start without room may be left over any cells but walls, within this distance of it, [m]."""


class SafePaths:
    """All cheapest safe paths from one place (Dijkstra over 8-connected cells)."""

    def __init__(
        self,
        grid: OccupancyGrid,
        x: float,
        y: float,
        body_radius_m: float,
        config: PlanningConfig,
        daring: bool = False,
    ) -> None:
        """
        Args:
            grid: the map.
            x, y: where the paths begin, map frame, [m].
            body_radius_m: of the disc that must pass, [m].
            config: how much room a path keeps.
            daring: whether to go nearer to walls and to the unknown than one should.
        """
        self.frame: GridFrame = grid.frame
        res = grid.frame.resolution_m
        room = clearance(grid, config)
        if daring:
            room = np.minimum(room + config.unknown_credit_m, grid.to_walls_m - 0.5 * res)
        least = body_radius_m + (config.daring_margin_m if daring else config.margin_m)
        start = grid.frame.cell(x, y)
        cost = np.empty(room.shape)
        _fill_costs(room, least, config.comfort_m, config.comfort_weight, cost)
        if room[start] < least:
            leave = _escape_zone(grid, start, config.escape_m) & (room < least)
            cost[leave] = 1.0 + 2.0 * config.comfort_weight
            cost[start] = 1.0
        self.room_m = room
        """Distance of each cell to the nearest cell that is not free, shape (rows, columns), [m]."""
        self._cell_costs = cost
        self._costs = cheapest_costs(cost, start)
        self.within = (self._costs < np.inf) & (room >= least)
        """Cells that the body can be driven to, shape (rows, columns)."""

    @property
    def cost_m(self) -> Array:
        """Path length weighted by discomfort to each cell, shape (rows, columns), [m]; inf where there is no way."""
        return np.asarray(self._costs * self.frame.resolution_m)

    def to(self, x: float, y: float) -> Array | None:
        """The way to a place as a polyline of cell centres, shape (n, 2), map frame, [m]; None where there is none."""
        cell = self.frame.cell(x, y)
        if not self.frame.contains(np.array([cell]))[0] or not np.isfinite(self._costs[cell]):
            return None
        return self.frame.centres(cheapest_way(self._cell_costs, self._costs, cell))


def clearance(grid: OccupancyGrid, config: PlanningConfig) -> Array:
    """Distance of each cell to the nearest one that is not free, small unknown specks apart; (rows, columns), [m].

    The array holds until the next map is asked for the same (`OccupancyGrid.kept`).
    """
    res = grid.frame.resolution_m
    most = round(config.speck_m2 / res**2)
    return grid.keeper(("clearance", most), lambda: _Clearance(most, res)).of(grid)


class _Clearance:
    """`clearance` of one map after another."""

    def __init__(self, most: int, cell_m: float) -> None:
        self._holes = WithoutHoles(most)
        self._distances = Distances(less=0.5, cell_m=cell_m)
        self._states: States | None = None

    def of(self, grid: OccupancyGrid) -> Array:
        if grid.states is not self._states:
            self._states = grid.states
            self._found = self._distances.of(~(self._holes.of(grid.free) & ~grid.occupied))
        return self._found


def _escape_zone(grid: OccupancyGrid, start: tuple[int, int], within_m: float) -> Mask:
    """Cells about the start that can be got to from it by their sides without entering a wall; (rows, columns)."""
    reach = math.floor(within_m / grid.frame.resolution_m)
    first = max(0, start[0] - reach), max(0, start[1] - reach)
    about = slice(first[0], start[0] + reach + 1), slice(first[1], start[1] + reach + 1)
    rows, columns = np.indices(grid.states[about].shape)
    off = np.hypot(rows + first[0] - start[0], columns + first[1] - start[1])
    open_ = (off * grid.frame.resolution_m <= within_m) & (grid.states[about] != OCCUPIED)
    open_[start[0] - first[0], start[1] - first[1]] = True
    regions, _ = ndimage.label(open_)
    zone: Mask = np.zeros(grid.frame.shape, dtype=bool)
    zone[about] = regions == regions[start[0] - first[0], start[1] - first[1]]
    return zone


@kernel
def _fill_costs(room, least, comfort, weight, cost):  # type: ignore[no-untyped-def]
    """1 in the open, the more the less room, inf where there is too little."""
    for row in range(room.shape[0]):
        for column in range(room.shape[1]):
            here = room[row, column]
            cost[row, column] = np.inf
            if here >= least:
                lack = min(1.0, max(0.0, (comfort - here) / (comfort - least)))
                cost[row, column] = 1.0 + weight * (lack * lack)


def straightened(path: Array, room_m: Array, frame: GridFrame, enough_m: float = 0.32) -> Array:
    """Fewer corners on nearly the same way, shape (k, 2), [m].

    A shortcut keeps the least room that the path had, or `enough_m` where that is less.
    """
    least = min(enough_m, _least_room(path, room_m, frame))
    for tolerance in TOLERANCES_M:
        simple = fewer_corners(path, tolerance)
        if _least_room(sampled(simple, frame.resolution_m), room_m, frame) >= least:
            return simple
    return path


def path_length(path: Array) -> float:
    """[m]"""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def _least_room(points: Array, room_m: Array, frame: GridFrame) -> float:
    cells = frame.cells(points)
    return float(room_m[cells[:, 0], cells[:, 1]].min())


def sampled(path: Array, step_m: float) -> Array:
    """Points along a polyline at most a step apart, its corners among them, shape (k, 2), [m]."""
    pieces = [path[:1]]
    for a, b in pairwise(path):
        count = max(1, math.ceil(math.hypot(*(b - a)) / step_m))
        pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.vstack(pieces)
