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
from sonar_explore.mapping.grid import OCCUPIED, Cells, GridFrame, Mask, States
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.mapping.regions import WithoutHoles
from sonar_explore.planning.cheapest import Window, cheapest_way, spread_costs
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
        within_m: float = math.inf,
    ) -> None:
        """
        Args:
            grid: the map.
            x, y: where the paths begin, map frame, [m].
            body_radius_m: of the disc that must pass, [m].
            config: how much room a path keeps.
            daring: whether to go nearer to walls and to the unknown than one should.
            within_m: longer paths, weighted by discomfort, are left out, [m]: what is farther is not looked at.
        """
        self.frame: GridFrame = grid.frame
        self.least_room_m = body_radius_m + (config.daring_margin_m if daring else config.margin_m)
        """Distance of a path from what is not free, [m]."""
        res, start = grid.frame.resolution_m, grid.frame.cell(x, y)
        window = _window(grid.frame, start, within_m)
        part = np.s_[window[0] : window[1], window[2] : window[3]]
        room, least = clearance(grid, config), self.least_room_m
        if daring:
            careful, room = room, np.zeros(room.shape)
            room[part] = np.minimum(
                careful[part] + config.unknown_credit_m, grid.to_walls_m[part] - 0.5 * res
            )
        self._cell_costs, self._costs = np.empty((2, *room.shape))
        _fill_costs(room, window, least, config.comfort_m, config.comfort_weight, self._cell_costs)
        if room[start] < least:
            leave = _escape_zone(grid, start, config.escape_m) & (room < least)
            self._cell_costs[leave] = 1.0 + 2.0 * config.comfort_weight
            self._cell_costs[start] = 1.0
        self.room_m = room
        """Distance of each cell to the nearest cell that is not free, shape (rows, columns), [m]; where paths lead."""
        self.reached, more = spread_costs(self._cell_costs, start, window, within_m / res, self._costs)
        """The part of the grid that paths lead to."""
        self.within_m = within_m if more else math.inf
        """Longer paths are left out, [m]; inf where there are none."""

    @property
    def cost_m(self) -> Array:
        """Path length weighted by discomfort to each cell, shape (rows, columns), [m]; inf where there is no way."""
        first_row, end_row, first_column, end_column = self.reached
        costs = np.full(self._costs.shape, np.inf)
        part = np.s_[first_row:end_row, first_column:end_column]
        costs[part] = self._costs[part] * self.frame.resolution_m
        return costs

    @property
    def within(self) -> Mask:
        """Cells that the body can be driven to, shape (rows, columns)."""
        return np.asarray((self.cost_m < np.inf) & (self.room_m >= self.least_room_m))

    def costs_to_m(self, cells: Cells) -> Array:
        """`cost_m` of cells of the part reached, shape (n, 2): shape (n,)."""
        return np.asarray(self._costs[cells[:, 0], cells[:, 1]] * self.frame.resolution_m)

    def roomiest(self, to_walls_m: Array, least_room_m: float, spacing_m: float) -> Cells:
        """In each square of a lattice, by its row and column, the cell with the most room that the body can be driven
        to and that is as far from walls, shape (n, 2)."""
        frame, limits = self.frame, (self.least_room_m, least_room_m)
        corner = frame.x0, frame.y0, frame.resolution_m
        return np.asarray(
            _roomiest(self._costs, self.room_m, to_walls_m, limits, self.reached, corner, spacing_m)
        )

    def to(self, x: float, y: float) -> Array | None:
        """The way to a place as a polyline of cell centres, shape (n, 2), map frame, [m]; None where there is none."""
        row, column = self.frame.cell(x, y)
        first_row, end_row, first_column, end_column = self.reached
        inside = first_row <= row < end_row and first_column <= column < end_column
        if not inside or not np.isfinite(self._costs[row, column]):
            return None
        return self.frame.centres(cheapest_way(self._cell_costs, self._costs, (row, column), self.reached))


def _window(frame: GridFrame, start: tuple[int, int], within_m: float) -> Window:
    """The rows and columns that paths so long can lead to."""
    rows, columns = frame.shape
    reach = math.ceil(min(within_m / frame.resolution_m, float(rows + columns))) + 1
    return (
        *(max(0, start[0] - reach), min(rows, start[0] + reach + 1)),
        *(max(0, start[1] - reach), min(columns, start[1] + reach + 1)),
    )


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
def _fill_costs(room, window, least, comfort, weight, cost):  # type: ignore[no-untyped-def]
    """1 in the open, the more the less room, inf where there is too little."""
    for row in range(window[0], window[1]):
        for column in range(window[2], window[3]):
            here = room[row, column]
            cost[row, column] = np.inf
            if here >= least:
                lack = min(1.0, max(0.0, (comfort - here) / (comfort - least)))
                cost[row, column] = 1.0 + weight * (lack * lack)


@kernel
def _roomiest(costs, room, to_walls, limits, reached, corner, spacing):  # type: ignore[no-untyped-def]
    """The first cell with the most room of those in each square of the lattice; rooms equal to a micrometre are one."""
    least_room, least_to_walls = limits
    first_row, end_row, first_column, end_column = reached
    x0, y0, resolution = corner
    lowest = int(math.floor(((first_row + 0.5) * resolution + y0) / spacing))
    leftmost = int(math.floor(((first_column + 0.5) * resolution + x0) / spacing))
    highest = int(math.floor(((end_row - 0.5) * resolution + y0) / spacing))
    rightmost = int(math.floor(((end_column - 0.5) * resolution + x0) / spacing))
    best = np.full((highest - lowest + 1, rightmost - leftmost + 1, 2), -1)
    most = np.full(best.shape[:2], -np.inf)
    square = np.empty(end_column, dtype=np.int64)
    for column in range(first_column, end_column):
        square[column] = int(math.floor(((column + 0.5) * resolution + x0) / spacing)) - leftmost
    for row in range(first_row, end_row):
        i = int(math.floor(((row + 0.5) * resolution + y0) / spacing)) - lowest
        for column in range(first_column, end_column):
            reachable = costs[row, column] < np.inf and room[row, column] >= least_room
            if reachable and to_walls[row, column] >= least_to_walls:
                here, j = np.rint(room[row, column] * 1e6), square[column]
                if here > most[i, j]:
                    most[i, j], best[i, j, 0], best[i, j, 1] = here, row, column
    flat = best.reshape(-1, 2)
    return flat[flat[:, 0] >= 0]


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
