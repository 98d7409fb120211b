"""Safe paths: clearance from everything that is not known to be free, with a preference for the middle."""

from __future__ import annotations

import math
import sys
import weakref
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sonar_explore.compiled import kernel
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array
from sonar_explore.mapping.distance import Distances
from sonar_explore.mapping.grid import OCCUPIED, Cells, GridFrame, Mask, grown, place_in
from sonar_explore.mapping.occupancy import FELT_M, DistancesTo, OccupancyGrid
from sonar_explore.mapping.regions import WithoutHoles
from sonar_explore.planning.cheapest import Search, Window, cheapest_way, most_entries, window_of
from sonar_explore.planning.polyline import fewer_corners
from sonar_explore.sums import hypot

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
    blind_m: float = 1.8
    """Where so much to all sides is known to be free, a scan hears no wall, [m]: what the heading loses there no wall
    gives back, so a path costs more,"""
    blind_weight: float = 0.5
    """by so much of its length."""
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

    def __post_init__(self) -> None:
        if self.blind_m > FELT_M:
            raise SonarExploreError(
                f"planning.blind_m is {self.blind_m:g}; at most {FELT_M:g} is possible: no farther walls are looked for"
            )


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
        been: Array | None = None,
    ) -> None:
        """
        Args:
            grid: the map.
            x, y: where the paths begin, map frame, [m].
            body_radius_m: of the disc that must pass, [m].
            config: how much room a path keeps.
            daring: whether to go nearer to walls and to the unknown than one should.
            within_m: longer paths, weighted by discomfort, are left out, [m]: what is farther is not looked at.
            been: where the body has been, one place after the other, shape (n, 2), map frame, [m]: open whatever the
                map says; None where that is not to count.
        """
        self.frame: GridFrame = grid.frame
        self.least_room_m = body_radius_m + (config.daring_margin_m if daring else config.margin_m)
        """Distance of a path from what is not free, [m]."""
        start = grid.frame.cell(x, y)
        self.start: tuple[int, int] = start
        """The cell that they begin in, (row, column)."""
        key = "ground", config, self.least_room_m, daring
        ground = grid.keeper(key, lambda: _Ground(grid, config, self.least_room_m, daring))
        self.room_m, self._cell_costs = ground.of(grid)
        """Distance of each cell to the nearest cell that is not free, shape (rows, columns), [m]; where paths lead.
        Holds until the next map is planned on, as all of this does (`OccupancyGrid.kept`)."""
        dearest = 1.0 + max(2.0 * config.comfort_weight, config.blind_weight)
        if self.room_m[start] < self.least_room_m:
            leave = _escape_zone(grid, start, config.escape_m) & (self.room_m < self.least_room_m)
            self._cell_costs = self._cell_costs.copy()
            self._cell_costs[1:-1, 1:-1][leave] = dearest
            self._cell_costs[_rimmed(start)] = 1.0
        if been is not None:
            self._cell_costs = self._cell_costs.copy()
            came = _along(grid.frame, been) & (self._cell_costs[1:-1, 1:-1] == np.inf)
            self._cell_costs[1:-1, 1:-1][came] = dearest
        spare = grid.keeper("arrays of paths", _Spare)
        self._search = spare.search(self._cell_costs, _rimmed(start), dearest)
        self._leave_out(within_m)

    def as_far_as(self, within_m: float) -> SafePaths:
        """Those that are no longer than this: they share what is known of them with these."""
        paths = SafePaths.__new__(SafePaths)
        paths.__dict__.update(self.__dict__)  # `copy.copy` takes ten times as long
        paths._leave_out(within_m)
        return paths

    def _leave_out(self, beyond_m: float) -> None:
        self._within_m = beyond_m
        self._most = min(beyond_m / self.frame.resolution_m, sys.float_info.max)  # what costs inf is no way

    @property
    def within_m(self) -> float:
        """Longer paths are left out, [m]; inf where there are none."""
        return self._within_m if self._within_m < math.inf and self._search.reach(self._most) else math.inf

    def _reached(self) -> Window:
        """Where the paths lead, with the rim."""
        self._search.reach(self._most)
        return self._search.window

    @property
    def cost_m(self) -> Array:
        """Path length weighted by discomfort to each cell, shape (rows, columns), [m]; inf where there is no way."""
        first_row, end_row, first_column, end_column = self._reached()
        costs = np.full(self._cell_costs.shape, np.inf)
        part = np.s_[first_row:end_row, first_column:end_column]
        known = self._search.costs[part]
        costs[part] = np.where(known <= self._most, known * self.frame.resolution_m, np.inf)
        return costs[1:-1, 1:-1]

    @property
    def within(self) -> Mask:
        """Cells that the body can be driven to, shape (rows, columns)."""
        if self._within_m == math.inf:
            region: Mask = self._search.region[1:-1, 1:-1] & (self.room_m >= self.least_room_m)
            return region
        first_row, end_row, first_column, end_column = self._reached()
        within: Mask = np.zeros(self.frame.shape, dtype=bool)
        part = np.s_[first_row - 1 : end_row - 1, first_column - 1 : end_column - 1]
        known = self._search.costs[first_row:end_row, first_column:end_column]
        within[part] = known <= self._most
        within[part] &= self.room_m[part] >= self.least_room_m
        return within

    def costs_to_m(self, cells: Cells, most_m: Array) -> Array:
        """`cost_m` of cells that paths lead to, shape (n, 2); inf where that is more than this, shape (n,), [m]: which
        is found out without looking for the way."""
        resolution = self.frame.resolution_m
        return self._search.costs_to(cells + 1, most_m / resolution) * resolution

    def roomiest(self, to_walls_m: Array, least_room_m: float, spacing_m: float) -> Cells:
        """In each square of a lattice, by its row and column, the cell with the most room that the body can be driven
        to and that is as far from walls, shape (n, 2). How long the ways there are is not looked for, unless some are
        too long."""
        frame, limits = self.frame, (self.least_room_m, least_room_m)
        corner = frame.x0, frame.y0, frame.resolution_m
        if self._within_m == math.inf:
            leads, reached = self._search.region, self._search.region_window
        else:
            leads, reached = np.zeros(self._cell_costs.shape, dtype=bool), self._reached()
            part = np.s_[reached[0] : reached[1], reached[2] : reached[3]]
            leads[part] = self._search.costs[part] <= self._most
        return np.asarray(_roomiest(leads, self.room_m, to_walls_m, limits, reached, corner, spacing_m))

    def to(self, x: float, y: float) -> Array | None:
        """The way to a place as a polyline of cell centres, shape (n, 2), map frame, [m]; None where there is none."""
        row, column = self.frame.cell(x, y)
        if not (0 <= row < self.frame.shape[0] and 0 <= column < self.frame.shape[1]):
            return None
        end = _rimmed((row, column))
        if not self._search.reach_cell(*end) or not self._search.costs[end] <= self._most:
            return None
        way = cheapest_way(self._cell_costs, self._search.costs, end, self._search.window)
        return self.frame.centres(way - 1)


def _rimmed(cell: tuple[int, int]) -> tuple[int, int]:
    """Row and column of a cell where a rim, one cell wide, lies about the grid."""
    return cell[0] + 1, cell[1] + 1


class _Spare:
    """Arrays of paths that are no more, for the next ones: to touch fresh memory costs as much as to fill it."""

    def __init__(self) -> None:
        self._held: list[tuple[Array, NDArray[np.int32]]] = []

    def search(self, cell_costs: Array, start: tuple[int, int], dearest: float) -> Search:
        """One that gives its arrays back."""
        cells, held = cell_costs.size, None
        while self._held and held is None:
            held = self._held.pop()
            held = held if len(held[0]) >= cells else None
        if held is None:
            room = cells + cells // 2
            held = np.full(room, np.inf), np.empty((most_entries(room), 2), dtype=np.int32)
        out = held[0][:cells].reshape(cell_costs.shape)
        search = Search(cell_costs, start, dearest, out, held[1])
        weakref.finalize(search, self._take_back, held, out, search.state).atexit = False
        return search

    def _take_back(self, held: tuple[Array, NDArray[np.int32]], out: Array, state: NDArray[np.int64]) -> None:
        """Nobody needs these any more; what was written to, and that was nothing but neighbours of where ways led, is
        inf again."""
        first_row, end_row, first_column, end_column = window_of(state)
        out[first_row - 1 : end_row + 1, first_column - 1 : end_column + 1] = np.inf
        self._held.append(held)


class _Ground:
    """What it costs to enter each cell of one map after another: anew only where there is more or less room."""

    def __init__(
        self, grid: OccupancyGrid, config: PlanningConfig, least_room_m: float, daring: bool
    ) -> None:
        self._config, self._least, self._daring = config, least_room_m, daring
        self._careful, self._to_walls = _kept_clearance(grid, config), grid.to_walls
        self._changed = [self._careful.distances.watch()]
        self._changed += [self._to_walls.distances.watch()] if daring else []
        self._frame = grid.frame
        self._room: Array = np.empty(grid.frame.shape)
        self._costs = np.full((grid.frame.shape[0] + 2, grid.frame.shape[1] + 2), np.inf)

    def of(self, grid: OccupancyGrid) -> tuple[Array, Array]:
        """Room of each cell, shape (rows, columns), [m]; and its cost, inf where there is too little and on a rim about
        the grid, shape (rows + 2, columns + 2). Both are written to at the next call.

        Who dares takes for room what there is to the unknown with some credit, or to walls where that is less.
        """
        careful = self._careful.of(grid)
        to_walls = self._to_walls.of(grid) if self._daring else careful
        config, half_cell_m = self._config, 0.5 * grid.frame.resolution_m
        if grid.frame != self._frame:
            at, self._frame = place_in(self._frame, grid.frame), grid.frame
            self._room = grown(self._room, at, careful.shape, 0.0) if self._daring else careful
            self._costs = grown(self._costs, at, (careful.shape[0] + 2, careful.shape[1] + 2), np.inf)
        room = self._room = self._room if self._daring else careful
        limits = self._least, config.comfort_m, config.comfort_weight, config.blind_m, config.blind_weight
        for changed in self._changed:
            sources = careful, to_walls, self._daring, config.unknown_credit_m, half_cell_m
            _fill_costs(*sources, changed.take(), *limits, room, self._costs)
        return room, self._costs


def _speck_cells(config: PlanningConfig, resolution_m: float) -> int:
    """How many cells an unknown speck may have that shuts nothing."""
    return round(config.speck_m2 / resolution_m**2)


def clearance(grid: OccupancyGrid, config: PlanningConfig) -> Array:
    """Distance of each cell to the nearest one that is not free, small unknown specks apart; (rows, columns), [m].

    The array holds until the next map is asked for the same (`OccupancyGrid.kept`).
    """
    return _kept_clearance(grid, config).of(grid)


def _kept_clearance(grid: OccupancyGrid, config: PlanningConfig) -> _Clearance:
    res = grid.frame.resolution_m
    most = _speck_cells(config, res)
    return grid.keeper(("clearance", most), lambda: _Clearance(most, res))


class _Clearance(DistancesTo):
    """`clearance` of one map after another."""

    def __init__(self, most: int, cell_m: float) -> None:
        super().__init__(Distances(less=0.5, cell_m=cell_m))
        self._holes = WithoutHoles(most)

    def _shut(self, grid: OccupancyGrid) -> Mask:
        return ~(self._holes.of(grid.free) & ~grid.occupied)


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


def _along(frame: GridFrame, way: Array) -> Mask:
    """Cells that a way, shape (n, 2), [m], leads through, and the nearest beside it; shape (rows, columns)."""
    half = 0.5 * frame.resolution_m
    points = sampled(way, half)
    out: Mask = np.zeros(frame.shape, dtype=bool)
    for aside in ((-half, -half), (-half, half), (half, -half), (half, half)):
        cells = frame.cells(points + aside)
        out[cells[:, 0], cells[:, 1]] = True
    return out


@kernel
def _fill_costs(  # type: ignore[no-untyped-def]
    careful,
    to_walls,
    daring,
    credit,
    half_cell,
    spans,
    least,
    comfort,
    weight,
    blind,
    blind_weight,
    room,
    costs,
):
    """Of the cells of the spans, 1 in the open, the more the less room, and where walls are far; inf where there is too
    little room."""
    for row in range(len(spans)):
        for stripe in range(spans.shape[1]):
            for column in range(spans[row, stripe, 0], spans[row, stripe, 1] + 1):
                if daring:
                    room[row, column] = min(careful[row, column] + credit, to_walls[row, column] - half_cell)
                here, cost = room[row, column], np.inf
                if here >= least:
                    lack = min(1.0, max(0.0, (comfort - here) / (comfort - least)))
                    cost = 1.0 + weight * (lack * lack)
                    if careful[row, column] > blind:
                        cost += blind_weight
                costs[row + 1, column + 1] = cost


@kernel
def _roomiest(leads, room, to_walls, limits, reached, corner, spacing):  # type: ignore[no-untyped-def]
    """The first cell with the most room of those in each square of the lattice; rooms equal to a micrometre are one.

    Which cells ways lead to, and the part in which they lie, have a rim about the grid.
    """
    least_room, least_to_walls = limits
    first_row, end_row, first_column, end_column = reached
    first_row, end_row, first_column, end_column = (
        first_row - 1,
        end_row - 1,
        first_column - 1,
        end_column - 1,
    )
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
            reachable = leads[row + 1, column + 1] and room[row, column] >= least_room
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
    x, y = (path[1:] - path[:-1]).T
    return float(np.hypot(x, y).sum())


def _least_room(points: Array, room_m: Array, frame: GridFrame) -> float:
    cells = frame.cells(points)
    return float(room_m[cells[:, 0], cells[:, 1]].min())


def sampled(path: Array, step_m: float) -> Array:
    """Points along a polyline at most a step apart, its corners among them, shape (k, 2), [m]."""
    return np.asarray(_sample(path, step_m))


@kernel
def _sample(path, step):  # type: ignore[no-untyped-def]
    total, counts = 1, np.empty(len(path), dtype=np.int64)
    for i in range(1, len(path)):
        counts[i] = max(1, math.ceil(hypot(path[i, 0] - path[i - 1, 0], path[i, 1] - path[i - 1, 1]) / step))
        total += counts[i]
    out, at = np.empty((total, 2)), 1
    out[0, 0], out[0, 1] = path[0, 0], path[0, 1]
    for i in range(1, len(path)):
        x, y = path[i - 1, 0], path[i - 1, 1]
        dx, dy = path[i, 0] - x, path[i, 1] - y
        for k in range(counts[i]):
            share = (k + 1) / counts[i]
            out[at, 0], out[at, 1] = x + dx * share, y + dy * share
            at += 1
    return out
