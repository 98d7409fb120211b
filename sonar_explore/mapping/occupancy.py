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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.mapping.distance import Distances
from sonar_explore.mapping.grid import FREE, OCCUPIED, GridFrame, Mask, States
from sonar_explore.mapping.rows import differing_rows
from sonar_explore.mapping.sectors import Sectors, cut_all_at_walls, in_reach, mark_segments
from sonar_explore.mapping.walls import bridges, pivot_points, shortened, trimmed
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import Feature, FeatureKind, compensated_ranges

MARGIN_M = 0.25  # of the grid beyond what a scan can reach
RECENT_SCANS = 6
Keeper = TypeVar("Keeper")
BINS = 360
"""Directions in which a scan position keeps how far it is clear."""


@dataclass(frozen=True)
class MappingConfig:
    """What a cell needs to be called free or occupied."""

    resolution_m: float = 0.05
    """Side of a cell, [m]."""
    free_range_m: float = 1.5
    """How far a reading without a region of constant depth may clear, [m]."""
    wall_margin_m: float = 0.05
    """Cells nearer than this before an echo are not cleared by it, [m]."""
    continuation_rad: float = math.radians(60.0)
    """How far off the normal a wall is taken to go on straight, for the scan that saw it, [rad]."""
    core_rad: float = math.radians(5.0)
    """Half-width of the sector about the normal that a region of constant depth clears for certain, [rad]."""
    pivot_m: float = 0.10
    """Feet of two wall features this close are one place, [m]."""
    pivot_turn_rad: float = math.radians(15.0)
    """Normals that differ by this much at one place belong to an edge, a corner or a column, [rad]."""
    trim_m: float = 0.08
    """An edge or a corner this near to a wall feature's line ends its segment, [m]."""
    sure_m: float = 0.10
    """How far about the foot of its normal a wall is believed where the map is doubted, [m]."""
    wall_weight: float = 2.0
    """Evidence of one wall feature for the cells of its segment."""
    point_weight: float = 1.0
    """Evidence of a corner or an edge for its cell."""
    core_weight: float = 1.0
    """Evidence of one certain sector against a wall."""
    still_m: float = 0.01
    """A scan that no point of moved farther than this since it was drawn stays as it is drawn, [m]."""
    fresh_scans: int = 4
    """What the last scans saw stands where they saw it, whatever older ones say: the pose drifts, the walls near
    by are where they are."""
    fresh_weight: float = 100.0
    """Extra evidence of a wall feature of those scans."""
    body_weight: float = 4.0
    """Evidence against a wall where the body has been."""


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
        """Distance of each cell to the nearest occupied one, shape (rows, columns), [m]; see `kept`."""
        return self.to_walls.of(self)

    @property
    def to_walls(self) -> ToWalls:
        """What keeps `to_walls_m`."""
        return self.keeper("to walls", lambda: ToWalls(self.frame.resolution_m))

    @cached_property
    def known_spans(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First row and row after the last, first column and column after the last, of what is known."""
        spans = []
        for known in (self.states.any(axis=1), self.states.any(axis=0)):
            at = np.flatnonzero(known)
            spans.append((int(at[0]), int(at[-1]) + 1) if len(at) else (0, 0))
        return spans[0], spans[1]

    @property
    def free(self) -> Mask:
        """Shape (rows, columns)."""
        return self.states == FREE

    @property
    def occupied(self) -> Mask:
        """Shape (rows, columns)."""
        return self.states == OCCUPIED


class ToWalls:
    """`OccupancyGrid.to_walls_m` of one map after another."""

    def __init__(self, cell_m: float) -> None:
        self.distances = Distances(cell_m=cell_m)
        self._states: States | None = None

    def of(self, grid: OccupancyGrid) -> Array:
        """Shape (rows, columns), [m]."""
        if grid.states is not self._states:
            self._states = grid.states
            self._found = self.distances.of(grid.occupied)
        return self._found


@dataclass(frozen=True, eq=False)
class Look:
    """What one scan says of space, in the robot frame of that scan."""

    clear_m: Array
    """How far each bin may be cleared by its reading, before walls cut it, shape (BINS,), [m]."""
    core_m: Array
    """How far each bin is certainly clear, 0 outside the cores, shape (BINS,), [m]."""
    walls: Array
    """Segments of the scan's wall features, shape (n, 4), [m]."""
    continuations: Array
    """The same walls as taken to go on straight, shape (n, 4), [m]."""
    points: Array
    """Corners and edges x y, shape (k, 2), [m]."""
    passed: Array = field(default_factory=lambda: np.zeros((0, 4)))
    """Pieces of wall that the ring passed on the drive that followed, shape (m, 4), [m]."""

    @cached_property
    def reach_m(self) -> float:
        """How far the clearest bin may be cleared, [m]."""
        return float(self.clear_m.max())


@dataclass(frozen=True, eq=False)
class _Placed:
    """A look in the map frame."""

    pose: Pose
    look: Look
    walls: Array
    continuations: Array
    points: Array
    passed: Array

    @classmethod
    def at(cls, pose: Pose, look: Look) -> _Placed:
        walls, continuations, passed = (
            pose.transform(segments.reshape(-1, 2)).reshape(-1, 4)
            for segments in (look.walls, look.continuations, look.passed)
        )
        return cls(pose, look, walls, continuations, pose.transform(look.points), passed)


def look_of(scan: Scan, features: Sequence[Feature], config: MappingConfig) -> Look:
    """Turn a scan and its features into evidence."""
    bearings, ranges = _from_centre(scan, config.free_range_m)
    bins = (np.arange(BINS) + 0.5) * (2.0 * math.pi / BINS)
    order = np.argsort(bearings % (2.0 * math.pi))
    sorted_bearings = (bearings % (2.0 * math.pi))[order]
    nearest = _nearest_on_circle(sorted_bearings, bins)
    clear = np.minimum(ranges[order][nearest] - config.wall_margin_m, config.free_range_m)
    core = np.zeros(BINS)
    for f in features:
        off = np.abs((bins - f.bearing_rad + math.pi) % (2.0 * math.pi) - math.pi)
        inside = off <= 0.5 * f.width_rad
        clear[inside] = np.minimum(clear[inside], f.range_m - config.wall_margin_m)
        if f.kind is FeatureKind.WALL:
            centre = off <= config.core_rad
            core[centre] = np.maximum(core[centre], f.range_m - config.wall_margin_m)
    walls = [f for f in features if f.kind is FeatureKind.WALL]
    return Look(
        clear_m=np.maximum(clear, 0.0),
        core_m=core,
        walls=np.array([f.segment.as_row() for f in walls], dtype=float).reshape(-1, 4),
        continuations=np.array([_continuation(f, config) for f in walls], dtype=float).reshape(-1, 4),
        points=np.array(
            [f.segment.midpoint for f in features if f.kind is not FeatureKind.WALL], dtype=float
        ).reshape(-1, 2),
    )


def _from_centre(scan: Scan, reach_m: float) -> tuple[Array, Array]:
    """Bearing [rad] and range [m] of each reading as if heard from the robot's centre, shape (n,) each.

    The disc of the paper's scan sits a centimetre off its beam's line through the centre; those of a ring up to eight:
    there it is the end of the reading, or the point `reach_m` along it, that is seen from the centre.
    """
    if scan.ring is None:
        return scan.bearings_rad, compensated_ranges(scan)
    length = np.minimum(scan.ranges_m, reach_m)
    beams = np.column_stack([np.cos(scan.bearings_rad), np.sin(scan.bearings_rad)])
    x, y = (scan.origins + length[:, None] * beams).T
    return np.arctan2(y, x), np.hypot(x, y)


def _continuation(f: Feature, config: MappingConfig) -> tuple[float, float, float, float]:
    c, s = math.cos(f.bearing_rad), math.sin(f.bearing_rad)
    half = f.range_m * math.tan(config.continuation_rad)
    x, y = f.range_m * c, f.range_m * s
    return x + half * s, y - half * c, x - half * s, y + half * c


def _nearest_on_circle(sorted_angles: Array, targets: Array) -> np.ndarray:
    n = len(sorted_angles)
    right = np.searchsorted(sorted_angles, targets) % n
    left = (right - 1) % n
    gap_right = (sorted_angles[right] - targets) % (2.0 * math.pi)
    gap_left = (targets - sorted_angles[left]) % (2.0 * math.pi)
    return np.where(gap_right < gap_left, right, left)


@dataclass(eq=False)
class _Drawn:
    """A map as it was drawn last."""

    sectors: Sectors = field(default_factory=Sectors)
    poses: Sequence[Pose] = ()
    """Of the scans."""
    barriers: Array = field(default_factory=lambda: np.zeros((0, 4)))
    """What shortened their sectors, shape (n, 4), [m]."""
    pivots: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    """Which of their walls are none, shape (n,)."""
    kept: dict[Any, Any] = field(default_factory=dict)
    """What was worked out of the map."""


class OccupancyMapper:
    """Keeps the evidence of all scans and draws the grid from it."""

    def __init__(self, config: MappingConfig, body_radius_m: float, reach_m: float) -> None:
        self._config = config
        self._body = body_radius_m
        self._reach = reach_m
        self._frame: GridFrame | None = None
        self._placed: list[_Placed] = []
        self._drawn = {False: _Drawn(), True: _Drawn()}
        """Believed and doubted: each goes on from where it was drawn last."""
        self.recent_points: Array = np.zeros((0, 2))
        """Corners, edges and columns that the last scans saw, x y, shape (n, 2), map frame, [m]."""

    def draw(
        self,
        poses: Sequence[Pose],
        looks: Sequence[Look],
        trails: Sequence[Array],
        obstacles: Array,
        *,
        doubtful: bool = False,
    ) -> OccupancyGrid:
        """The grid of these scans at these poses.

        Args:
            poses: `pose_robot_in_map` of each scan, as now believed.
            looks: evidence of each scan.
            trails: where the body has been since each scan, shape (n, 2) each, in that scan's frame, [m].
            obstacles: pieces of wall that stood in the way of a drive, shape (k, 4), map frame, [m].
            doubtful: whether to believe only what is sure of a wall, the piece about the foot of its normal, and no
                edges, corners or bridged gaps: what else the map draws may shut a door that is open.
        """
        cfg = self._config
        frame = self._covering(poses)
        self._place(poses, looks)
        poses = [placed.pose for placed in self._placed]
        drawn = self._drawn[doubtful]
        walls = np.concatenate([placed.walls for placed in self._placed])
        scan = np.repeat(np.arange(len(looks)), [len(look.walls) for look in looks])
        pivots = pivot_points(walls, scan, cfg.pivot_m, cfg.pivot_turn_rad)
        feet = 0.5 * (walls[pivots, :2] + walls[pivots, 2:])
        points = np.concatenate([feet, *(placed.points for placed in self._placed)])
        recent = max(0, len(looks) - RECENT_SCANS)
        fresh_feet = feet[scan[pivots] >= recent]
        self.recent_points = np.vstack([fresh_feet, *(placed.points for placed in self._placed[recent:])])
        walls = trimmed(walls[~pivots], points, cfg.trim_m)
        if doubtful:
            walls = shortened(walls, cfg.sure_m)
        wall_evidence = np.zeros(frame.shape)
        mark_segments(frame, wall_evidence, walls, cfg.wall_weight)
        fresh = scan[~pivots] >= len(looks) - cfg.fresh_scans
        mark_segments(frame, wall_evidence, walls[fresh], cfg.fresh_weight)
        obstacles = trimmed(obstacles, points, cfg.trim_m)
        mark_segments(frame, wall_evidence, obstacles, cfg.wall_weight)
        walls = np.vstack([walls, obstacles])
        passed = np.concatenate([placed.passed for placed in self._placed])
        gaps: Array = np.zeros((0, 4))
        if doubtful:
            mark_segments(frame, wall_evidence, passed, cfg.wall_weight)
        else:
            _add_cells(frame, wall_evidence, points, cfg.point_weight)
            gaps = bridges(np.vstack([walls, np.hstack([feet, feet])]), 2.0 * self._body)
        barriers = np.vstack([walls, gaps, passed])
        drawn.sectors.resize(frame)
        last_trail = max(0, len(drawn.poses) - 1)  # the one that may have grown since
        moved, again = self._to_cut(drawn, poses, looks, scan, pivots, barriers)
        clear_m = self._cut(again, looks, ~pivots, barriers)
        drawn.sectors.put(again, [poses[i] for i in again], clear_m, [looks[i].core_m for i in again])
        for i in sorted({*moved, *range(last_trail, len(poses))}):
            drawn.sectors.trail(i, poses[i], trails[i], self._body)
        bridged = np.zeros(frame.shape)
        mark_segments(frame, bridged, gaps, cfg.wall_weight)
        support = np.maximum(wall_evidence, bridged, out=bridged)
        states = drawn.sectors.states(support, cfg.core_weight, cfg.body_weight)
        return OccupancyGrid(frame, states, drawn.kept)

    def _place(self, poses: Sequence[Pose], looks: Sequence[Look]) -> None:
        """Place what scans say that are new or stand elsewhere now."""
        for i, (pose, look) in enumerate(zip(poses, looks, strict=True)):
            known = self._placed[i] if i < len(self._placed) else None
            if known is not None and (known.pose is pose or self._is_still(known.pose, pose)):
                if known.look is look:
                    continue
                pose = known.pose
            self._placed[i : i + 1] = [_Placed.at(pose, look)]

    def _is_still(self, drawn: Pose, pose: Pose) -> bool:
        turned_m = abs(wrap_angle(pose.heading - drawn.heading)) * self._config.free_range_m
        return drawn.distance_to(pose) + turned_m <= self._config.still_m

    def _to_cut(
        self,
        drawn: _Drawn,
        poses: Sequence[Pose],
        looks: Sequence[Look],
        scan: NDArray[np.int64],
        pivots: Mask,
        barriers: Array,
    ) -> tuple[list[int], list[int]]:
        """Scans that moved since last time; and those that may clear other cells than then: they moved, or a wall of
        theirs or near them changed."""
        before = [*drawn.poses, *[None] * (len(poses) - len(drawn.poses))]
        moved = np.array([pose is not then for pose, then in zip(poses, before, strict=True)], dtype=bool)
        changed = differing_rows(barriers, drawn.barriers)
        places = np.array([(p.x, p.y) for p in poses])
        reach = np.array([look.reach_m for look in looks]) + self._config.wall_margin_m
        again = moved | in_reach(places, reach, changed)
        known = len(drawn.pivots)
        again[scan[:known][pivots[:known] != drawn.pivots]] = True
        drawn.poses, drawn.barriers, drawn.pivots = poses, barriers, pivots
        return np.flatnonzero(moved).tolist(), np.flatnonzero(again).tolist()

    def _cut(self, again: list[int], looks: Sequence[Look], real: Mask, barriers: Array) -> Array:
        """How far these scans are clear before barriers, and before the continuations of their own real walls; a row
        for each, shape (n, BINS), [m]."""
        if not again:
            return np.zeros((0, BINS))
        first = np.cumsum([0, *(len(look.walls) for look in looks)])
        own = [self._placed[i].continuations[real[first[i] : first[i + 1]]] for i in again]
        poses = np.array([(p.x, p.y, p.heading) for p in (self._placed[i].pose for i in again)])
        clear = np.array([looks[i].clear_m for i in again])
        ends = np.cumsum([0, *map(len, own)])
        reach = float(clear.max()) + 2.0 * self._config.wall_margin_m
        low, high = poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach
        a, b = barriers[:, :2], barriers[:, 2:]
        barriers = barriers[((np.maximum(a, b) >= low) & (np.minimum(a, b) <= high)).all(axis=1)]
        return cut_all_at_walls(poses, clear, barriers, np.concatenate(own), ends, self._config.wall_margin_m)

    def _covering(self, poses: Sequence[Pose]) -> GridFrame:
        xy = np.array([(p.x, p.y) for p in poses])
        low = tuple(xy.min(axis=0) - self._reach - MARGIN_M)
        high = tuple(xy.max(axis=0) + self._reach + MARGIN_M)
        if self._frame is None:
            res = self._config.resolution_m
            self._frame = GridFrame(
                math.floor(low[0] / res) * res, math.floor(low[1] / res) * res, res, (1, 1)
            )
        self._frame = self._frame.covering(low, high)
        return self._frame


def _add_cells(frame: GridFrame, evidence: Array, points: Array, weight: float) -> None:
    """Add a weight to each cell that holds a point, once."""
    cells = frame.cells(points)
    cells = cells[frame.contains(cells)]
    evidence.ravel()[np.unique(cells[:, 0] * frame.shape[1] + cells[:, 1])] += weight
