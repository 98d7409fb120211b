"""Scores of an episode against the truth; every definition is in docs/metrics.md.

Pure functions of the world and of what the robot did or drew. The map is placed by the start pose and never
fitted to the truth: where it drifted, it scores badly. Grid states are `uint8`, shape (rows, cols), row 0 the
lowest y, column 0 the lowest x: 0 unknown, 1 free, 2 occupied.
"""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.compiled import kernel
from sonar_explore.envs.world import World
from sonar_explore.episodes.lattice import (
    Lattice,
    Mask,
    boxes,
    clearance_on,
    free_on,
    lattice_over,
    overlap,
    reachable_cells,
    reachable_wall,
)
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array

States = NDArray[np.uint8]

FREE, OCCUPIED = 1, 2
VIEW_M = AmigoBot.range_reliable_m
"""A scan explores what lies within its reliable range, [m]."""
RECALL_DISTANCE_M = 0.10
"""An occupied cell this close stands for a piece of wall, [m]."""
MAX_RESOLUTION_M = 0.10

_RAYS = 720
_EPSILON = 1e-6


class Scorer:
    """What the true world says of an episode; built once a world.

    `add_scan` keeps a running account of what was explored; everything else is a pure function.
    """

    def __init__(self, world: World, resolution_m: float = 0.05) -> None:
        if not 0.0 < resolution_m <= MAX_RESOLUTION_M:
            raise SonarExploreError(
                f"scoring at {resolution_m} m a cell; 0 to {MAX_RESOLUTION_M} is possible"
            )
        self.world = world
        self.lattice = lattice_over(world, resolution_m)
        clearance = clearance_on(world, self.lattice, AmigoBot.radius_m + resolution_m)
        self.reachable: Mask = reachable_cells(world, self.lattice, clearance)
        """Cells that the robot's disc can reach from the start, shape `lattice.shape`."""
        self.explored: Mask = np.zeros_like(self.reachable)
        """What `add_scan` has seen so far."""
        self._boxes = boxes(world.walls)

    @property
    def origin(self) -> tuple[float, float]:
        """Outer corner (x, y) of cell (0, 0) of `reachable`, [m]."""
        return self.lattice.origin

    @property
    def resolution_m(self) -> float:
        """[m]"""
        return self.lattice.resolution_m

    @property
    def reachable_area_m2(self) -> float:
        """[m2]"""
        return float(self._reachable_cells) * self.resolution_m**2

    def add_scan(self, x: float, y: float) -> float:
        """Count a scan taken truly at (x, y) [m]; the fraction explored so far."""
        self._see(self.explored, x, y)
        return self._share(self.explored)

    def reset(self) -> None:
        """Forget the scans added."""
        self.explored[:] = False

    def explored_mask_from(self, x: float, y: float) -> Mask:
        """Reachable cells within 2 m and in line of sight of (x, y) [m]."""
        mask = np.zeros_like(self.reachable)
        self._see(mask, x, y)
        return mask

    def explored_fraction(self, true_positions: Array) -> float:
        """Share of the reachable area that scans at the true positions (n, 2) [m] have seen."""
        mask = np.zeros_like(self.reachable)
        for x, y in np.asarray(true_positions, dtype=float).reshape(-1, 2).tolist():
            self._see(mask, x, y)
        return self._share(mask)

    def wall_recall(self, states: States, origin: tuple[float, float], resolution_m: float) -> float:
        """Share of the reachable wall length with an occupied cell within 10 cm."""
        from scipy.spatial import cKDTree  # here: 6 MB that an environment does not need

        grid = _grid(states, origin, resolution_m)
        points, lengths = self._reachable_wall
        occupied = grid.middles(states == OCCUPIED)
        if not len(points) or not len(occupied):
            return 0.0
        distance, _ = cKDTree(occupied).query(points, distance_upper_bound=RECALL_DISTANCE_M + _EPSILON)
        return float(lengths[np.isfinite(distance)].sum() / lengths.sum())

    def wall_error(self, states: States, origin: tuple[float, float], resolution_m: float) -> float | None:
        """Mean distance of the occupied cells' middles to the nearest true wall or column, [m]."""
        occupied = _grid(states, origin, resolution_m).middles(states == OCCUPIED)
        if not len(occupied):
            return None
        _, distance = shapely.STRtree(shapely.linestrings(self.world.walls.reshape(-1, 2, 2))).query_nearest(
            shapely.points(occupied), all_matches=False, return_distance=True
        )
        for x, y, radius in self.world.cylinders:
            np.minimum(
                distance,
                np.abs(np.hypot(occupied[:, 0] - x, occupied[:, 1] - y) - radius),
                out=distance,
            )
        return float(distance.mean())

    def false_free_fraction(self, states: States, origin: tuple[float, float], resolution_m: float) -> float:
        """Share of the cells the map calls free that are not free in truth; 0 where it calls none free."""
        grid = _grid(states, origin, resolution_m)
        free = states == FREE
        if not free.any():
            return 0.0
        truth = free_on(self.world, lattice_over(self.world, resolution_m, grid))
        return float(1.0 - truth[overlap(self.world, grid)][free].mean())

    def _see(self, mask: Mask, x: float, y: float) -> None:
        """Add to the mask the reachable cells seen from (x, y): only those that it lacks are looked at."""
        view = self.lattice.window(x - VIEW_M, y - VIEW_M, x + VIEW_M, y + VIEW_M)
        rows, columns = np.nonzero(self.reachable[view] & ~mask[view])
        if not len(rows):
            return
        dx, dy = (self.lattice.x[view[1]] - x)[columns], (self.lattice.y[view[0]] - y)[rows]
        distance = np.hypot(dx, dy)
        ray = np.rint(np.arctan2(dy, dx) * (_RAYS / (2 * np.pi))).astype(int) % _RAYS
        seen = distance <= self._ranges(x, y)[ray] + _EPSILON
        mask[view][rows[seen], columns[seen]] = True

    def _ranges(self, x: float, y: float) -> Array:
        """How far one sees from (x, y) along evenly spread rays, 2 m at most, shape (rays,), [m]."""
        box = self._boxes
        near = (box[:, 0] <= x + VIEW_M) & (box[:, 2] >= x - VIEW_M)
        near &= (box[:, 1] <= y + VIEW_M) & (box[:, 3] >= y - VIEW_M)
        return cast_rays(x, y, self.world.walls[near], self.world.cylinders)

    def _share(self, mask: Mask) -> float:
        return float(np.count_nonzero(mask) / self._reachable_cells)

    @cached_property
    def _reachable_cells(self) -> int:
        return int(np.count_nonzero(self.reachable))

    @cached_property
    def _reachable_wall(self) -> tuple[Array, Array]:
        return reachable_wall(self.world, self.lattice, self.reachable)


def cast_rays(x: float, y: float, walls: Array, cylinders: Array) -> Array:
    """Distance from (x, y) to the first wall (n, 4) or cylinder (m, 3) along 720 rays, 2 m at most, [m]."""
    ux, uy = _directions()
    ranges = np.full(_RAYS, VIEW_M)
    _meet_walls(ux, uy, np.ascontiguousarray(walls), x, y, ranges)
    near = np.hypot(cylinders[:, 0] - x, cylinders[:, 1] - y) - cylinders[:, 2] <= VIEW_M
    for cx, cy, radius in cylinders[near]:
        middle, beside = ux * (cx - x) + uy * (cy - y), ux * (cy - y) - uy * (cx - x)
        hit = middle - np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
        ranges = np.where((np.abs(beside) <= radius) & (hit >= 0.0), np.minimum(ranges, hit), ranges)
    return ranges


@kernel
def _meet_walls(ux, uy, walls, x, y, ranges):  # type: ignore[no-untyped-def]
    """A ray meets a wall whose ends lie on both its sides; that is, or ends on it.

    No branches: several rays at a time.
    """
    for k in range(len(walls)):
        ax, ay, bx, by = walls[k, 0] - x, walls[k, 1] - y, walls[k, 2] - x, walls[k, 3] - y
        for i in range(len(ranges)):
            side_a, side_b = ux[i] * ay - uy[i] * ax, ux[i] * by - uy[i] * bx
            crosses = (side_a * side_b <= 0.0) & (side_a != side_b)
            share = side_a / (side_a - side_b if crosses else 1.0)
            along = ux[i] * (ax + share * (bx - ax)) + uy[i] * (ay + share * (by - ay))
            ranges[i] = along if crosses & (along >= 0.0) & (along < ranges[i]) else ranges[i]


@cache
def _directions() -> tuple[Array, Array]:
    """Unit vectors x y of the rays, shape (rays,) each."""
    angle = np.arange(_RAYS) * (2 * np.pi / _RAYS)
    return np.cos(angle), np.sin(angle)


def _grid(states: States, origin: tuple[float, float], resolution_m: float) -> Lattice:
    if states.ndim != 2:
        raise SonarExploreError(f"grid states have shape {states.shape}; expected (rows, cols)")
    if not 0.0 < resolution_m <= MAX_RESOLUTION_M:
        raise SonarExploreError(f"a map of {resolution_m} m a cell; 0 to {MAX_RESOLUTION_M} is possible")
    return Lattice((float(origin[0]), float(origin[1])), resolution_m, (states.shape[0], states.shape[1]))
