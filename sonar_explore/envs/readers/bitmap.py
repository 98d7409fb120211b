"""The edges of a bitmap's free space as few, long, straight walls: what every drawing goes through.

A sonar hears planes, and a staircase of pixels is none. The edge of the free space is therefore cut into
runs that stay within about half a pixel of a straight line, each run becomes the line fitted to it, and
neighbouring lines meet where they cross. Specks too small to tell their shape become round columns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import find_contours

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.room import GENEROUS_CLEARANCE_M, loops
from sonar_explore.envs.validation import MAX_CYLINDERS, MAX_WALLS, validate
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

Mask = NDArray[np.bool_]

MAX_EDGE_PIXELS = 400_000
"""Of the free space; more is no drawing of walls."""
RUN_TOLERANCE_PX = 0.7
"""How far the edge of the drawing may lie from the line fitted to it."""
SPECK_PX = 3.0
"""Up to this size a drawing cannot tell round from square: a column, heard from all sides."""
PAPER_SHARE = 0.9
"""Of the image's rim: what runs along so much of it lies about the building, not in it."""
_MAX_CORNER_SHIFT_PX = 1.5
_MAX_CORNERS_MERGED = 3_000


@dataclass(frozen=True)
class Bitmap:
    """Free space in pixels, row 0 on top, and where it lies."""

    name: str
    """The file's name, for errors."""
    free: Mask
    resolution_m: float
    """Metres per pixel."""
    origin: Pose = Pose(0.0, 0.0, 0.0)  # noqa: RUF009 - a frozen value
    """`pose_image_in_world`: the image's frame has its origin at the lower left corner, y up."""


def bitmap_world(bitmap: Bitmap, title: str, start: Pose | None = None) -> World:
    """The world of the free space that holds the start; the edge of the image is a wall.

    Without a start, it is the largest free space that does not run off the image, and the robot starts
    where it has most room (up to 1 m), as near to the middle as that allows.
    """
    if not bitmap.resolution_m > 0.0 or not np.isfinite(bitmap.resolution_m):
        raise SonarExploreError(
            f"{bitmap.name}: resolution {bitmap.resolution_m} m per pixel; it must be a number above 0"
        )
    start_in_image = None if start is None else bitmap.origin.inverse() @ start
    component, start_in_image = _component(bitmap, start_in_image)
    outline = _trace(bitmap.name, component, bitmap.resolution_m)
    return validate(
        World(
            name=bitmap.name.rpartition(".")[0] or bitmap.name,
            title=title,
            walls=bitmap.origin.transform(outline.walls.reshape(-1, 2)).reshape(-1, 4),
            roughness=np.zeros(len(outline.walls)),
            cylinders=np.hstack(
                [bitmap.origin.transform(outline.cylinders[:, :2]), outline.cylinders[:, 2:]]
            ),
            start=bitmap.origin @ start_in_image if start is None else start,
            has_loop=_has_loop(component, bitmap.resolution_m, start_in_image),
        )
    )


def _component(bitmap: Bitmap, start: Pose | None) -> tuple[Mask, Pose]:
    """The free space that holds the start, and the start, in the image's frame."""
    free, resolution_m = bitmap.free, bitmap.resolution_m
    labels, _ = ndimage.label(free)
    if start is None:
        label = _largest_room(labels, free, resolution_m)
        if label == 0:
            raise SonarExploreError(
                f"{bitmap.name}: no free space wide enough for the robot at {resolution_m:g} m per pixel"
            )
        component = labels == label
        return component, _best_start(component, resolution_m)
    rows = free.shape[0]
    row, col = int(np.floor(rows - start.y / resolution_m)), int(np.floor(start.x / resolution_m))
    if not (0 <= row < rows and 0 <= col < free.shape[1]):
        raise SonarExploreError(
            f"{bitmap.name}: the start ({(bitmap.origin @ start).x:.2f}, {(bitmap.origin @ start).y:.2f}) "
            "is outside the image, which spans "
            f"{free.shape[1] * resolution_m:.2f} x {rows * resolution_m:.2f} m"
        )
    if labels[row, col] == 0:
        best = bitmap.origin @ _best_start(labels == _largest_room(labels, free, resolution_m), resolution_m)
        said = bitmap.origin @ start
        raise SonarExploreError(
            f"{bitmap.name}: the start ({said.x:.2f}, {said.y:.2f}) is inside a wall; "
            f"free: ({best.x:.2f}, {best.y:.2f})"
        )
    return labels == labels[row, col], start


def _largest_room(labels: NDArray[np.int32], free: Mask, resolution_m: float) -> int:
    """Label of the free space with most room for the robot; 0 where it fits nowhere.

    What covers the rim of the image is the paper about the building, unless there is next to nothing inside.
    """
    fits = labels[_clearance(free, resolution_m) >= AmigoBot.radius_m]
    areas = np.bincount(fits, minlength=int(labels.max()) + 1)
    areas[0] = 0
    inner = areas.copy()
    rim = np.bincount(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    paper = int(rim[1:].argmax()) + 1 if len(rim) > 1 else 0
    if rim[paper] >= PAPER_SHARE * rim.sum():
        inner[paper] = 0
    best = inner if inner.max() >= areas.max() / 10 else areas
    return int(best.argmax()) if best.max() > 0 else 0


def _best_start(component: Mask, resolution_m: float) -> Pose:
    clearance = _clearance(component, resolution_m)
    places = np.argwhere(clearance >= min(GENEROUS_CLEARANCE_M, 0.9 * clearance.max()))
    middle = np.argwhere(component).mean(axis=0)
    row, col = places[np.hypot(*(places - middle).T).argmin()]
    return Pose(
        float(col + 0.5) * resolution_m, float(component.shape[0] - row - 0.5) * resolution_m, heading=0.0
    )


def _clearance(free: Mask, resolution_m: float) -> Array:
    """Distance of each pixel's middle to the edge of the free space, within about half a pixel, [m]."""
    clearance = np.full(free.shape, -0.5 * resolution_m)
    for box in ndimage.find_objects(free.astype(np.uint8)):  # most of a map may be unknown
        padded = ndimage.distance_transform_edt(np.pad(free[box], 1))
        clearance[box] = (padded[1:-1, 1:-1] - 0.5) * resolution_m
    return clearance


def _has_loop(component: Mask, resolution_m: float, start: Pose) -> bool:
    """Whether the robot can drive round something larger than a table."""
    labels, _ = ndimage.label(_clearance(component, resolution_m) >= AmigoBot.radius_m)
    row, col = int(component.shape[0] - start.y / resolution_m), int(start.x / resolution_m)
    return bool(labels[row, col] and loops(labels == labels[row, col], resolution_m))


@dataclass(frozen=True)
class _Outline:
    """The edges of a drawing's free space, in the image's frame: x right, y up, origin in its lower left corner."""

    walls: Array
    """x1 y1 x2 y2, shape (n, 4), [m]."""
    cylinders: Array
    """x y radius, shape (m, 3), [m]."""


def _trace(name: str, component: Mask, resolution_m: float) -> _Outline:
    """The edges of the free space as straight walls and columns, in the image's frame."""
    _check_edges(name, component)
    rows = component.shape[0]
    walls, cylinders = [np.empty((0, 4))], [np.empty((0, 3))]
    # The midpoints of the pixel edges between free and wall; wall pixels that touch by a corner are one wall.
    for contour in find_contours(np.pad(component, 1).astype(float), 0.5, fully_connected="low"):
        ring = np.column_stack([contour[:-1, 1] - 0.5, rows - (contour[:-1, 0] - 0.5)])
        size = np.ptp(ring, axis=0)
        if size.max() <= SPECK_PX:
            middle, radius = ring.min(axis=0) + size / 2, np.sqrt(size.prod() / np.pi)
            cylinders.append(np.array([[*middle, radius]]))
        else:
            corners = straighten(ring)
            walls.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    return _Outline(np.concatenate(walls) * resolution_m, np.concatenate(cylinders) * resolution_m)


def _check_edges(name: str, component: Mask) -> None:
    """A photograph or noise would take minutes to trace, and give more walls than a world may have."""
    edges = int((component[1:] != component[:-1]).sum() + (component[:, 1:] != component[:, :-1]).sum())
    _, holes = ndimage.label(~component)
    if edges > MAX_EDGE_PIXELS or holes > MAX_CYLINDERS + MAX_WALLS / 3:
        raise SonarExploreError(
            f"{name}: the edge of the free space is {edges} pixels long in {holes} pieces; "
            "this is no drawing of walls (a photograph, noise, the wrong threshold?)"
        )


def straighten(ring: Array, tolerance: float = RUN_TOLERANCE_PX) -> Array:
    """Corners (k, 2) of the polygon of few straight sides that follows a closed ring of points (n, 2)."""
    ring = _start_at_corner(ring)
    ends = _corner_indices(ring, tolerance)
    if len(ends) <= _MAX_CORNERS_MERGED:  # a ring that ragged stays so: merging looks at all for each
        ends = _merge_runs(ring, ends, tolerance)
    if len(ends) < 3:
        return ring[_corner_indices(ring, tolerance)]
    lines = [_fit(ring, i, j) for i, j in zip(ends, [*ends[1:], ends[0] + len(ring)], strict=True)]
    return np.array(
        [_meet(lines[k - 1], lines[k], ring[end % len(ring)]) for k, end in enumerate(ends)], dtype=float
    )


def _start_at_corner(ring: Array) -> Array:
    """The ring turned to start at its outermost point: Douglas-Peucker always keeps the first."""
    far = int(np.hypot(*(ring - ring.mean(axis=0)).T).argmax())
    return np.roll(ring, -far, axis=0)


def _corner_indices(ring: Array, tolerance: float) -> list[int]:
    """Indices of the ring's points that Douglas-Peucker keeps."""
    closed = np.vstack([ring, ring[:1]])
    half = int(np.hypot(*(ring - ring[0]).T).argmax())
    kept: list[int] = []
    for first, last in ((0, half), (half, len(ring))):
        line = shapely.LineString(closed[first : last + 1])
        points = shapely.get_coordinates(line.simplify(tolerance, preserve_topology=False))
        kept += _indices_of(closed[first : last + 1], points[:-1], first)
    return kept


def _indices_of(points: Array, subset: Array, offset: int) -> list[int]:
    """Where an ordered subset of distinct points stands among them."""
    at = {(x, y): i for i, (x, y) in enumerate(points.tolist())}
    if (first := tuple(points[0].tolist())) in at:
        at[first] = 0
    return [at[x, y] + offset for x, y in subset.tolist()]


def _merge_runs(ring: Array, ends: list[int], tolerance: float) -> list[int]:
    """Drop, best first, the corners between two runs that one straight line fits as well."""
    n, ends = len(ring), list(ends)

    def misfit(k: int) -> float:
        """How far off one line through both runs at this corner is; inf where they are none."""
        i, j = ends[k - 1], ends[(k + 1) % len(ends)]
        i, j = (i - n if k == 0 else i), (j + n if k == len(ends) - 1 else j)
        turned_back = (ring[ends[k]] - ring[i % n]) @ (ring[j % n] - ring[ends[k]]) <= 0.0
        return np.inf if turned_back else _fit_error(ring, i, j)  # both sides of a thin wall are no one run

    errors = [misfit(k) for k in range(len(ends))]
    while len(ends) > 3 and min(errors) <= tolerance:
        k = int(np.argmin(errors))
        del ends[k], errors[k]
        for neighbour in {(k - 1) % len(ends), k % len(ends)}:
            errors[neighbour] = misfit(neighbour)
    return ends


_Line = tuple[Array, Array]
"""A point and the unit direction."""


def _fit(ring: Array, i: int, j: int) -> _Line:
    """The line of least squared distances to the points i to j of the ring, less those at rounded corners."""
    points = ring[np.arange(i, j + 1) % len(ring)]
    if len(points) > 4:
        points = points[1:-1]
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    return middle, axes[0]


def _fit_error(ring: Array, i: int, j: int) -> float:
    middle, direction = _fit(ring, i, j)
    offsets = ring[np.arange(i + 1, j) % len(ring)] - middle
    return float(np.abs(offsets[:, 0] * direction[1] - offsets[:, 1] * direction[0]).max(initial=0.0))


def _meet(before: _Line, after: _Line, corner: Array) -> Array:
    """Where two lines cross; where that is far from the drawn corner, the corner drawn onto both."""
    (p, d), (q, e) = before, after
    cross = d[0] * e[1] - d[1] * e[0]
    if abs(cross) > 1e-3:
        offset = q - p
        crossing: Array = p + d * (offset[0] * e[1] - offset[1] * e[0]) / cross
        if np.hypot(*(crossing - corner)) <= _MAX_CORNER_SHIFT_PX:
            return crossing
    on_both: Array = 0.5 * (p + d * ((corner - p) @ d) + q + e * ((corner - q) @ e))
    return on_both
