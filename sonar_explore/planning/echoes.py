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
PLANE_HEARD_RAD = math.radians(10.0)  # a plane square to a line this much off the axis is heard for sure
POINT_HEARD_RAD = math.radians(7.0)  # and so is an edge this much off it
BEFORE_M = 0.06  # what a disc should have heard lies nearer by this than what it heard


class EchoMemory:
    """Pieces of wall in the map frame; valid from one scan to the next."""

    def __init__(self, body: AmigoBot, is_point: Callable[[float, float], bool]) -> None:
        self._body = body
        self._is_point = is_point
        self._pieces: Array = np.empty((64, 6))
        """x y of the foot, x y of the normal, half the length, [m], doubts; the first `_count` rows are held."""
        self._count = 0
        self._last: Array = np.full(len(body.sonars), body.range_max_m)

    def note(self, pose_robot_in_map: Pose, ring_m: Array) -> None:
        """Take the discs that have fired since the last call."""
        fired = np.flatnonzero(ring_m != self._last).tolist()
        self._last = ring_m
        rows = []
        for i in fired:
            disc, range_m = pose_robot_in_map @ self._body.sonars[i], float(ring_m[i])
            silent = range_m >= self._body.range_max_m
            self._count = _refute(self._pieces, self._count, disc.x, disc.y, disc.heading, range_m, silent)
            if range_m >= HEARD_WITHIN_M:
                continue
            for off in NORMALS_RAD:
                c, s = math.cos(disc.heading + off), math.sin(disc.heading + off)
                x, y = disc.x + range_m * c, disc.y + range_m * s
                rows.append((x, y, c, s, 0.0 if self._is_point(x, y) else HALF_LENGTH_M, 0.0))
        if not rows:
            return
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
        x, y, nx, ny, half, _ = self._pieces[piece]
        along = np.linspace(-half, half, 5)
        points = np.column_stack([x - ny * along, y + nx * along])
        return pose_robot_in_map.inverse().transform(points)


@kernel
def _refute(pieces, count, x, y, heading, range_m, silent):  # type: ignore[no-untyped-def]
    """Doubt what this ping should have heard before it heard something, or nothing; how many pieces are left.

    A piece of wall that is not there may still be an edge at its foot: that is kept, until it is doubted as well. A
    ping that heard nothing may be one that went unheard: it takes two of those.
    """
    c, s = math.cos(heading), math.sin(heading)
    kept = 0
    for i in range(count):
        piece = pieces[i]
        to_x, to_y = piece[0] - x, piece[1] - y
        across = to_x * piece[2] + to_y * piece[3]
        if piece[4] > 0.0:
            distance = abs(across)
            ahead = (piece[2] * c + piece[3] * s) * (1.0 if across >= 0.0 else -1.0)
            along = abs(to_y * piece[2] - to_x * piece[3])
            heard = along <= piece[4] and ahead >= math.cos(PLANE_HEARD_RAD)
        else:
            distance = math.hypot(to_x, to_y)
            heard = to_x * c + to_y * s >= distance * math.cos(POINT_HEARD_RAD)
        if heard and distance < range_m - BEFORE_M:
            piece[5] += 1.0 if silent else 2.0
        if piece[5] >= 2.0:
            if piece[4] == 0.0:
                continue
            piece[4], piece[5] = 0.0, 0.0
        if kept != i:
            pieces[kept] = piece
        kept += 1
    return kept


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
