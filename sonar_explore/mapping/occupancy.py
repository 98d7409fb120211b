"""Features onto the occupancy grid, so that a path planned through free cells can be driven.

The paper maps features, not readings (section II); its reference for the grid is not to be had, so all of this is
our reading, judged by its aim: few *false-free* cells. Three kinds of evidence:

- a wall feature makes the cells of its segment occupied; two ends that the body cannot pass between are one wall;
- the normal ray of a region of constant depth is clear up to its foot: it can outweigh a false wall;
- any other reading only tells that no source answered nearer. It makes cells free as far as the next known wall, the
  straight continuation of a wall seen in the same scan, or `free_range_m`; it never weighs against a wall. Cutting at
  walls is done anew whenever walls are added, so that what was free behind an unseen wall does not stay free.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.cuts import Known, cut_all_at_walls, in_reach
from sonar_explore.mapping.distance import Distances
from sonar_explore.mapping.evidence import Evidence, Standing
from sonar_explore.mapping.grid import FREE, OCCUPIED, GridFrame, Mask, States, place_in
from sonar_explore.mapping.looks import Look, MappingConfig
from sonar_explore.mapping.marks import Marks
from sonar_explore.mapping.rows import differing_rows
from sonar_explore.mapping.sectors import Sectors
from sonar_explore.mapping.wall_ends import continued
from sonar_explore.mapping.walls import bridges, pivot_points, shortened, trimmed

MARGIN_M = 0.25  # of the grid beyond what a scan can reach
RECENT_SCANS = 6
FELT_M = 2.0  # walls farther off are far, however far: most lie so about what nobody has seen outside of the building
LATE_M = 0.2  # so far off may be drawn what scans far away clear, where the map is doubted
Keeper = TypeVar("Keeper")


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A grid of cell states in the map frame."""

    frame: GridFrame
    states: States
    """UNKNOWN, FREE or OCCUPIED, shape (rows, columns)."""
    kept: dict[Any, Any] = field(default_factory=dict, repr=False)
    """What is worked out of the map, by what it is: shared with the maps drawn before and after, so that each goes on
    from the last one. An array of theirs holds until the next map is asked for the same."""

    def keeper(self, what: Any, make: Callable[[], Keeper]) -> Keeper:
        """What works `what` out of one map after another."""
        if what not in self.kept:
            self.kept[what] = make()
        found: Keeper = self.kept[what]
        return found

    @property
    def to_walls_m(self) -> Array:
        """Distance of each cell to the nearest occupied one, inf where that is farther than `FELT_M`, shape (rows,
        columns), [m]; see `kept`."""
        return self.to_walls.of(self)

    @property
    def to_walls(self) -> ToWalls:
        """What keeps `to_walls_m`."""
        cell_m, most = self.frame.resolution_m, round(FELT_M / self.frame.resolution_m)
        return self.keeper("to walls", lambda: ToWalls(Distances(cell_m=cell_m, most=most)))

    @property
    def free(self) -> Mask:
        """Shape (rows, columns)."""
        return self.states == FREE

    @property
    def occupied(self) -> Mask:
        """Shape (rows, columns)."""
        return self.states == OCCUPIED


class DistancesTo(ABC):
    """Distance of each cell to the nearest one that is shut, of one map after another."""

    def __init__(self, distances: Distances) -> None:
        self.distances = distances
        self._states: States | None = None
        self._frame: GridFrame | None = None

    @abstractmethod
    def _shut(self, grid: OccupancyGrid) -> Mask:
        """Shape (rows, columns)."""

    def of(self, grid: OccupancyGrid) -> Array:
        """Shape (rows, columns), [m]; what is kept where the map is the one of the last call."""
        if grid.states is not self._states:
            at = (0, 0) if self._frame is None else place_in(self._frame, grid.frame)
            self._states, self._frame = grid.states, grid.frame
            self._found = self.distances.of(self._shut(grid), at)
        return self._found


class ToWalls(DistancesTo):
    """`OccupancyGrid.to_walls_m`."""

    def _shut(self, grid: OccupancyGrid) -> Mask:
        return grid.occupied


@dataclass(eq=False)
class _Drawn:
    """A map as it was drawn last."""

    sectors: Sectors = field(default_factory=Sectors)
    at: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """Where the scans are drawn, x y [m] heading [rad], shape (scans, 3)."""
    bounds: Array = field(default_factory=lambda: np.zeros((0, 4)))
    """`Look.bounds` of all scans, where they are not among the walls, shape (n, 4), [m]."""
    walls: Marks = field(default_factory=Marks)
    fresh: Marks = field(default_factory=Marks)
    """Those of the last scans."""
    points: Marks = field(default_factory=Marks)
    gaps: Marks = field(default_factory=Marks)
    pivots: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    """Which of their walls are none, shape (n,)."""
    late: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    """Scans far away that may clear other cells than they are drawn to, shape (scans,)."""
    kept: dict[Any, Any] = field(default_factory=dict)
    """What was worked out of the map."""


@dataclass(frozen=True, eq=False)
class _Walls:
    """What is believed to be wall, map frame, [m]."""

    pivots: Mask
    """Which wall features are none, shape (n,)."""
    points: Array
    """Edges, corners and those, shape (k, 2)."""
    walls: Array
    """The others as far as they are believed, then what stood in the way of drives, shape (m, 4)."""
    fresh: slice
    """Those of the last scans."""
    gaps: Array
    """Across gaps that the body cannot pass, and from ends of walls to what ends them, shape (g, 4)."""


class OccupancyMapper:
    """Keeps the evidence of all scans and draws the grid from it."""

    def __init__(self, config: MappingConfig, body_radius_m: float, reach_m: float) -> None:
        self._config = config
        self._body = body_radius_m
        self._reach = reach_m
        self._frame: GridFrame | None = None
        self._seen = Evidence(config.still_m, config.far_still_m, config.free_range_m)
        self._obstacles = Standing()
        self._told: tuple[tuple[int, bytes], _Walls] | None = None
        """What evidence and obstacles it is of, and what is wall by them."""
        self._drawn = {False: _Drawn(), True: _Drawn()}
        """Believed and doubted: each goes on from where it was drawn last."""
        self.recent_points: Array = np.zeros((0, 2))
        """Corners, edges and columns that the last scans saw, x y, shape (n, 2), map frame, [m]."""

    def draw(
        self,
        poses: Sequence[Pose],
        looks: Sequence[Look],
        trails: Sequence[Array],
        obstacles: Sequence[tuple[int, Array]],
        *,
        doubtful: bool = False,
        bounded: bool = True,
        fresh_m: float = math.inf,
    ) -> OccupancyGrid:
        """The grid of these scans at these poses.

        Args:
            poses: `pose_robot_in_map` of each scan, as now believed.
            looks: evidence of each scan.
            trails: where the body has been since each scan, shape (n, 2) each, in that scan's frame, [m].
            obstacles: pieces of wall that stood in the way of a drive, shape (1, 4) each: index of a scan, and where
                they are in its frame, [m].
            doubtful: whether to believe only what is sure of a wall, the piece about the foot of its normal, and no
                edges, corners or bridged gaps: what else the map draws may shut a door that is open.
            bounded: whether bounds stand where the map is doubted.
            fresh_m: scans farther off than this from the last may wait until they have moved by `far_still_m`, [m];
                where the map is doubted, all that they clear may, until it has moved by `LATE_M`.
        """
        cfg, seen, drawn = self._config, self._seen, self._drawn[doubtful]
        seen.place(poses, looks, fresh_m)
        frame = self._covering(seen.believed_at)
        found = self._walls(self._obstacles.at(seen.poses, obstacles), doubtful)
        barriers = np.vstack([found.walls, found.gaps, seen.bounds.all])
        drawn.sectors.resize(frame)
        was_at = drawn.at
        gone, come = self._mark(drawn, frame, found, doubtful, bounded)
        again, stands = self._to_cut(drawn, found.pivots, gone, come, fresh_m if doubtful else math.inf)
        at, clear_m = seen.at.all, seen.clear_m.all
        cut_m, differ = cut_all_at_walls(
            *(again, at, clear_m, barriers),
            *(seen.continuations.all, ~found.pivots, seen.walls.first, cfg.wall_margin_m),
            Known(stands, drawn.sectors.clear_m(again, clear_m.shape[1]), gone, come),
        )
        again, cut_m = again[differ], cut_m[differ]
        drawn.sectors.put(again, at[again], cut_m, seen.core_m.all[again])
        last = max(0, len(was_at) - 1)  # its trail may have grown since
        moved = np.flatnonzero((drawn.at[:last] != was_at[:last]).any(axis=1)).tolist()
        drawn.sectors.trails([*moved, *range(last, len(poses))], seen.poses, trails, self._body)
        states = drawn.sectors.states((drawn.walls, drawn.fresh, drawn.points, drawn.gaps), cfg)
        return OccupancyGrid(frame, states, drawn.kept)

    def is_late(self, *, doubtful: bool) -> bool:
        """Whether scans far away are drawn elsewhere than they are believed to stand, on the one map or the other."""
        return self._seen.waits or bool(self._drawn[doubtful].late.any())

    @property
    def scan_positions(self) -> Array:
        """x y of the scans of the map drawn last, as they were believed then, shape (n, 2), map frame, [m]."""
        return self._seen.believed_at.copy()

    def _walls(self, obstacles: Array, doubtful: bool) -> _Walls:
        """What is wall, of all that was seen."""
        cfg, told = self._config, self._told_walls(obstacles)
        heard = told.walls[: told.fresh.stop]
        if doubtful:
            walls = np.concatenate([shortened(heard, cfg.sure_m), told.walls[len(heard) :]])
            return replace(told, walls=walls)
        feet = told.points[: np.count_nonzero(told.pivots)]
        narrow = bridges(np.vstack([told.walls, np.hstack([feet, feet])]), 2.0 * self._body)
        return replace(
            told, gaps=np.vstack([narrow, continued(heard, told.points, cfg.on_line_m, cfg.goes_on_m)])
        )

    def _told_walls(self, obstacles: Array) -> _Walls:
        """The same without gaps, each as far as it was heard: told once for both maps."""
        cfg, seen = self._config, self._seen
        key = seen.version, obstacles.tobytes()
        if self._told is not None and self._told[0] == key:
            return self._told[1]
        walls, scans = seen.walls.all, len(seen.poses)
        scan = np.repeat(np.arange(scans), np.diff(seen.walls.first))
        pivots = pivot_points(walls, scan, cfg.pivot_m, cfg.pivot_turn_rad)
        feet = 0.5 * (walls[pivots, :2] + walls[pivots, 2:])
        points = np.concatenate([feet, seen.points.all])
        recent = max(0, scans - RECENT_SCANS)
        self.recent_points = np.concatenate(
            [feet[scan[pivots] >= recent], seen.points.all[seen.points.first[recent] :]]
        )
        walls, scan = np.concatenate([walls[~pivots], obstacles]), scan[~pivots]
        fresh = slice(int(np.searchsorted(scan, scans - cfg.fresh_scans)), len(scan))
        told = _Walls(pivots, points, trimmed(walls, points, cfg.trim_m), fresh, np.zeros((0, 4)))
        self._told = key, told
        return told

    def _mark(
        self, drawn: _Drawn, frame: GridFrame, found: _Walls, doubtful: bool, bounded: bool
    ) -> tuple[Array, Array]:
        """Mark what is believed; the barriers that went and those that came, shape (k, 4) both, [m]."""
        spans, bounds = drawn.sectors.changed, self._seen.bounds.all
        walls = np.concatenate([found.walls, bounds]) if doubtful and bounded else found.walls
        changed = [drawn.walls.put(frame, walls, spans), drawn.gaps.put(frame, found.gaps, spans)]
        if not doubtful:
            changed.append(differing_rows(drawn.bounds, bounds))
            drawn.bounds = bounds.copy()
        drawn.fresh.put(frame, found.walls[found.fresh], spans)
        points = found.points[:0] if doubtful else found.points
        drawn.points.put(frame, np.hstack([points, points]), spans)
        gone, come = zip(*changed, strict=True)
        return np.concatenate(gone), np.concatenate(come)

    def _to_cut(
        self, drawn: _Drawn, pivots: Mask, gone: Array, come: Array, fresh_m: float
    ) -> tuple[NDArray[np.int64], Mask]:
        """Scans that may clear other cells than last time: they moved, or a wall of theirs or near them changed; those
        farther than `fresh_m` from the last one are late, unless they are new or have moved far. And of which of them
        nothing but walls near them changed."""
        seen, known = self._seen, len(drawn.at)
        at, other = seen.at.all, np.ones(len(seen.poses), dtype=bool)
        other[:known] = (at[:known] != drawn.at).any(axis=1) | drawn.late
        turned = np.flatnonzero(pivots[: len(drawn.pivots)] != drawn.pivots)
        other[np.searchsorted(seen.walls.first, turned, side="right") - 1] = True
        reach_m = seen.reach_m.all[:, 0] + self._config.wall_margin_m
        again = other | in_reach(at, reach_m, np.concatenate([gone, come]))
        late = np.zeros(len(at), dtype=bool)
        if fresh_m < math.inf:
            far = np.hypot(*(at[:known, :2] - at[-1, :2]).T) > fresh_m
            late[:known] = again[:known] & far & (seen.moved_m(at[:known], drawn.at) <= LATE_M)
        drawn.pivots, drawn.late = pivots, late
        where_drawn = at.copy()
        where_drawn[:known][late[:known]] = drawn.at[late[:known]]
        drawn.at = where_drawn
        scans = np.flatnonzero(again & ~late)
        return scans, ~other[scans]

    def _covering(self, places: Array) -> GridFrame:
        """The frame, grown until it holds what scans from these places can reach, shape (n, 2), [m]."""
        low = tuple((places.min(axis=0) - self._reach - MARGIN_M).tolist())
        high = tuple((places.max(axis=0) + self._reach + MARGIN_M).tolist())
        if self._frame is None:
            res = self._config.resolution_m
            self._frame = GridFrame(
                math.floor(low[0] / res) * res, math.floor(low[1] / res) * res, res, (1, 1)
            )
        self._frame = self._frame.covering(low, high)
        return self._frame
