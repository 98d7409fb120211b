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
from sonar_explore.compiled import kernel
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
        self._pieces: Array = np.empty((64, 5))
        """x y of the foot, x y of the normal, half the length, [m]; the first `_count` rows are held."""
        self._count = 0
        self._last: Array = np.full(len(body.sonars), body.range_max_m)

    def note(self, pose_robot_in_map: Pose, ring_m: Array) -> None:
        """Take the discs that have fired since the last call."""
        fired = _fired(ring_m, self._last)
        self._last = ring_m
        if not fired:
            return
        rows = []
        for i, mount in enumerate(self._body.sonars):
            if not fired >> i & 1:
                continue
            disc, range_m = pose_robot_in_map @ mount, float(ring_m[i])
            for off in NORMALS_RAD:
                c, s = math.cos(disc.heading + off), math.sin(disc.heading + off)
                x, y = disc.x + range_m * c, disc.y + range_m * s
                rows.append((x, y, c, s, 0.0 if self._is_point(x, y) else HALF_LENGTH_M))
        self._count = _forget_far(self._pieces, self._count, pose_robot_in_map.x, pose_robot_in_map.y)
        needed = self._count + len(rows)
        while needed > len(self._pieces):
            self._pieces = np.vstack([self._pieces, np.empty_like(self._pieces)])
        self._pieces[self._count : needed] = rows
        self._count = needed

    def forget(self) -> None:
        """A new scan knows better."""
        self._count = 0

    def in_the_way(self, pose_robot_in_map: Pose, ahead_m: float, room_m: float) -> Array | None:
        """The piece of wall that a straight drive would come too close to.

        Args:
            ahead_m: how far the drive goes, [m].
            room_m: distance from the robot's centre that is too close, [m].

        Returns:
            Points on that piece, shape (5, 2), robot frame, [m]; None where the way is clear.
        """
        if not self._count:
            return None
        here = pose_robot_in_map
        c, s = math.cos(here.heading), math.sin(here.heading)
        piece = _nearest_danger(self._pieces[: self._count], here.x, here.y, c, s, ahead_m, room_m)
        if piece < 0:
            return None
        x, y, nx, ny, half = self._pieces[piece]
        along = np.linspace(-half, half, 5)
        points = np.column_stack([x - ny * along, y + nx * along])
        return pose_robot_in_map.inverse().transform(points)


@kernel
def _fired(ring, last):  # type: ignore[no-untyped-def]
    """Which discs heard something near that they had not reported last time, bit by bit."""
    fired = 0
    for i in range(len(ring)):
        if ring[i] != last[i] and ring[i] < HEARD_WITHIN_M:
            fired |= 1 << i
    return fired


@kernel
def _forget_far(pieces, count, x, y):  # type: ignore[no-untyped-def]
    """Move the pieces near the robot to the front, in their order; how many they are."""
    kept = 0
    for i in range(count):
        if math.hypot(pieces[i, 0] - x, pieces[i, 1] - y) <= KEPT_M:
            for column in range(pieces.shape[1]):  # a whole row at once takes three seconds to compile
                pieces[kept, column] = pieces[i, column]
            kept += 1
    return kept


@kernel
def _nearest_danger(pieces, x, y, c, s, ahead, room):  # type: ignore[no-untyped-def]
    """The piece that a drive would come nearest to, of those that it would come too near to; -1 for none."""
    nearest, found = np.inf, -1
    for i in range(len(pieces)):
        piece = pieces[i]
        now = _distance(piece, x, y)
        then = min(
            _distance(piece, x + 0.5 * ahead * c, y + 0.5 * ahead * s),
            _distance(piece, x + ahead * c, y + ahead * s),
        )
        closing = then < now - 0.1 * ahead
        scraping = now < room - SCRAPE_M and then < now + 0.1 * ahead
        if then < room and (closing or scraping) and then < nearest:
            nearest, found = then, i
    return found


@kernel
def _distance(piece, x, y):  # type: ignore[no-untyped-def]
    """From a point to a piece, [m]."""
    dx, dy = x - piece[0], y - piece[1]
    across = abs(dx * piece[2] + dy * piece[3])
    beyond = max(0.0, abs(-dx * piece[3] + dy * piece[2]) - piece[4])
    return math.hypot(across, beyond)
