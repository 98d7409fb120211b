"""What the formats share that draw lines and leave open where the robot starts and whether there is a loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.room import loops, room_for, roomiest_place
from sonar_explore.envs.validation import validate, validate_walls
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose


def world_of_lines(path: Path, title: str, walls: Array, cylinders: Array, start: Pose | None) -> World:
    """The world of these walls (n, 4) and cylinders (m, 3), [m]; without a start, in the roomiest place."""
    drawn = World(
        name=path.stem,
        title=title,
        walls=walls,
        roughness=np.zeros(len(walls)),
        cylinders=cylinders,
        start=start or Pose(0.0, 0.0, 0.0),
        has_loop=False,
    )
    drawn = validate_walls(drawn)
    start = start or roomiest_place(drawn.walls, drawn.cylinders, AmigoBot.radius_m)
    if start is None:
        raise SonarExploreError(
            f"{path.name}: no place inside the walls is wide enough for the robot, {2 * AmigoBot.radius_m:.2f} m; "
            "is the scale right?"
        )
    world = validate(replace(drawn, start=start))
    room = room_for(world.walls, world.cylinders)
    reachable = room.reachable(start.x, start.y, AmigoBot.radius_m)
    return replace(world, has_loop=loops(reachable, room.cell_m) > 0)
