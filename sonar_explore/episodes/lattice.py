"""The true world on a lattice of cells: what is free, what the robot can reach, which walls it can come close to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.world import World, distances_to_walls
from sonar_explore.geometry import Array

Mask = NDArray[np.bool_]

_STAMP_M = 2.0
_EPSILON = 1e-6
_CROSS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], dtype=np.uint8)


@dataclass(frozen=True)
class Lattice:
    """Square cells over the world: row 0 is the lowest y, column 0 the lowest x."""

    origin: tuple[float, float]
    """Outer corner (x, y) of cell (0, 0), [m]."""
    resolution_m: float
    shape: tuple[int, int]
    """(rows, columns)"""

    @property
    def x(self) -> Array:
        """Middles of the columns, [m]."""
        return (np.arange(self.shape[1], dtype=np.float64) + 0.5) * self.resolution_m + self.origin[0]

    @property
    def y(self) -> Array:
        """Middles of the rows, [m]."""
        return (np.arange(self.shape[0], dtype=np.float64) + 0.5) * self.resolution_m + self.origin[1]

    def middles(self, mask: Mask) -> Array:
        """Middles (x, y) of the cells in the mask, shape (n, 2), [m]."""
        rows, cols = np.nonzero(mask)
        return np.column_stack([self.x[cols], self.y[rows]])

    def window(self, x_min: float, y_min: float, x_max: float, y_max: float) -> tuple[slice, slice]:
        """Rows and columns of the cells whose middles lie in a box."""
        (x0, y0), size = self.origin, self.resolution_m
        rows, cols = self.shape
        first_row, last_row = np.clip(
            np.ceil([(y_min - y0) / size - 0.5, (y_max - y0) / size + 0.5]), 0, rows
        )
        first_col, last_col = np.clip(
            np.ceil([(x_min - x0) / size - 0.5, (x_max - x0) / size + 0.5]), 0, cols
        )
        return slice(int(first_row), int(last_row)), slice(int(first_col), int(last_col))


def lattice_over(world: World, resolution_m: float, grid: Lattice | None = None) -> Lattice:
    """A lattice over the whole world, or over world and map together with the map's own cells."""
    x_min, y_min, x_max, y_max = world.bounds
    if grid is None:
        margin = 2 * resolution_m
        first = np.floor(np.array([x_min - margin, y_min - margin]) / resolution_m) * resolution_m
        shape = np.ceil((np.array([x_max, y_max]) + margin - first) / resolution_m).astype(int)
        return Lattice((float(first[0]), float(first[1])), resolution_m, (int(shape[1]), int(shape[0])))
    above, right, below, left = _margins(world, grid)
    rows, cols = grid.shape
    origin = (grid.origin[0] - left * resolution_m, grid.origin[1] - below * resolution_m)
    return Lattice(origin, resolution_m, (rows + above + below, cols + left + right))


def _margins(world: World, grid: Lattice) -> tuple[int, int, int, int]:
    """Rows above, columns right, rows below, columns left that the map lacks to cover the world."""
    x_min, y_min, x_max, y_max = world.bounds
    (x0, y0), size = grid.origin, grid.resolution_m
    rows, cols = grid.shape
    missing = [
        (y_max - y0) / size - rows,
        (x_max - x0) / size - cols,
        (y0 - y_min) / size,
        (x0 - x_min) / size,
    ]
    above, right, below, left = (max(0, int(np.ceil(m)) + 2) for m in missing)
    return above, right, below, left


def overlap(world: World, grid: Lattice) -> tuple[slice, slice]:
    """Where the map lies in `lattice_over(world, ..., grid)`."""
    _, _, below, left = _margins(world, grid)
    return slice(below, below + grid.shape[0]), slice(left, left + grid.shape[1])


def clearance_on(world: World, lattice: Lattice, cap_m: float) -> Array:
    """Exact distance of each cell's middle to the nearest wall or cylinder, up to `cap_m`, [m]."""
    clearance = np.full(lattice.shape, cap_m)
    xs, ys = lattice.x, lattice.y
    # Each piece of wall touches only the cells about it; short pieces keep an oblique wall's box small.
    for piece in _pieces(world.walls, _STAMP_M)[0]:
        box = boxes(piece[None])[0] + (-cap_m, -cap_m, cap_m, cap_m)
        view = lattice.window(*box.tolist())
        x, y = np.meshgrid(xs[view[1]], ys[view[0]])
        distance = distances_to_walls(np.column_stack([x.ravel(), y.ravel()]), piece[None])[:, 0]
        np.minimum(clearance[view], distance.reshape(x.shape), out=clearance[view])
    for cx, cy, radius in world.cylinders.tolist():
        reach = radius + cap_m
        view = lattice.window(cx - reach, cy - reach, cx + reach, cy + reach)
        distance = np.hypot(xs[view[1]][None, :] - cx, ys[view[0]][:, None] - cy) - radius
        np.minimum(clearance[view], distance, out=clearance[view])
    return clearance


def reachable_cells(world: World, lattice: Lattice, clearance: Array) -> Mask:
    """Cells that the robot's disc can reach from the start, given the clearance of every cell [m]."""
    fits = clearance >= AmigoBot.radius_m - _EPSILON
    return _connected(world, lattice, fits)


def _connected(world: World, lattice: Lattice, cells: Mask) -> Mask:
    """The cells joined by their sides to the one nearest to the start."""
    x, y = world.start.x, world.start.y
    near = max(0.15, 2 * lattice.resolution_m)  # less than the clearance of a start: no wall in between
    view = lattice.window(x - near, y - near, x + near, y + near)
    connected = np.zeros_like(cells)
    rows, cols = np.nonzero(cells[view])
    if not len(rows):
        row, col = lattice.window(x, y, x + lattice.resolution_m, y + lattice.resolution_m)
        connected[row.start, col.start] = True
        return connected
    rows, cols = rows + view[0].start, cols + view[1].start
    nearest = np.hypot(lattice.x[cols] - x, lattice.y[rows] - y).argmin()
    labels, _ = ndimage.label(cells)
    connected[:] = labels == labels[rows[nearest], cols[nearest]]
    return connected


def free_on(world: World, lattice: Lattice) -> Mask:
    """Cells free in truth: joined to the start, with no wall nearer than half a cell to their middle."""
    half = lattice.resolution_m / 2
    clearance = clearance_on(world, lattice, 2 * lattice.resolution_m)
    # Between two neighbours farther than half a cell from any wall there is none. Where a wall runs exactly
    # between two rows of cells, both are at half a cell: they join the side that touches them.
    core = _connected(world, lattice, clearance > half + _EPSILON)
    beside = np.abs(clearance - half) <= _EPSILON
    free = core | (beside & ndimage.binary_dilation(core))
    corners = beside & ~free & (ndimage.convolve(free.astype(np.uint8), _CROSS, mode="constant") >= 2)
    for row, col in np.argwhere(corners):
        free[row, col] = _touches(world, lattice, free, int(row), int(col))
    return free


def _touches(world: World, lattice: Lattice, free: Mask, row: int, col: int) -> bool:
    """Whether a cell in a corner has a free neighbour with no wall in between."""
    neighbours = [(row + i, col + j) for i, j in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    rows, cols = free.shape
    inside = [(i, j) for i, j in neighbours if 0 <= i < rows and 0 <= j < cols and free[i, j]]
    between = np.array([(lattice.x[[col, j]].mean(), lattice.y[[row, i]].mean()) for i, j in inside])
    return bool((world.clearance(between) > lattice.resolution_m / 4).any())


def reachable_wall(world: World, lattice: Lattice, reachable: Mask) -> tuple[Array, Array]:
    """Middles (n, 2) and lengths (n,) of the pieces of wall that the robot can come close to, [m]."""
    from scipy.spatial import cKDTree  # here: 6 MB that an environment does not need

    points, normals, lengths = _wall_pieces(world, lattice.resolution_m / 2)
    cells = lattice.middles(reachable)
    # The disc stays this far from the last piece in a right-angled corner; the rest is for the lattice.
    close = np.sqrt(2) * AmigoBot.radius_m + 1.5 * lattice.resolution_m
    distance, index = cKDTree(cells).query(points, k=min(8, len(cells)), distance_upper_bound=close)
    distance, index = distance.reshape(len(points), -1), index.reshape(len(points), -1)
    obstacles = shapely.STRtree(
        [
            *shapely.linestrings(world.walls.reshape(-1, 2, 2)),
            *(shapely.Point(x, y).buffer(radius) for x, y, radius in world.cylinders),
        ]
    )
    seen = np.zeros(len(points), dtype=bool)
    for k in range(distance.shape[1]):
        todo = np.nonzero(~seen & np.isfinite(distance[:, k]))[0]
        if not len(todo):
            break
        seen[todo] = _in_sight(points[todo], normals[todo], cells[index[todo, k]], obstacles)
    return points[seen], lengths[seen]


def _in_sight(points: Array, normals: Array, cells: Array, obstacles: shapely.STRtree) -> Mask:
    """Whether nothing stands between each point on a wall and its cell."""
    side = np.sign(((cells - points) * normals).sum(axis=1, keepdims=True))
    lines = shapely.linestrings(np.stack([points + 1e-4 * side * normals, cells], axis=1))
    blocked = np.unique(obstacles.query(lines, predicate="intersects")[0])
    sight = np.ones(len(points), dtype=bool)
    sight[blocked] = False
    return sight


def _wall_pieces(world: World, length_m: float) -> tuple[Array, Array, Array]:
    """Middles, unit normals and lengths of short pieces of all walls and columns, overlaps counted once."""
    merged = shapely.unary_union(shapely.linestrings(world.walls.reshape(-1, 2, 2)))
    chains = [shapely.get_coordinates(line) for line in shapely.get_parts(merged)]
    circles = [_circle(*cylinder) for cylinder in world.cylinders.tolist()]
    walls = np.concatenate([np.hstack([c[:-1], c[1:]]) for c in [*chains, *circles]])
    pieces, lengths = _pieces(walls, length_m)
    along = (pieces[:, 2:] - pieces[:, :2]) / lengths[:, None]
    return (pieces[:, :2] + pieces[:, 2:]) / 2, np.column_stack([-along[:, 1], along[:, 0]]), lengths


def _circle(x: float, y: float, radius: float) -> Array:
    angle = np.linspace(0.0, 2 * np.pi, 33)
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


def _pieces(walls: Array, length_m: float) -> tuple[Array, Array]:
    """Walls (n, 4) cut into equal pieces no longer than `length_m`: (m, 4), and their lengths (m,), [m]."""
    lengths = np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1])
    counts = np.maximum(1, np.ceil(lengths / length_m - _EPSILON)).astype(int)
    wall = np.repeat(np.arange(len(walls)), counts)
    step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    start, vector = walls[wall, :2], walls[wall, 2:] - walls[wall, :2]
    first, last = (step / counts[wall])[:, None], ((step + 1) / counts[wall])[:, None]
    return np.hstack([start + first * vector, start + last * vector]), (lengths / counts)[wall]


def boxes(walls: Array) -> Array:
    """x_min y_min x_max y_max of each wall, shape (n, 4), [m]."""
    ends = walls.reshape(-1, 2, 2)
    return np.hstack([ends.min(axis=1), ends.max(axis=1)])
