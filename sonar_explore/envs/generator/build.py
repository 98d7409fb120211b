"""From a layout to a world: cut corners, furniture, door leaves, and walls round all that is left free.

Whatever is put into a room is kept only if a disc of the robot's size and 15 cm more still reaches all of
the room, and every door of it; so the whole building stays joined.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import shapely
import shapely.affinity

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.generator.layouts import Door, Layout, Room
from sonar_explore.envs.room import LEAST_BLOCK_M2
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

SPARE_M = 0.15
"""Room to spare on either side of the robot, everywhere, [m]."""
LEAF_M = 0.04
"""Thickness of the leaf of a door, [m]."""
_BODY_M = AmigoBot.radius_m + SPARE_M
# pieces of a quarter turn: to see whether a way is left, and to measure how wide it is
_COARSE, _FINE = 3, 32
_GRID_M = 0.001
_GAP_M = 0.02
_MOST_ATTEMPTS = 50


@dataclass
class _Contents:
    """What stands in a room."""

    solids: list[shapely.Polygon] = field(default_factory=list)
    columns: list[tuple[float, float, float]] = field(default_factory=list)


def build(
    name: str, title: str, layout: Callable[[], Layout], rng: np.random.Generator, difficulty: float
) -> World:
    """The first sound world of the layouts that are drawn."""
    for _ in range(_MOST_ATTEMPTS):
        world = _furnish(name, title, layout(), rng, difficulty)
        if world is not None:
            return world
    raise SonarExploreError(f"{name}: no sound building after {_MOST_ATTEMPTS} attempts")  # pragma: no cover


def _furnish(
    name: str, title: str, layout: Layout, rng: np.random.Generator, difficulty: float
) -> World | None:
    contents = [
        _room_contents(room, [door for door in layout.doors if i in door.rooms], rng, difficulty)
        for i, room in enumerate(layout.rooms)
    ]
    solids = [solid for c in contents for solid in c.solids]
    columns = np.array([column for c in contents for column in c.columns]).reshape(-1, 3)
    holes = [door.hole() for door in layout.doors]
    free = shapely.unary_union([*(room.shape for room in layout.rooms), *holes])
    free = shapely.set_precision(free.difference(shapely.unary_union(solids)), _GRID_M)
    parts = shapely.get_parts(free)
    free = parts[shapely.area(parts).argmax()].simplify(2 * _GRID_M)
    columns = columns[shapely.contains_xy(free, columns[:, :2])]
    to_walls = shapely.distance(free.boundary, shapely.points(columns[:, :2]))
    columns = columns[to_walls > columns[:, 2] + _GAP_M]
    if len(shapely.get_parts(_room_for(_BODY_M, free, columns, _FINE))) != 1:
        return None
    room_to_move = free.difference(_discs(columns, _FINE)) if len(columns) else free
    start = _start(layout, room_to_move, columns, rng)
    reach = _room_for(AmigoBot.radius_m, free, columns, _COARSE)
    parts = [part for part in shapely.get_parts(reach) if isinstance(part, shapely.Polygon)]
    blocks = [ring for part in parts for ring in part.interiors]
    return _turned(
        World(
            name=name,
            title=title,
            walls=(walls := _walls(free)),
            roughness=np.zeros(len(walls)),
            cylinders=columns,
            start=start,
            has_loop=any(shapely.Polygon(ring).area >= LEAST_BLOCK_M2 for ring in blocks),
        ),
        math.radians(rng.uniform(-45.0, 45.0)) if rng.random() < 0.5 * difficulty else 0.0,
    )


def _room_contents(room: Room, doors: list[Door], rng: np.random.Generator, difficulty: float) -> _Contents:
    """As much of what is proposed as leaves room for the robot."""
    kept = _Contents()
    inside = shapely.buffer(room.shape, 0.03, join_style="mitre")  # backs reach into the wall
    loose_inside = shapely.buffer(room.shape, -0.08, join_style="mitre")
    body: shapely.Geometry | None = None
    doorways = shapely.multipoints([door.middle for door in doors]) if doors else None
    for solids, columns, loose in _proposals(room, doors, rng, difficulty):
        thing = solids[0] if solids else _discs(np.array(columns), _COARSE)
        if not shapely.covered_by(thing, loose_inside if loose else inside):
            continue
        if doorways is not None and shapely.dwithin(thing, doorways, _BODY_M):
            continue
        if body is None:
            free = shapely.unary_union([room.shape, *(door.stub() for door in doors)])
            body = _eroded(free, _BODY_M, _COARSE)
        left = body.difference(shapely.buffer(thing, _BODY_M, quad_segs=_COARSE))
        if isinstance(left, shapely.Polygon) and (doorways is None or shapely.contains(left, doorways)):
            body = left
            kept.solids += solids
            kept.columns += columns
    return kept


_Thing = tuple[list[shapely.Polygon], list[tuple[float, float, float]], bool]
"""A solid, or columns that stand or fall together; True where it stands clear of the walls."""


def _proposals(room: Room, doors: list[Door], rng: np.random.Generator, difficulty: float) -> list[_Thing]:
    """What may stand in a room, in the order of importance."""
    area = room.shape.area
    things: list[_Thing] = []
    makers: tuple[Callable[[shapely.Polygon, np.random.Generator], _Thing], ...]
    if rng.random() < 0.35 * difficulty and room.furnished:
        things.append(([_cut_corner(room.shape, rng)], [], False))
    things += [
        _leaf(door, room.shape, rng)
        for door in doors
        if door.width_m < 0.95 and rng.random() < 0.2 + 0.2 * difficulty
    ]
    if room.furnished:
        count = rng.poisson(difficulty * min(area, 60.0) / 4.0)
        makers = (_cupboard, _cupboard, _table, _stool, _pillar, _pillar, _screen if area > 25.0 else _table)
    else:
        count = rng.poisson(difficulty * area / 12.0)
        makers = (_pillar, _pillar, _stool)
    things += [makers[rng.integers(len(makers))](room.shape, rng) for _ in range(min(count, 24))]
    return things


def _against_wall(
    shape: shapely.Polygon, width: float, depth: float, rng: np.random.Generator
) -> shapely.Polygon:
    """A box with its back to a wall of the room, somewhere along it."""
    corners = shapely.get_coordinates(shapely.get_exterior_ring(shapely.geometry.polygon.orient(shape)))
    i = int(rng.integers(len(corners) - 1))
    a, b = corners[i], corners[i + 1]
    length = float(np.hypot(*(b - a)))
    along = (b - a) / length
    inward = np.array([-along[1], along[0]])  # the outline runs counter-clockwise
    width = min(width, length)
    at = a + along * rng.choice([0.0, length - width, rng.uniform(0.0, length - width)])
    back = -0.02 * inward  # into the wall: no gap behind
    return shapely.Polygon(
        [at + back, at + along * width + back, at + along * width + inward * depth, at + inward * depth]
    )


def _cupboard(shape: shapely.Polygon, rng: np.random.Generator) -> _Thing:
    return [_against_wall(shape, rng.uniform(0.7, 2.0), rng.uniform(0.35, 0.9), rng)], [], False


def _pillar(shape: shapely.Polygon, rng: np.random.Generator) -> _Thing:
    return [_against_wall(shape, rng.uniform(0.2, 0.45), rng.uniform(0.1, 0.25), rng)], [], False


def _table(shape: shapely.Polygon, rng: np.random.Generator) -> _Thing:
    """A solid one, or four legs."""
    width, depth = rng.uniform(0.9, 1.6), rng.uniform(0.7, 0.9)
    turn = Pose(*_place(shape, rng), float(rng.choice([0.0, math.pi / 2, rng.uniform(0.0, math.pi)])))
    corners = turn.transform(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, depth / 2))
    if rng.random() < 0.6:
        return [shapely.Polygon(corners)], [], True
    return [], [(x, y, 0.03) for x, y in corners.tolist()], True


def _stool(shape: shapely.Polygon, rng: np.random.Generator) -> _Thing:
    return [], [(*_place(shape, rng), float(rng.uniform(0.1, 0.2)))], True


def _screen(shape: shapely.Polygon, rng: np.random.Generator) -> _Thing:
    """A thin straight wall that stands by itself, at any angle."""
    turn = Pose(*_place(shape, rng), rng.uniform(0.0, math.pi))
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (rng.uniform(0.6, 1.6), 0.05)
    return [shapely.Polygon(turn.transform(corners))], [], True


def _cut_corner(shape: shapely.Polygon, rng: np.random.Generator) -> shapely.Polygon:
    """A triangle that makes a wall oblique."""
    corners = shapely.get_coordinates(shape)[:-1]
    i = int(rng.integers(len(corners)))
    corner, before, after = corners[i], corners[i - 1], corners[(i + 1) % len(corners)]
    legs = [(end - corner) * rng.uniform(0.15, most) for end, most in ((before, 0.9), (after, 0.35))]
    outward = -0.02 * (legs[0] + legs[1]) / np.hypot(*(legs[0] + legs[1]))
    return shapely.Polygon([corner + outward, corner + legs[0], corner + legs[1]])


def _leaf(door: Door, shape: shapely.Polygon, rng: np.random.Generator) -> _Thing:
    """The leaf of a door that stands open into the room, from a right angle to nearly flat against the wall."""
    along = np.array(door.along) * rng.choice([-1.0, 1.0])
    across = np.array([-door.along[1], door.along[0]])
    middle = np.array(door.middle)
    inward = across if shapely.contains_xy(shape, *(middle + 0.3 * across)) else -across
    hinge = middle + along * (door.width_m / 2 + LEAF_M) + inward * 0.05
    angle = math.radians(rng.choice([rng.uniform(0.0, 30.0), rng.uniform(70.0, 82.0)]))
    direction = math.cos(angle) * inward + math.sin(angle) * along
    normal = np.array([-direction[1], direction[0]]) * LEAF_M / 2
    end = hinge + direction * (door.width_m - 0.02)
    return [shapely.Polygon([hinge - normal, end - normal, end + normal, hinge + normal])], [], False


def _place(shape: shapely.Polygon, rng: np.random.Generator) -> tuple[float, float]:
    x0, y0, x1, y1 = shape.bounds
    margin = 0.4
    return float(rng.uniform(x0 + margin, x1 - margin)), float(rng.uniform(y0 + margin, y1 - margin))


def _eroded(free: shapely.Geometry, radius_m: float, pieces: int) -> shapely.Geometry:
    """Where the middle of a disc may be."""
    return shapely.buffer(free, -radius_m, quad_segs=pieces)


def _room_for(radius_m: float, free: shapely.Polygon, columns: Array, pieces: int) -> shapely.Geometry:
    """Where the middle of a disc may be that touches no column either."""
    room = _eroded(free, radius_m, pieces)
    if not len(columns):
        return room
    discs = _discs(columns + [0.0, 0.0, radius_m], pieces)
    try:
        return shapely.difference(room, discs)
    except shapely.errors.GEOSException:  # where edges nearly meet, an eroded outline can cross itself
        return shapely.difference(shapely.make_valid(room), discs)


def _discs(columns: Array, pieces: int) -> shapely.Geometry:
    """Polygons about columns."""
    return shapely.union_all(shapely.buffer(shapely.points(columns[:, :2]), columns[:, 2], quad_segs=pieces))


def _walls(free: shapely.Polygon) -> Array:
    rings = [np.array(ring.coords) for ring in (free.exterior, *free.interiors)]
    return np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in rings])


def _start(layout: Layout, room_to_move: shapely.Polygon, columns: Array, rng: np.random.Generator) -> Pose:
    """The roomiest of some places in the largest room, looking anywhere."""
    room = max(layout.rooms, key=lambda room: float(room.shape.area))
    middle = shapely.get_coordinates(shapely.point_on_surface(room.shape))
    x0, y0, x1, y1 = room.shape.bounds
    places = np.vstack([middle, rng.uniform((x0, y0), (x1, y1), size=(40, 2))])
    clearance = shapely.distance(shapely.points(places), room_to_move.boundary)
    clearance[~shapely.contains_xy(room_to_move, places)] = 0.0
    x, y = places[clearance.argmax()].tolist()
    return Pose(x, y, math.radians(float(rng.integers(-179, 181))))


def _turned(world: World, angle_rad: float) -> World:
    """The whole building turned about its origin."""
    if angle_rad == 0.0:
        return world
    turn = Pose(0.0, 0.0, angle_rad)
    return World(
        name=world.name,
        title=world.title,
        walls=turn.transform(world.walls.reshape(-1, 2)).reshape(-1, 4),
        roughness=world.roughness,
        cylinders=np.hstack([turn.transform(world.cylinders[:, :2]), world.cylinders[:, 2:]]),
        start=turn @ world.start,
        has_loop=world.has_loop,
    )
