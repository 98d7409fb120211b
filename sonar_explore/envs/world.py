"""The world: straight specular walls, round columns and the place where the robot starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonar_explore.envs.room import bounds_of
from sonar_explore.geometry import Array, Pose

GENERATED = "generated/"
"""What the names of generated worlds begin with."""
_CHUNK = 1_000_000


@dataclass(frozen=True, eq=False)
class World:
    """A building as a sonar meets it, in the world frame."""

    name: str
    """`paper/rooms` where shipped, else the file's stem."""
    title: str
    """One line for a reader."""
    walls: Array
    """Straight specular walls x1 y1 x2 y2, shape (n, 4), [m]; both sides reflect."""
    roughness: Array
    """Share of diffuse return of each wall, shape (n,), 0 (mirror) to 1."""
    cylinders: Array
    """Round columns and chair legs x y radius, shape (m, 3), [m]."""
    start: Pose
    """`pose_robot_in_world` when the episode begins."""
    has_loop: bool
    """The way closes on itself, so that a loop can be closed."""

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of walls and cylinders, [m]."""
        return bounds_of(self.walls, self.cylinders)

    def clearance(self, points: Array) -> Array:
        """Distance of points (n, 2) to the nearest wall or cylinder, [m]; negative inside a cylinder."""
        nearest = np.full(len(points), np.inf)
        step = max(1, _CHUNK // (len(self.walls) + 1))
        for i in range(0, len(points), step):
            chunk = points[i : i + step]
            nearest[i : i + step] = distances_to_walls(chunk, self.walls).min(axis=1, initial=np.inf)
        for x, y, radius in self.cylinders:
            np.minimum(nearest, np.hypot(points[:, 0] - x, points[:, 1] - y) - radius, out=nearest)
        return nearest


def distances_to_walls(points: Array, walls: Array) -> Array:
    """Distance of each point, shape (n, 2), to each wall, shape (m, 4): shape (n, m), [m]."""
    x1, y1 = walls[:, 0], walls[:, 1]
    dx, dy = walls[:, 2] - x1, walls[:, 3] - y1
    px, py = points[:, 0, None] - x1, points[:, 1, None] - y1
    share = np.clip((px * dx + py * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0.0, 1.0)
    return np.hypot(px - share * dx, py - share * dy)
