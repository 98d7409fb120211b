"""The buildings of `explore-plans`: floor plans of others, cut to size and with clutter, and generated ones.

Each plan becomes a native world file in the study's folder, so that `sonar-explore run` can explore it again.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.generator import KINDS
from sonar_explore.envs.load import load_world
from sonar_explore.envs.room import Room, loops, room_for
from sonar_explore.envs.validation import validate
from sonar_explore.envs.world import GENERATED, World
from sonar_explore.episodes.files import write_atomically
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

DATA = "SONAR_EXPLORE_DATA"
"""Environment variable: the folder whose `plans/` holds the plans."""
LARGEST_M2 = 400.0
"""Reachable area beyond which a plan is cut, [m2]."""
PER_THING_M2 = 6.0
"""One piece of clutter for so much reachable area, [m2]."""
BESIDE_M = 2 * (AmigoBot.radius_m + 0.15)
"""Room left on all sides of a piece of clutter, [m]: it shuts nothing."""
DIFFICULTIES = (0.2, 0.5, 0.8)
_SUFFIXES = (".json", ".yaml", ".yml", ".map", ".png", ".pgm", ".svg", ".toml")


@dataclass(frozen=True)
class Building:
    """One building of the study."""

    world: str
    """What `load_world` takes."""
    name: str
    """For tables."""
    group: str
    """`plans`, `plans with clutter`, `generated` or `whole plans`."""
    area_m2: float
    """That the middle of the robot can reach."""


def plan_files(folder: Path) -> list[Path]:
    """The floor plans below a folder, without images that a map file names."""
    if not folder.is_dir():
        raise SonarExploreError(f"no folder {str(folder)!r} of floor plans; give one, or set {DATA}")
    files = sorted(p for p in folder.rglob("*") if p.suffix.lower() in _SUFFIXES)
    named = {p.stem for p in files if p.suffix.lower() in (".yaml", ".yml")}
    files = [p for p in files if p.suffix.lower() not in (".png", ".pgm") or p.stem not in named]
    if not files:
        raise SonarExploreError(f"{str(folder)!r} holds no floor plan; known: {', '.join(_SUFFIXES)}")
    return files


def data_folder(given: Path | None) -> Path | None:
    """The folder of the plans: the one given, else that of the environment; None where there is none."""
    if given is not None:
        return given
    return Path(os.environ[DATA]) / "plans" if DATA in os.environ else None


def readable(files: Sequence[Path]) -> tuple[dict[Path, World], list[str]]:
    """The worlds of those files that are plans, and a line for each that is none."""
    worlds, unread = {}, []
    for file in files:
        try:
            worlds[file] = load_world(file)
        except SonarExploreError as error:
            unread.append(str(error))
    return worlds, unread


def buildings_of(plans: Mapping[Path, World], root: Path, out: Path, *, whole: bool) -> Iterator[Building]:
    """Each plan, cut where it is large, bare and with clutter; the large ones whole too where wanted."""
    stems = {p.stem for p in plans}
    for file, world in plans.items():
        name = "-".join(file.relative_to(root).with_suffix("").parts)
        plan = replace(world, name=name)
        cut = cropped(plan)
        yield _kept(cut, out, "plans")
        if f"{file.stem}_furnitures" not in stems and not file.stem.endswith("_furnitures"):
            yield _kept(cluttered(cut), out, "plans with clutter")
        if whole and cut is not plan:
            yield _kept(replace(plan, name=f"{name}-whole"), out, "whole plans")


def generated(count: int) -> Iterator[Building]:
    """So many generated worlds, of every kind and difficulty in turn."""
    kinds = sorted(KINDS)
    for i in range(count):
        kind, seed = kinds[i % len(kinds)], i // len(kinds)
        name = f"{GENERATED}{kind}-{seed}?difficulty={DIFFICULTIES[seed % len(DIFFICULTIES)]:g}"
        world = load_world(name)
        yield Building(name, world.name.removeprefix(GENERATED), "generated", reachable_m2(world))


def cropped(world: World, largest_m2: float = LARGEST_M2) -> World:
    """The world itself where it is small enough, else the largest square about its start that is, walled in."""
    if reachable_m2(world) <= largest_m2:
        return world
    low, high = 1.0, max(world.bounds[2] - world.bounds[0], world.bounds[3] - world.bounds[1])
    while high - low > 0.05:
        half = (low + high) / 2
        low, high = (half, high) if reachable_m2(_square(world, half)) <= largest_m2 else (low, half)
    square = _square(world, low)
    room = room_for(square.walls, square.cylinders)
    reach = room.reachable(square.start.x, square.start.y, AmigoBot.radius_m)
    return validate(replace(square, has_loop=loops(reach, room.cell_m) > 0))


def cluttered(world: World, seed: int = 0) -> World:
    """The same with boxes, columns and tables here and there, never so near to anything that the way is shut."""
    rng = np.random.default_rng([seed, *world.name.encode()])
    room = room_for(world.walls, world.cylinders)
    reach = room.reachable(world.start.x, world.start.y, AmigoBot.radius_m)
    start = np.array([[world.start.x, world.start.y]])
    clearance = np.where(reach, room.clearance, 0.0)
    walls, columns = [world.walls], [world.cylinders]
    for _ in range(round(reach.sum() * room.cell_m**2 / PER_THING_M2)):
        new_walls, new_columns, radius = _thing(rng)
        free = np.argwhere(clearance >= radius + BESIDE_M)
        if not len(free):
            continue
        place = room.places(*free[[rng.integers(len(free))]].T)
        if np.hypot(*(place - start)[0]) < radius + BESIDE_M:
            continue
        heading = float(rng.choice([0.0, np.pi / 2, rng.uniform(0.0, np.pi)]))
        turn = Pose(float(place[0, 0]), float(place[0, 1]), heading)
        walls.append(turn.transform(new_walls.reshape(-1, 2)).reshape(-1, 4))
        columns.append(np.hstack([turn.transform(new_columns[:, :2]), new_columns[:, 2:]]))
        clearance = np.minimum(clearance, _distance(room, place[0]) - radius)
    everything = np.vstack(walls)
    rough = np.concatenate([world.roughness, np.zeros(len(everything) - len(world.walls))])
    return validate(
        replace(
            world,
            name=f"{world.name}-clutter",
            walls=everything,
            roughness=rough,
            cylinders=np.vstack(columns),
        )
    )


def reachable_m2(world: World) -> float:
    """Where the middle of the robot can be, [m2]."""
    room = room_for(world.walls, world.cylinders)
    return float(room.reachable(world.start.x, world.start.y, AmigoBot.radius_m).sum() * room.cell_m**2)


def toml_of(world: World) -> str:
    """The world in the native format, each wall by itself."""
    start = world.start
    lines = [
        f"title = {msgspec.json.encode(world.title).decode()}",
        f"has_loop = {str(bool(world.has_loop)).lower()}",
        "",
        "[start]",
        f"x = {float(start.x)!r}",
        f"y = {float(start.y)!r}",
        f"heading_deg = {float(np.degrees(start.heading))!r}",
    ]
    for (x1, y1, x2, y2), rough in zip(world.walls.tolist(), world.roughness.tolist(), strict=True):
        lines += ["", "[[wall]]", f"points = [[{x1!r}, {y1!r}], [{x2!r}, {y2!r}]]", f"roughness = {rough!r}"]
    for x, y, radius in world.cylinders.tolist():
        lines += ["", "[[cylinder]]", f"x = {x!r}", f"y = {y!r}", f"radius = {radius!r}"]
    return "\n".join(lines) + "\n"


def _kept(world: World, out: Path, group: str) -> Building:
    path = out / f"{world.name}.toml"
    write_atomically(path, toml_of(world).encode())
    return Building(str(path), world.name, group, reachable_m2(world))


def _square(world: World, half_m: float) -> World:
    """What lies within a square about the start, inside four walls."""
    x, y = world.start.x, world.start.y
    box = np.array([x - half_m, y - half_m, x + half_m, y + half_m])
    inside, kept = _clipped(world.walls, box)
    corners = box[[0, 1, 2, 1, 2, 3, 0, 3]].reshape(4, 2)
    frame = np.hstack([corners, np.roll(corners, -1, axis=0)])
    centres, radii = world.cylinders[:, :2], world.cylinders[:, 2:]
    near = ((centres - radii >= box[:2]) & (centres + radii <= box[2:])).all(axis=1)
    return replace(
        world,
        walls=np.vstack([inside, frame]),
        roughness=np.concatenate([world.roughness[kept], np.zeros(4)]),
        cylinders=world.cylinders[near],
    )


def _clipped(walls: Array, box: Array) -> tuple[Array, NDArray[np.int64]]:
    """The parts of walls (n, 4) inside a box (Liang and Barsky), and the indices of the walls that they are of."""
    start, step = walls[:, :2], walls[:, 2:] - walls[:, :2]
    first, last = np.zeros(len(walls)), np.ones(len(walls))
    for axis in (0, 1):
        with np.errstate(divide="ignore", invalid="ignore"):
            at = (box[[axis, axis + 2]] - start[:, axis, None]) / step[:, axis, None]
        level = step[:, axis] == 0.0
        between = (start[:, axis] >= box[axis]) & (start[:, axis] <= box[axis + 2])
        enter = np.where(level, np.where(between, 0.0, np.inf), at.min(axis=1))
        leave = np.where(level, np.where(between, 1.0, -np.inf), at.max(axis=1))
        first, last = np.maximum(first, enter), np.minimum(last, leave)
    kept = np.flatnonzero((last - first) * np.hypot(*step.T) > 1e-6).astype(np.int64)
    a, b = first[kept, None], last[kept, None]
    return np.hstack([start[kept] + a * step[kept], start[kept] + b * step[kept]]), kept


def _thing(rng: np.random.Generator) -> tuple[Array, Array, float]:
    """Walls (n, 4) and columns (m, 3) about the origin, and the radius of the circle round them, [m]."""
    kind = rng.integers(3)
    if kind == 0:
        radius = float(rng.uniform(0.08, 0.25))
        return np.zeros((0, 4)), np.array([[0.0, 0.0, radius]]), radius
    half = np.array([rng.uniform(0.2, 0.8), rng.uniform(0.15, 0.4)])
    corners = half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    if kind == 1:
        walls = np.hstack([corners, np.roll(corners, -1, axis=0)])
        return walls, np.zeros((0, 3)), float(np.hypot(*half))
    legs = np.hstack([corners, np.full((4, 1), 0.03)])
    return np.zeros((0, 4)), legs, float(np.hypot(*half)) + 0.03


def _distance(room: Room, place: Array) -> Array:
    rows, cols = np.indices(room.clearance.shape, dtype=float)
    x, y = cols * room.cell_m + room.origin[0], rows * room.cell_m + room.origin[1]
    return np.hypot(x - place[0], y - place[1])
