"""The native format: a world as a short TOML file, metres and degrees (docs/worlds.md)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import shapely

from sonar_explore.envs.readers.source import ReadOptions, read_bytes, why_undecoded
from sonar_explore.envs.validation import validate
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

MAX_BYTES = 2 * 2**20
Point = tuple[float, float]
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Length = Annotated[float, msgspec.Meta(gt=0.0)]


class Start(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`pose_robot_in_world` when the episode begins."""

    x: float
    y: float
    heading_deg: float = 0.0


class Wall(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A chain of straight walls; `closed` joins the last point to the first."""

    points: Annotated[list[Point], msgspec.Meta(min_length=2)]
    closed: bool = False
    roughness: Share = 0.0


class Polygon(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A solid obstacle: pillar, block, cupboard."""

    points: Annotated[list[Point], msgspec.Meta(min_length=3)]
    roughness: Share = 0.0


class Cylinder(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A round column or a chair leg."""

    x: float
    y: float
    radius: Length


class Door(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The leaf of an open door: a thin wall from its hinge, its angle counter-clockwise from the x axis."""

    hinge: Point
    width: Length
    angle_deg: float
    roughness: Share = 0.0


class WorldFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    title: str
    start: Start
    has_loop: bool = False
    wall: list[Wall] = []
    polygon: list[Polygon] = []
    cylinder: list[Cylinder] = []
    door: list[Door] = []


def read_toml(path: Path, options: ReadOptions) -> World:
    """The world in a file of the native format."""
    data = read_bytes(path, MAX_BYTES)
    try:
        file = msgspec.toml.decode(data, type=WorldFile)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        said = why_undecoded(error, "TOML")
        raise SonarExploreError(f"{path.name}: {said}{_known_fields(said)}") from None
    # tables a thousand deep, numbers a thousand digits long
    except (RecursionError, ValueError, OverflowError):
        raise SonarExploreError(f"{path.name}: nested too deeply, or a number too long") from None
    start = options.start or Pose(file.start.x, file.start.y, math.radians(file.start.heading_deg))
    _check_outside(path, file, start)
    walls, roughness = _walls(file)
    return validate(
        World(
            name=path.stem,
            title=file.title,
            walls=walls,
            roughness=roughness,
            cylinders=np.array([(c.x, c.y, c.radius) for c in file.cylinder], dtype=float).reshape(-1, 3),
            start=start,
            has_loop=file.has_loop,
        )
    )


def _known_fields(said: str) -> str:
    """What the table may hold, where an error is about a field that it may not."""
    if "unknown field" not in said:
        return ""
    table = said.rpartition("$")[2].strip("`.").split("[")[0]
    known = {"start": Start, "wall": Wall, "polygon": Polygon, "cylinder": Cylinder, "door": Door}
    return f"; known: {', '.join(known.get(table, WorldFile).__struct_fields__)}"


def _walls(file: WorldFile) -> tuple[Array, Array]:
    """All straight walls of the file, shape (n, 4), and their roughness, shape (n,)."""
    chains = [(_chain(w.points, closed=w.closed), w.roughness) for w in file.wall]
    chains += [(_chain(p.points, closed=True), p.roughness) for p in file.polygon]
    chains += [(_leaf(d), d.roughness) for d in file.door]
    if not chains:
        return np.empty((0, 4)), np.empty(0)
    walls = np.concatenate([rows for rows, _ in chains])
    return walls, np.concatenate([np.full(len(rows), share) for rows, share in chains])


def _chain(points: list[Point], *, closed: bool) -> Array:
    ends = np.array([*points, points[0]] if closed else points, dtype=float)
    return np.hstack([ends[:-1], ends[1:]])


def _leaf(door: Door) -> Array:
    (x, y), angle = door.hinge, math.radians(door.angle_deg)
    return np.array([[x, y, x + door.width * math.cos(angle), y + door.width * math.sin(angle)]])


def _check_outside(path: Path, file: WorldFile, start: Pose) -> None:
    """A polygon is solid: nobody starts inside one."""
    place = (start.x, start.y)
    for i, polygon in enumerate(file.polygon):
        if np.isfinite([*polygon.points, place]).all() and shapely.contains_xy(
            shapely.make_valid(shapely.Polygon(polygon.points)), *place
        ):
            raise SonarExploreError(
                f"{path.name}: the start ({start.x:.2f}, {start.y:.2f}) is inside the solid polygon[{i}]; "
                "move the start, or draw a [[wall]] with closed = true for a room"
            )


def world_schema() -> bytes:
    """The JSON Schema of the format, for editors; shipped as `world.schema.json` beside this file."""
    schema = msgspec.json.schema(WorldFile)
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "World", **schema}
    return msgspec.json.format(msgspec.json.encode(schema), indent=2) + b"\n"
