"""What makes a world one that a robot can drive in; every reader and generator ends in `validate`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.room import near, room_for
from sonar_explore.errors import SonarExploreError

if TYPE_CHECKING:
    from sonar_explore.envs.world import World
    from sonar_explore.geometry import Pose

MAX_EXTENT_M = 1000.0
"""A larger world has its unit wrong (millimetres, pixels)."""
MAX_COORDINATE_M = 1e8
"""Farther from the origin a double no longer resolves the robot's motion, [m]."""
MAX_WALLS = 20_000
MAX_CYLINDERS = 5_000
MAX_WALL_LENGTH_M = 50_000.0
"""Of all walls and columns together; a building of 1,000 m2 has about one kilometre."""
MIN_WALL_M = 1e-6
"""Shorter walls are dropped, [m]."""
MIN_REACH_M = 0.3
"""A start from which the robot cannot get this far away is shut in, [m]."""
_SEARCH_STEP_M = 0.05
_MOST_POCKETS = 40


def validate(world: World) -> World:
    """The world less its walls of no length, or an error that says what is wrong with it."""
    world = validate_walls(world)
    _check_start(world)
    return world


def validate_walls(world: World) -> World:
    """The same for the walls and columns alone, before there is a start."""
    _check_numbers(world)
    long_enough = np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T) > MIN_WALL_M
    world = replace(world, walls=world.walls[long_enough], roughness=world.roughness[long_enough])
    _check_extent(world)
    return world


def validate_start(name: str, start: Pose) -> None:
    """An error for a start that is no place at all."""
    if not (np.abs([start.x, start.y, start.heading]) <= MAX_COORDINATE_M).all():
        place = f"({start.x:g}, {start.y:g}), {math.degrees(start.heading):g} degrees"
        raise SonarExploreError(f"{name}: the start {place} is no place in metres")


def _check_numbers(world: World) -> None:
    for what, array, columns in (("walls", world.walls, 4), ("cylinders", world.cylinders, 3)):
        if array.ndim != 2 or array.shape[1] != columns:
            raise SonarExploreError(f"{world.name}: {what} have shape {array.shape}; expected (n, {columns})")
        sane = np.abs(array) <= MAX_COORDINATE_M  # false for NaN as well
        if not sane.all():
            row = int(np.argwhere(~sane)[0, 0])
            raise SonarExploreError(
                f"{world.name}: {what}[{row}] is no place in metres: ({', '.join(f'{v:g}' for v in array[row])})"
            )
    if world.roughness.shape != (len(world.walls),):
        raise SonarExploreError(
            f"{world.name}: roughness has shape {world.roughness.shape}; expected ({len(world.walls)},)"
        )
    if not ((world.roughness >= 0.0) & (world.roughness <= 1.0)).all():
        raise SonarExploreError(f"{world.name}: roughness must lie between 0 and 1")
    if not (world.cylinders[:, 2] > 0.0).all():
        raise SonarExploreError(f"{world.name}: the radius of a cylinder must be above 0")
    validate_start(world.name, world.start)


def _check_extent(world: World) -> None:
    if not len(world.walls):
        raise SonarExploreError(f"{world.name}: no walls; a sonar has nothing to hear")
    for what, count, limit in (
        ("walls", len(world.walls), MAX_WALLS),
        ("cylinders", len(world.cylinders), MAX_CYLINDERS),
    ):
        if count > limit:
            raise SonarExploreError(f"{world.name}: {count} {what}; at most {limit} are possible")
    x_min, y_min, x_max, y_max = world.bounds
    extent = max(x_max - x_min, y_max - y_min)
    if extent > MAX_EXTENT_M:
        raise SonarExploreError(
            f"{world.name}: {extent:.3g} m across; at most {MAX_EXTENT_M:.0f} m is possible (unit: metres)"
        )
    length = float(np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T).sum())
    length += float(2 * np.pi * world.cylinders[:, 2].sum())
    if length > MAX_WALL_LENGTH_M:
        raise SonarExploreError(
            f"{world.name}: {length / 1000:.3g} km of wall; at most {MAX_WALL_LENGTH_M / 1000:g} km is possible"
        )


def _check_start(world: World) -> None:
    x, y = world.start.x, world.start.y
    x_min, y_min, x_max, y_max = world.bounds
    if not (x_min <= x <= x_max and y_min <= y <= y_max):
        raise SonarExploreError(
            f"{world.name}: the start ({x:.2f}, {y:.2f}) lies outside the walls, which span "
            f"x {x_min:.2f} to {x_max:.2f}, y {y_min:.2f} to {y_max:.2f}{_offer(world)}"
        )
    clearance = float(world.clearance(np.array([[x, y]]))[0])
    if clearance < AmigoBot.radius_m:
        where = "inside a cylinder" if clearance < 0.0 else f"{clearance:.2f} m from a wall or cylinder"
        raise SonarExploreError(
            f"{world.name}: the start ({x:.2f}, {y:.2f}) is {where}; "
            f"the robot needs {AmigoBot.radius_m:.2f} m{_offer(world)}"
        )
    if _reach(world, x, y) < MIN_REACH_M:
        raise SonarExploreError(
            f"{world.name}: nothing can be reached from the start ({x:.2f}, {y:.2f}): "
            f"the robot is shut in{_offer(world)}"
        )


def _offer(world: World) -> str:
    place = nearest_free_place(world)
    return (
        "; no free place was found near it" if place is None else f"; free: ({place[0]:.2f}, {place[1]:.2f})"
    )


def nearest_free_place(world: World) -> tuple[float, float] | None:
    """The place nearest to the start where the robot fits and can drive away, (x, y) [m], within 5 m."""
    x_min, y_min, x_max, y_max = world.bounds
    x0, y0 = float(np.clip(world.start.x, x_min, x_max)), float(np.clip(world.start.y, y_min, y_max))
    box = (max(x_min, x0 - 5), max(y_min, y0 - 5), min(x_max, x0 + 5), min(y_max, y0 + 5))
    room = room_for(world.walls, world.cylinders, box, _SEARCH_STEP_M)
    places = room.places(*np.nonzero(room.fits(AmigoBot.radius_m + _SEARCH_STEP_M)))
    order = np.argsort(np.hypot(places[:, 0] - x0, places[:, 1] - y0), kind="stable")
    shut_in, pockets = np.zeros(room.clearance.shape, dtype=bool), 0
    for x, y in places[order].tolist():
        if shut_in[room.cell(x, y)]:
            continue
        if _reach(world, x, y) >= MIN_REACH_M:
            return x, y
        shut_in |= room.reachable(x, y, AmigoBot.radius_m)
        pockets += 1
        if pockets == _MOST_POCKETS:
            break
    return None


def _reach(world: World, x: float, y: float) -> float:
    """How far the robot can get from (x, y), measured up to twice MIN_REACH_M away, [m]."""
    half = 2 * MIN_REACH_M
    box = (x - half, y - half, x + half, y + half)
    walls, cylinders = near(world.walls, world.cylinders, box, AmigoBot.radius_m)
    count = round(2 * half / _SEARCH_STEP_M)
    offsets = np.arange(-count, count + 1) * (_SEARCH_STEP_M / 2)
    places = np.stack(np.meshgrid(x + offsets, y + offsets), axis=-1)
    nearby = replace(world, walls=walls, cylinders=cylinders)
    free = nearby.clearance(places.reshape(-1, 2)).reshape(places.shape[:2]) >= AmigoBot.radius_m
    labels, _ = ndimage.label(free)
    middle = labels[count, count]
    if middle == 0:
        return 0.0
    return float(np.hypot(*(places[labels == middle] - (x, y)).T).max())
