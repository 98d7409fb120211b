"""What is in a world: areas, passages, loops, and what looks wrong with it.

The free space is the polygon of walls round the start; where walls do not close, the building's own bounding
box closes it. Passages come from a lattice: where two roomy places are joined by a narrower one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage
from skimage.morphology import h_maxima
from skimage.segmentation import watershed

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.room import LEAST_BLOCK_M2, Mask, Room, loops, room_for
from sonar_explore.envs.validation import nearest_free_place
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array
from sonar_explore.wording import counted

DOOR_MAX_M = 1.10
"""A wider passage is no door, [m]."""
NARROWER_M = 0.15
"""A passage leaves a disc this much less than the places on both sides, in radius, [m]."""
ROOMY_M = 0.50
"""Passages lead from one place with this much room to another; gaps under a table do not count, [m]."""
LEAST_CLOSED_OFF_M2 = 0.5
"""Less than that is the inside of furniture, [m2]."""
_MOST_CROSSINGS = 500_000
_SAMPLE = 200


@dataclass(frozen=True)
class Survey:
    """What was read."""

    extent_m: tuple[float, float]
    """Width and height of the box about all walls."""
    walls: int
    wall_length_m: float
    columns: int
    free_area_m2: float
    """Of the space that the start is in."""
    reached_area_m2: float
    """Of it, what the robot's disc sweeps."""
    passages: Array
    """x y width of the narrow places between roomier ones, shape (n, 3), the narrowest first, [m]."""
    loops: int
    """Blocks of 1 m2 or more that the robot can drive round."""
    closed_off_m2: tuple[float, ...]
    """Where the robot's centre would have room, but walls all round keep it out, largest first, [m2]."""
    closed: bool
    """Whether walls enclose the start."""
    warnings: tuple[str, ...]

    @property
    def reached_share(self) -> float:
        """0 to 1."""
        return self.reached_area_m2 / self.free_area_m2 if self.free_area_m2 else 0.0

    @property
    def doors(self) -> int:
        """Passages no wider than a door."""
        return int((self.passages[:, 2] <= DOOR_MAX_M).sum())

    @property
    def narrowest_m(self) -> float | None:
        """Width of the narrowest passage; None where there is none."""
        return float(self.passages[0, 2]) if len(self.passages) else None


def survey(world: World) -> Survey:
    """Look a world over."""
    x_min, y_min, x_max, y_max = world.bounds
    room = room_for(world.walls, world.cylinders, (x_min - 0.1, y_min - 0.1, x_max + 0.1, y_max + 0.1))
    reachable = room.reachable(world.start.x, world.start.y, AmigoBot.radius_m)
    closed = not (reachable[[0, -1]].any() or reachable[:, [0, -1]].any())
    free_m2, reached_m2, rounds = _areas(world, room, reachable)
    passages = _passages(room, reachable)
    return Survey(
        extent_m=(x_max - x_min, y_max - y_min),
        walls=len(world.walls),
        wall_length_m=float(np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T).sum()),
        columns=len(world.cylinders),
        free_area_m2=free_m2,
        reached_area_m2=reached_m2,
        passages=passages,
        loops=rounds,
        closed_off_m2=_closed_off(room, reachable),
        closed=closed,
        warnings=_warnings(world, room, reachable, free_m2, reached_m2, closed),
    )


def _areas(world: World, room: Room, reachable: Mask) -> tuple[float, float, int]:
    """Free area, swept area [m2] and the number of loops."""
    free = _free_polygon(world)
    if free is None:
        cell = room.cell_m**2
        swept = ndimage.distance_transform_edt(~reachable) * room.cell_m <= AmigoBot.radius_m
        labels, _ = ndimage.label(room.clearance > 0.51 * room.cell_m)
        row, col = room.cell(world.start.x, world.start.y)
        return (
            float((labels == labels[row, col]).sum() * cell),
            float(swept.sum() * cell),
            loops(reachable, room.cell_m),
        )
    start = shapely.Point(world.start.x, world.start.y)
    centres = shapely.get_parts(free.buffer(-AmigoBot.radius_m + 1e-6, quad_segs=8))
    centres = centres[shapely.distance(centres, start) < 0.02]
    if not len(centres):
        return float(free.area), 0.0, 0
    swept = centres[0].buffer(AmigoBot.radius_m, quad_segs=8).intersection(free)
    blocks = [shapely.Polygon(ring).area for ring in centres[0].interiors]
    return float(free.area), float(swept.area), sum(area >= LEAST_BLOCK_M2 for area in blocks)


def _closed_off(room: Room, reachable: Mask) -> tuple[float, ...]:
    """Areas that the robot would fit in and that neither it nor the outside can get to, largest first, [m2]."""
    labels, _ = ndimage.label((room.clearance >= AmigoBot.radius_m) & ~reachable)
    area = np.bincount(labels.ravel()) * room.cell_m**2
    area[0] = 0.0
    for rim in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        area[rim] = 0.0
    return tuple(np.sort(area[area >= LEAST_CLOSED_OFF_M2])[::-1].tolist())


def _free_polygon(world: World) -> shapely.Polygon | None:
    """The space that the start is in, without columns; None where walls cross too often to tell quickly."""
    if _crossings(world.walls) > _MOST_CROSSINGS:
        return None
    frame = shapely.box(*world.bounds).exterior
    lines = shapely.linestrings(world.walls.reshape(-1, 2, 2))
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(shapely.unary_union([*lines, frame]))))
    faces = faces[shapely.contains_xy(faces, world.start.x, world.start.y)]
    if not len(faces):
        return None
    columns = shapely.buffer(shapely.points(world.cylinders[:, :2]), world.cylinders[:, 2])
    return faces[shapely.area(faces).argmin()].difference(shapely.union_all(columns))


def _crossings(walls: Array) -> float:
    """About how many pairs of walls may cross: those whose boxes touch, from a sample."""
    low, high = np.minimum(walls[:, :2], walls[:, 2:]), np.maximum(walls[:, :2], walls[:, 2:])
    some = np.linspace(0, len(walls) - 1, min(_SAMPLE, len(walls))).astype(int)
    touch = ((low[some, None] <= high) & (high[some, None] >= low)).all(axis=2)
    return float(touch.sum(axis=1).mean() * len(walls))


def _passages(room: Room, reachable: Mask) -> Array:
    """x y width of the narrow places between roomier ones, shape (n, 3), the narrowest first, [m]."""
    clearance = np.where(reachable, np.minimum(room.clearance, 1.5), 0.0)
    markers, count = ndimage.label(h_maxima(clearance, NARROWER_M), np.ones((3, 3)))
    if count < 2:
        return np.empty((0, 3))
    basins = watershed(-clearance, markers, mask=reachable)
    peaks = ndimage.maximum(clearance, basins, np.arange(basins.max() + 1))
    between = [(a, b, cells) for a, b, cells in _borders(basins) if min(peaks[a], peaks[b]) >= ROOMY_M]
    found = []
    for one, other, cells in between:
        best = cells[clearance[tuple(cells.T)].argmax()]
        x, y = room.places(best[None, 0], best[None, 1])[0]
        found.append((x, y, 2 * _clearance_between(clearance, basins, best, one, other)))
    passages = np.array(found).reshape(-1, 3)
    return passages[np.argsort(passages[:, 2], kind="stable")]


def _borders(basins: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """The pieces of border between two basins: their labels, and cells (n, 2)."""
    pairs: dict[tuple[int, int], list[np.ndarray]] = {}
    for axis in (0, 1):
        here = np.take(basins, range(basins.shape[axis] - 1), axis)
        there = np.take(basins, range(1, basins.shape[axis]), axis)
        rows, cols = np.nonzero((here != there) & (here > 0) & (there > 0))
        labels = np.sort(np.column_stack([here[rows, cols], there[rows, cols]]), axis=1)
        for pair in np.unique(labels, axis=0):
            at = (labels == pair).all(axis=1)
            pairs.setdefault((int(pair[0]), int(pair[1])), []).append(np.column_stack([rows[at], cols[at]]))
    pieces = []
    for (one, other), cells in pairs.items():
        mask = np.zeros(basins.shape, dtype=bool)
        mask[tuple(np.concatenate(cells).T)] = True
        box = ndimage.find_objects(mask.astype(np.uint8))[0]
        labels, count = ndimage.label(ndimage.binary_dilation(np.pad(mask[box], 3), iterations=2))
        labels = labels[3:-3, 3:-3]
        for k in range(1, count + 1):
            rows, cols = np.nonzero((labels == k) & mask[box])
            pieces.append((one, other, np.column_stack([rows + box[0].start, cols + box[1].start])))
    return pieces


def _clearance_between(clearance: Array, basins: np.ndarray, cell: np.ndarray, one: int, other: int) -> float:
    """The best clearance of a step over the border at a cell: that of the worse of its two cells."""
    row, col = int(cell[0]), int(cell[1])
    near = clearance[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2]
    sides = basins[max(0, row - 1) : row + 2, max(0, col - 1) : col + 2]
    return float(min(near[sides == label].max(initial=0.0) for label in (one, other)))


def _warnings(
    world: World, room: Room, reachable: Mask, free_m2: float, reached_m2: float, closed: bool
) -> tuple[str, ...]:
    found = []
    width, height = world.bounds[2] - world.bounds[0], world.bounds[3] - world.bounds[1]
    if max(width, height) < 2.5 or max(width, height) > 150.0:
        found.append(f"{width:.1f} x {height:.1f} m: is the scale right?")
    elif reached_m2 < 3.0:
        found.append(f"the robot reaches {reached_m2:.1f} m2 only: is the scale right?")
    elif reached_m2 < 0.8 * free_m2:
        found.append(
            f"the robot reaches {100 * reached_m2 / free_m2:.0f} % of the free area: doors narrower than "
            f"{2 * AmigoBot.radius_m:.2f} m, or the wrong scale?"
        )
    if room.clearance[reachable].max(initial=0.0) > 12.0:
        found.append(
            "a place is more than 12 m from every wall: a sonar hears nothing there; is the scale right?"
        )
    if not closed:
        found.append("the walls do not close: the robot can leave the building; it is scored within its box")
    clearance = float(world.clearance(np.array([[world.start.x, world.start.y]]))[0])
    if clearance < AmigoBot.radius_m + 0.05:
        place = nearest_free_place(world)
        offer = "" if place is None else f"; free: ({place[0]:.2f}, {place[1]:.2f})"
        found.append(f"the start is {clearance:.2f} m from a wall, the robot's radius is 0.18 m{offer}")
    return tuple(found)


def as_json(world: World, found: Survey) -> dict[str, object]:
    """What `sonar-explore world --json` prints."""
    return {
        "name": world.name,
        "title": world.title,
        "extent_m": [round(m, 3) for m in found.extent_m],
        "walls": found.walls,
        "wall_length_m": round(found.wall_length_m, 2),
        "columns": found.columns,
        "start": [
            round(world.start.x, 3),
            round(world.start.y, 3),
            round(float(np.degrees(world.start.heading)), 1),
        ],
        "free_area_m2": round(found.free_area_m2, 2),
        "reached_area_m2": round(found.reached_area_m2, 2),
        "reached_share": round(found.reached_share, 4),
        "narrow_passages": found.doors,
        "narrowest_passage_m": None if found.narrowest_m is None else round(found.narrowest_m, 3),
        "has_loop": bool(world.has_loop),
        "loops": found.loops,
        "closed_off_m2": [round(m2, 2) for m2 in found.closed_off_m2],
        "closed": found.closed,
        "warnings": list(found.warnings),
    }


def as_text(world: World, found: Survey) -> str:
    """What `sonar-explore world` prints: a line for each fact, warnings last."""
    narrowest = "none" if found.narrowest_m is None else f"{found.narrowest_m:.2f} m"
    heading = float(np.degrees(world.start.heading))
    rows = [
        ("extent", f"{found.extent_m[0]:.1f} x {found.extent_m[1]:.1f} m"),
        ("walls", f"{found.walls}, {found.wall_length_m:.0f} m together; {counted(found.columns, 'column')}"),
        ("start", f"({world.start.x:.2f}, {world.start.y:.2f}) m, {heading:.0f} deg"),
        ("free area", f"{found.free_area_m2:.1f} m2"),
        ("within reach", f"{found.reached_area_m2:.1f} m2, {100 * found.reached_share:.1f} %"),
        (
            "narrow passages",
            f"{found.doors} no wider than {DOOR_MAX_M:.1f} m; the narrowest of all: {narrowest}",
        ),
        ("loops", str(found.loops)),
        *_closed_off_row(found),
        *(("warning", warning) for warning in found.warnings),
    ]
    return "\n".join([f"{world.name}: {world.title}", *(f"  {label:16s}{value}" for label, value in rows)])


def _closed_off_row(found: Survey) -> list[tuple[str, str]]:
    if not found.closed_off_m2:
        return []
    pieces, each = len(found.closed_off_m2), ", ".join(f"{m2:.1f}" for m2 in found.closed_off_m2[:5])
    more = "" if pieces <= 5 else ", ..."
    return [("closed off", f"{each}{more} m2 that the robot would fit in: solid, or a room without a door?")]
