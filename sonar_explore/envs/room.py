"""Room to move: how far places on a lattice are from walls and columns, and what a robot can reach.

Functions of plain walls (n, 4) and cylinders (m, 3), [m], so that readers can ask before there is a `World`.
The distance of a place is exact to the wall that is nearest on the lattice; another one may be nearer by less
than a cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sonar_explore.geometry import Array, Pose

Mask = NDArray[np.bool_]
Box = tuple[float, float, float, float]
"""(x_min, y_min, x_max, y_max), [m]."""

CELL_M = 0.05
MAX_CELLS = 1_000_000
"""A larger building gets a coarser lattice."""
GENEROUS_CLEARANCE_M = 1.0
"""More room about a start than this is no better."""
LEAST_BLOCK_M2 = 1.0
"""What a way must lead round to be a loop (docs/metrics.md), [m2]."""


@dataclass(frozen=True, eq=False)
class Room:
    """The clearance of a lattice of places: row 0 is the lowest y, column 0 the lowest x."""

    origin: tuple[float, float]
    """The place of cell (0, 0), [m]."""
    cell_m: float
    clearance: Array
    """Distance of each place to the nearest wall or column, shape (rows, cols), [m]; negative inside a column."""

    def places(self, rows: NDArray[np.integer], cols: NDArray[np.integer]) -> Array:
        """(x, y) of cells, shape (n, 2), [m]."""
        return np.column_stack([cols, rows]) * self.cell_m + self.origin

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """(row, col) of the place nearest to (x, y) on the lattice."""
        rows, cols = self.clearance.shape
        row, col = round((y - self.origin[1]) / self.cell_m), round((x - self.origin[0]) / self.cell_m)
        return min(max(row, 0), rows - 1), min(max(col, 0), cols - 1)

    def fits(self, radius_m: float) -> Mask:
        """Where a disc has room. Coarse cells ask for more, so that no two neighbours have a wall in between."""
        wide_enough: Mask = self.clearance >= max(radius_m - 1e-6, 0.51 * self.cell_m)
        return wide_enough

    def reachable(self, x: float, y: float, radius_m: float) -> Mask:
        """The cells that a disc can get to from (x, y)."""
        labels, _ = ndimage.label(self.fits(radius_m))
        row, col = self.cell(x, y)
        around = labels[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2]
        label = labels[row, col] or around.max()  # a tight start may lie between the places of the lattice
        return np.asarray(labels == label) if label else np.zeros(labels.shape, dtype=bool)


def bounds_of(walls: Array, cylinders: Array) -> Box:
    """The box about walls and cylinders."""
    centres, radii = cylinders[:, :2], cylinders[:, 2:]
    points = np.concatenate([walls[:, :2], walls[:, 2:], centres - radii, centres + radii])
    (x_min, y_min), (x_max, y_max) = points.min(axis=0), points.max(axis=0)
    return float(x_min), float(y_min), float(x_max), float(y_max)


def room_for(walls: Array, cylinders: Array, box: Box | None = None, cell_m: float = CELL_M) -> Room:
    """The room inside a box, by default the whole building."""
    x_min, y_min, x_max, y_max = box or bounds_of(walls, cylinders)
    cell = max(cell_m, float(np.sqrt((x_max - x_min) * (y_max - y_min) / MAX_CELLS)))
    cell = max(cell, max(x_max - x_min, y_max - y_min) / MAX_CELLS)
    shape = int((y_max - y_min) / cell) + 2, int((x_max - x_min) / cell) + 2
    walls, cylinders = near(walls, cylinders, (x_min, y_min, x_max, y_max))
    item = np.full(shape, -1, dtype=np.int32)
    points, owner = _samples(walls, cylinders, cell / 2)
    cols, rows = np.rint((points - (x_min, y_min)) / cell).astype(np.int64).T
    inside = (rows >= 0) & (rows < shape[0]) & (cols >= 0) & (cols < shape[1])
    item[rows[inside], cols[inside]] = owner[inside]
    if not inside.any():
        return Room((x_min, y_min), cell, np.full(shape, np.inf))
    nearest = ndimage.distance_transform_edt(item < 0, return_distances=False, return_indices=True)
    y, x = np.indices(shape, dtype=float) * cell
    clearance = _distance(x + x_min, y + y_min, item[tuple(nearest)], walls, cylinders)
    return Room((x_min, y_min), cell, clearance)


def near(walls: Array, cylinders: Array, box: Box, margin_m: float = 0.0) -> tuple[Array, Array]:
    """The walls and cylinders whose own boxes touch a box."""
    low, high = np.array(box[:2]) - margin_m, np.array(box[2:]) + margin_m
    first, last = np.minimum(walls[:, :2], walls[:, 2:]), np.maximum(walls[:, :2], walls[:, 2:])
    centres, radii = cylinders[:, :2], cylinders[:, 2:]
    return (
        walls[((first <= high) & (last >= low)).all(axis=1)],
        cylinders[((centres - radii <= high) & (centres + radii >= low)).all(axis=1)],
    )


def roomiest_place(walls: Array, cylinders: Array, radius_m: float) -> Pose | None:
    """Where a robot starts when nobody says: in the largest space that has walls on all four sides.

    There it has most room (up to 1 m), as near to the middle as that allows. None where it fits nowhere.
    """
    room = room_for(walls, cylinders)
    labels, count = ndimage.label(room.fits(radius_m) & _walled_in(room))
    if not count:
        return None
    space = labels == np.bincount(labels.ravel())[1:].argmax() + 1
    x, y = most_room(room, space)
    return Pose(x, y, 0.0)


def most_room(room: Room, space: Mask) -> tuple[float, float]:
    """The place in a space with most room (up to 1 m), the nearest of them to its middle, [m]."""
    most = room.clearance[space].max()
    rows, cols = np.nonzero(space & (room.clearance >= min(GENEROUS_CLEARANCE_M, 0.9 * most)))
    middle = np.argwhere(space).mean(axis=0)
    best = np.hypot(rows - middle[0], cols - middle[1]).argmin()
    x, y = room.places(rows[[best]], cols[[best]])[0].tolist()
    return x, y


def loops(reachable: Mask, cell_m: float) -> int:
    """How many blocks of 1 m2 or more a robot can drive round."""
    holes, _ = ndimage.label(ndimage.binary_fill_holes(reachable) & ~reachable)
    areas = np.bincount(holes.ravel())[1:] * cell_m**2
    return int((areas >= LEAST_BLOCK_M2).sum())


def _walled_in(room: Room) -> Mask:
    """Cells with a wall somewhere to the left, right, above and below."""
    wall = room.clearance <= 0.75 * room.cell_m
    inside = np.ones(wall.shape, dtype=bool)
    for axis in (0, 1):
        inside &= np.logical_or.accumulate(wall, axis=axis)
        inside &= np.flip(np.logical_or.accumulate(np.flip(wall, axis), axis=axis), axis)
    return inside


def _samples(walls: Array, cylinders: Array, step_m: float) -> tuple[Array, NDArray[np.int32]]:
    """Points no farther apart than a step on walls and circles, (n, 2), and the row of each one's owner."""
    lengths = np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1])
    owner, share = _shares(lengths, step_m)
    on_walls = walls[owner, :2] + share[:, None] * (walls[owner, 2:] - walls[owner, :2])
    circle, turn = _shares(2 * np.pi * cylinders[:, 2], step_m)
    around = np.column_stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)])
    on_circles = cylinders[circle, :2] + cylinders[circle, 2:] * around
    owners = np.concatenate([owner, circle + len(walls)]).astype(np.int32)
    return np.concatenate([on_walls, on_circles]), owners


def _shares(lengths: Array, step_m: float) -> tuple[NDArray[np.int64], Array]:
    """For each length cut into equal steps: its row, and how far along, from 0 to 1 with both ends."""
    counts = np.ceil(lengths / step_m).astype(np.int64) + 1
    owner = np.repeat(np.arange(len(lengths)), counts)
    index = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return owner, index / np.maximum(counts[owner] - 1, 1)


def _distance(x: Array, y: Array, item: NDArray[np.int32], walls: Array, cylinders: Array) -> Array:
    """Distance of each place to its own wall or cylinder, shape of x, [m]."""
    round_ones = item >= len(walls)
    distance = np.empty(x.shape)
    if round_ones.any():
        cx, cy, radius = cylinders[item[round_ones] - len(walls)].T
        distance[round_ones] = np.hypot(x[round_ones] - cx, y[round_ones] - cy) - radius
    straight = ~round_ones
    if straight.any():
        x1, y1, x2, y2 = walls[item[straight]].T
        dx, dy, px, py = x2 - x1, y2 - y1, x[straight] - x1, y[straight] - y1
        share = np.clip((px * dx + py * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0.0, 1.0)
        distance[straight] = np.hypot(px - share * dx, py - share * dy)
    return distance
