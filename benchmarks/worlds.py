"""Buildings of a wanted size: rooms of 4 m on a square lattice, a door in every inner wall, thin columns."""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array, Pose

ROOM_M, DOOR_M = 4.0, 0.9


def building(n_walls: int, seed: int = 0) -> tuple[World, float]:
    """A world of about this many walls, and the length of its side, [m]."""
    rng = np.random.default_rng(seed)
    k = max(2, round(math.sqrt(n_walls / 4.0)))
    walls = []
    for i in range(k + 1):
        for j in range(k):
            for swap in (False, True):
                a, b = np.array([i, j]) * ROOM_M, np.array([i, j + 1]) * ROOM_M
                if swap:
                    a, b = a[::-1], b[::-1]
                if i in (0, k):
                    walls.append((*a, *b))
                    continue
                t = rng.uniform(0.2, 0.6)
                walls.append((*a, *(a + t * (b - a))))
                walls.append((*(a + (t + DOOR_M / ROOM_M) * (b - a)), *b))
    columns = np.column_stack([rng.uniform(0, k * ROOM_M, (k * k // 2, 2)), np.full(k * k // 2, 0.03)])
    start = Pose(0.3 * ROOM_M, 0.3 * ROOM_M, 0.0)
    lines = np.array(walls)
    return World("building", "building", lines, np.zeros(len(lines)), columns, start, True), k * ROOM_M


def scan_discs(side_m: float, count: int, seed: int = 1) -> list[Array]:
    """Poses of the disc in `count` full turns at random places: x y heading, shape (90, 3) each."""
    rng = np.random.default_rng(seed)
    mount = AmigoBot().sonars[2]
    turns = []
    for x, y, heading in rng.uniform((0.3, 0.3, -3.0), (side_m - 0.3, side_m - 0.3, 3.0), (count, 3)):
        discs = [Pose(x, y, heading + math.radians(4.0 * i)) @ mount for i in range(90)]
        turns.append(np.array([(d.x, d.y, d.heading) for d in discs]))
    return turns
