"""What the ring of eight has heard near by, kept for a while: the last guard against touching a wall.

An echo is taken for a short piece of wall about square to the disc's axis, unless the map has an edge or a corner
there. Between the axes at 41 and 90 degrees lies a gap in which no disc hears a wall; `planning.driving` turns left
and right in tight places, so that this memory has no gap.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose

HEARD_WITHIN_M = 0.8  # a wall farther away is no danger yet
HALF_LENGTH_M = 0.25  # of the piece of wall that an echo stands for
NORMALS_RAD = (
    -math.radians(8.0),
    0.0,
    math.radians(8.0),
)  # off the axis: a plane is heard over 12 degrees or so
SCRAPE_M = 0.02  # nearer than the room to keep by this, going along a wall is too near as well
KEPT_M = 1.0  # echoes farther from the robot are forgotten


class EchoMemory:
    """Pieces of wall in the map frame; valid from one scan to the next."""

    def __init__(self, body: AmigoBot, is_point: Callable[[float, float], bool]) -> None:
        self._body = body
        self._is_point = is_point
        self._pieces: Array = np.zeros((0, 5))
        self._last: Array = np.full(len(body.sonars), body.range_max_m)

    def note(self, pose_robot_in_map: Pose, ring_m: Array) -> None:
        """Take the discs that have fired since the last call."""
        fired = np.flatnonzero((ring_m != self._last) & (ring_m < HEARD_WITHIN_M))
        self._last = ring_m
        rows = []
        for i in fired:
            disc = pose_robot_in_map @ self._body.sonars[i]
            for off in NORMALS_RAD:
                c, s = math.cos(disc.heading + off), math.sin(disc.heading + off)
                x, y = disc.x + ring_m[i] * c, disc.y + ring_m[i] * s
                rows.append((x, y, c, s, 0.0 if self._is_point(x, y) else HALF_LENGTH_M))
        if rows:
            near = np.hypot(*(self._pieces[:, :2] - (pose_robot_in_map.x, pose_robot_in_map.y)).T) <= KEPT_M
            self._pieces = np.vstack([self._pieces[near], rows])

    def forget(self) -> None:
        """A new scan knows better."""
        self._pieces = self._pieces[:0]

    def in_the_way(self, pose_robot_in_map: Pose, ahead_m: float, room_m: float) -> Array | None:
        """The piece of wall that a straight drive would come too close to.

        Args:
            ahead_m: how far the drive goes, [m].
            room_m: distance from the robot's centre that is too close, [m].

        Returns:
            Points on that piece, shape (5, 2), robot frame, [m]; None where the way is clear.
        """
        if not len(self._pieces):
            return None
        here = np.array([pose_robot_in_map.x, pose_robot_in_map.y])
        c, s = math.cos(pose_robot_in_map.heading), math.sin(pose_robot_in_map.heading)
        now = self._distance(here)
        then = np.minimum(
            self._distance(here + 0.5 * ahead_m * np.array([c, s])),
            self._distance(here + ahead_m * np.array([c, s])),
        )
        closing = then < now - 0.1 * ahead_m
        scraping = (now < room_m - SCRAPE_M) & (then < now + 0.1 * ahead_m)
        danger = (then < room_m) & (closing | scraping)
        if not danger.any():
            return None
        x, y, nx, ny, half = self._pieces[np.flatnonzero(danger)[np.argmin(then[danger])]]
        along = np.linspace(-half, half, 5)
        points = np.column_stack([x - ny * along, y + nx * along])
        return pose_robot_in_map.inverse().transform(points)

    def _distance(self, point: Array) -> Array:
        """From a point to each piece, shape (n,), [m]."""
        dx, dy = (point - self._pieces[:, :2]).T
        nx, ny = self._pieces[:, 2], self._pieces[:, 3]
        across = np.abs(dx * nx + dy * ny)
        beyond = np.maximum(0.0, np.abs(-dx * ny + dy * nx) - self._pieces[:, 4])
        return np.hypot(across, beyond)
