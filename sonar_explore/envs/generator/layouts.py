"""Rooms and doors before there is furniture: the four kinds of building.

A building is cut into rectangular cells that share their edges; a room is its cell less half a wall all
round, and a door is a hole in the wall between two cells. The first doors drawn join everything; more of
them make loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from sonar_explore.geometry import Array

WALL_M = 0.12
"""Thickness of a wall inside, [m]."""
DOOR_MIN_M, DOOR_MAX_M = 0.80, 0.90
JAMB_M = 0.15
"""A door keeps this far from a corner, [m]."""
_OVERLAP_M = 0.02
_STUB_M = 0.5

Rect = tuple[float, float, float, float]
"""(x_min, y_min, x_max, y_max), [m]."""


@dataclass(frozen=True)
class Room:
    """A room, or all corridors together."""

    shape: shapely.Polygon
    furnished: bool = True
    """False for corridors: no more than pillars and a plant."""


@dataclass(frozen=True)
class Door:
    """A hole in the wall between two rooms."""

    rooms: tuple[int, int]
    middle: tuple[float, float]
    along: tuple[float, float]
    """Unit vector along the wall."""
    width_m: float

    def hole(self, reach_m: float = WALL_M / 2 + _OVERLAP_M) -> shapely.Polygon:
        """The rectangle that the door cuts, to this far on both sides of the wall's middle."""
        (x, y), (ax, ay) = self.middle, self.along
        ax, ay = ax * self.width_m / 2, ay * self.width_m / 2
        bx, by = -self.along[1] * reach_m, self.along[0] * reach_m
        sides = ((ax + bx, ay + by), (bx - ax, by - ay), (-ax - bx, -ay - by), (ax - bx, ay - by))
        return shapely.Polygon([(x + dx, y + dy) for dx, dy in sides])

    def stub(self) -> shapely.Polygon:
        """The hole and some way beyond: what a room must stay connected to."""
        return self.hole(_STUB_M)


@dataclass(frozen=True)
class Layout:
    """The free space of a building before it is furnished."""

    rooms: list[Room]
    doors: list[Door]


def office(rng: np.random.Generator, difficulty: float) -> Layout:
    """Rooms in bands on both sides of a corridor that is straight, T-shaped or a ring."""
    corridor_m = rng.uniform(1.5, 2.1)
    shape = rng.choice(["straight", "tee", "ring"], p=_shares(difficulty, [0.6, 0.3, 0.1], [0.1, 0.35, 0.55]))
    depth = rng.uniform(2.8, 4.2, size=3)
    if shape == "straight":
        width = rng.uniform(8.0, 10.0) + 8.0 * difficulty * rng.random()
        y = np.cumsum([0.0, depth[0], corridor_m, depth[1]])
        corridors = [(0.0, y[1], width, y[2])]
        bands = [(0.0, 0.0, width, y[1]), (0.0, y[2], width, y[3])]
    elif shape == "tee":
        left, right = rng.uniform(4.0, 6.0 + 3.0 * difficulty, size=2)
        up = rng.uniform(4.5, 6.0 + 3.0 * difficulty)
        x, y = np.cumsum([0.0, left, corridor_m, right]), np.cumsum([0.0, depth[0], corridor_m, up])
        corridors = [(0.0, y[1], x[3], y[2]), (x[1], y[2], x[2], y[3])]
        bands = [(0.0, 0.0, x[3], y[1]), (0.0, y[2], x[1], y[3]), (x[2], y[2], x[3], y[3])]
    else:
        core = rng.uniform(2.6, 3.2, size=2) + rng.uniform(0.0, 4.0 * difficulty, size=2)
        x = np.cumsum([0.0, depth[0], corridor_m, core[0], corridor_m, depth[1]])
        y = np.cumsum([0.0, depth[2], corridor_m, core[1], corridor_m])
        corridors = [
            (x[1], y[1], x[4], y[2]),
            (x[1], y[3], x[4], y[4]),
            (x[1], y[1], x[2], y[4]),
            (x[3], y[1], x[4], y[4]),
        ]
        bands = [
            (0.0, y[1], x[1], y[4]),
            (x[4], y[1], x[5], y[4]),
            (x[1], 0.0, x[4], y[1]),
            (x[2], y[2], x[3], y[3]),
        ]
    cells = [cell for band in bands for cell in _row_of_rooms(rng, band)]
    rooms = [Room(_corridor(corridors), furnished=False), *(Room(_inset(cell)) for cell in cells)]
    doors = []
    for i, cell in enumerate(cells, start=1):
        to_corridor = [edge for corridor in corridors if (edge := _shared_edge(cell, corridor)) is not None]
        doors.append(_door(rng, (0, i), to_corridor[rng.integers(len(to_corridor))], difficulty))
    for i, j, edge in _neighbours(cells):
        if rng.random() < 0.25 * difficulty:
            doors.append(_door(rng, (i + 1, j + 1), edge, difficulty))
    return Layout(rooms, doors)


def home(rng: np.random.Generator, difficulty: float) -> Layout:
    """A rectangle cut again and again, until its rooms are small enough."""
    scale = rng.uniform(0.9, 1.1) * (0.85 + 0.4 * difficulty)
    cells = _cut(rng, (0.0, 0.0, 10.0 * scale, 7.5 * scale), largest_m2=rng.uniform(14.0, 20.0))
    return _joined(rng, cells, difficulty, extra=0.1 + 0.3 * difficulty)


def maze(rng: np.random.Generator, difficulty: float) -> Layout:
    """Corridors along a grid; where it is difficult, with loops and narrow places."""
    pitch = rng.uniform(1.55, 1.95)
    columns, rows = (
        int(n)
        for n in rng.integers(3, 5, size=2)
        + rng.integers(round(difficulty), 1 + round(4 * difficulty), size=2)
    )
    cells = [
        (c * pitch, r * pitch, (c + 1) * pitch, (r + 1) * pitch) for r in range(rows) for c in range(columns)
    ]
    tree, others = _spanning_tree(rng, len(cells), _neighbours(cells, least=0.5))
    rest = [link for link in others if rng.random() < 0.02 + 0.13 * difficulty]
    doors = []
    for i, j, edge in [*tree, *rest]:
        if rng.random() < 0.25 * difficulty:
            doors.append(_door(rng, (i, j), edge, difficulty))
        else:
            doors.append(_opening((i, j), edge, pitch - WALL_M))
    return Layout([Room(_inset(cell), furnished=False) for cell in cells], doors)


def hall(rng: np.random.Generator, difficulty: float) -> Layout:
    """One large room of five to eight slanting walls; pillars and screens come with the furniture."""
    corners = int(rng.integers(5, 9))
    angle = (np.arange(corners) + rng.uniform(-0.25, 0.25, corners)) * 2 * np.pi / corners
    size = np.array([rng.uniform(4.0, 5.0), rng.uniform(3.0, 4.0)]) * (1.0 + 0.7 * difficulty)
    shape = shapely.Polygon(size * np.column_stack([np.cos(angle), np.sin(angle)]))
    return Layout([Room(shape)], [])


def _shares(difficulty: float, easy: list[float], hard: list[float]) -> Array:
    return (1.0 - difficulty) * np.array(easy) + difficulty * np.array(hard)


def _row_of_rooms(rng: np.random.Generator, band: Rect) -> list[Rect]:
    """A band cut across its longer side into rooms of 2.4 to 4.5 m."""
    x0, y0, x1, y1 = band
    long = max(x1 - x0, y1 - y0)
    most = max(1, int(long / 2.4))
    count = int(rng.integers(min(most, int(np.ceil(long / 4.5))), most + 1))
    cuts = np.linspace(0.0, 1.0, count + 1)
    cuts[1:-1] += rng.uniform(-0.12, 0.12, count - 1) / count
    pieces = zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)
    if x1 - x0 >= y1 - y0:
        return [(x0 + a * (x1 - x0), y0, x0 + b * (x1 - x0), y1) for a, b in pieces]
    return [(x0, y0 + a * (y1 - y0), x1, y0 + b * (y1 - y0)) for a, b in pieces]


def _cut(rng: np.random.Generator, rect: Rect, largest_m2: float) -> list[Rect]:
    x0, y0, x1, y1 = rect
    width, height = x1 - x0, y1 - y0
    if width * height <= largest_m2 * rng.uniform(0.7, 1.3) or max(width, height) < 4.8:
        return [rect]
    share = rng.uniform(0.38, 0.62)
    if width >= height:
        middle = x0 + share * width
        halves = [(x0, y0, middle, y1), (middle, y0, x1, y1)]
    else:
        middle = y0 + share * height
        halves = [(x0, y0, x1, middle), (x0, middle, x1, y1)]
    return [cell for half in halves for cell in _cut(rng, half, largest_m2)]


_Link = tuple[int, int, Rect]
"""Two cells and the edge that they share."""


def _joined(rng: np.random.Generator, cells: list[Rect], difficulty: float, extra: float) -> Layout:
    """Doors that join all cells, and some more."""
    tree, others = _spanning_tree(rng, len(cells), _neighbours(cells))
    more = [link for link in others if rng.random() < extra]
    doors = [_door(rng, (i, j), edge, difficulty) for i, j, edge in [*tree, *more]]
    return Layout([Room(_inset(cell)) for cell in cells], doors)


def _spanning_tree(
    rng: np.random.Generator, count: int, links: list[_Link]
) -> tuple[list[_Link], list[_Link]]:
    """Links in random order that join all cells without a loop, and the others."""
    group = list(range(count))

    def root(i: int) -> int:
        """The cell that stands for the group of this one."""
        while group[i] != i:
            i = group[i]
        return i

    tree: list[_Link] = []
    others: list[_Link] = []
    for k in rng.permutation(len(links)).tolist():
        a, b = root(links[k][0]), root(links[k][1])
        group[a] = b
        (others if a == b else tree).append(links[k])
    return tree, others


def _neighbours(cells: Sequence[Rect], least: float = DOOR_MAX_M + 2 * JAMB_M + WALL_M) -> list[_Link]:
    return [
        (i, j, edge)
        for i in range(len(cells))
        for j in range(i + 1, len(cells))
        if (edge := _shared_edge(cells[i], cells[j], least)) is not None
    ]


def _shared_edge(a: Rect, b: Rect, least: float = DOOR_MAX_M + 2 * JAMB_M + WALL_M) -> Rect | None:
    """The edge that two cells share, as a rectangle of no width; None where it is too short for a door."""
    x0, y0, x1, y1 = max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])
    if min(x1 - x0, y1 - y0) < -1e-9 or max(x1 - x0, y1 - y0) < least or min(x1 - x0, y1 - y0) > 1e-9:
        return None
    return x0, y0, x1, y1


def _door(rng: np.random.Generator, rooms: tuple[int, int], edge: Rect, difficulty: float) -> Door:
    """A door somewhere along an edge; the more difficult, the narrower."""
    width = rng.uniform(DOOR_MIN_M, DOOR_MAX_M - 0.05 * difficulty)
    x0, y0, x1, y1 = edge
    level = x1 - x0 > y1 - y0
    spare = max(x1 - x0, y1 - y0) - width - 2 * JAMB_M - WALL_M
    shift = WALL_M / 2 + JAMB_M + width / 2 + rng.random() * spare
    middle = (x0 + shift, y0) if level else (x0, y0 + shift)
    return Door(rooms, middle, (1.0, 0.0) if level else (0.0, 1.0), float(width))


def _opening(rooms: tuple[int, int], edge: Rect, width_m: float) -> Door:
    x0, y0, x1, y1 = edge
    along = (1.0, 0.0) if x1 - x0 > y1 - y0 else (0.0, 1.0)
    return Door(rooms, ((x0 + x1) / 2, (y0 + y1) / 2), along, width_m)


def _inset(cell: Rect) -> shapely.Polygon:
    half = WALL_M / 2
    return shapely.box(cell[0] + half, cell[1] + half, cell[2] - half, cell[3] - half)


def _corridor(rects: list[Rect]) -> shapely.Polygon:
    """Corridors run into each other: only their outside has a wall."""
    merged = shapely.unary_union([shapely.box(*rect) for rect in rects])
    return shapely.buffer(merged, -WALL_M / 2, join_style="mitre")
