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
from sonar_explore.compiled import inner_kernel, kernel, lean_kernel
from sonar_explore.geometry import Array, Pose

HEARD_WITHIN_M = 0.8  # a wall farther away is no danger yet
HALF_LENGTH_M = 0.25  # of the piece of wall that an echo stands for
# off the axis: a plane is heard over 12 degrees or so
NORMALS_RAD = -math.radians(8.0), 0.0, math.radians(8.0)
POINT_WITHIN_M = 0.12  # across the axis from an edge or a corner on the map, an echo may be its,
# as far as an edge is heard aside and the map is wrong by this; as far along the axis as well
POINT_HEARD_M = 0.06
EDGE_HEARD_RAD = math.radians(12.0)  # off the axis, from near by (`beam.Beam`)
SCRAPE_M = 0.02  # nearer than the room to keep by this, going along a wall is too near as well
KEPT_M = 1.0  # echoes farther from the robot are forgotten
PLANE_HEARD_RAD = math.radians(10.0)  # a plane square to a line this much off the axis is heard for sure
POINT_HEARD_RAD = math.radians(7.0)  # and so is an edge this much off it
COLUMNS = 6  # of a piece
NEARER_PER_M = math.cos(math.radians(41.0))  # as fast comes a wall nearer that lies beside the front discs
GLANCE_LEAST_M = 0.06  # no oftener does the robot glance, [m]
# a wall nearer than the room to keep and this, [m], is heard again before the piece that was heard ends
WALL_BESIDE_M = 0.16
HAIR_M2 = 1e-9  # nearer than this to the square of a limit the exact distance decides
BEFORE_M = 0.06  # what a disc should have heard lies nearer by this than what it heard


class EchoMemory:
    """Pieces of wall in the map frame; valid from one scan to the next."""

    def __init__(self, body: AmigoBot, points: Callable[[], Array]) -> None:
        """
        Args:
            body: where its discs sit.
            points: edges and corners on the map now, x y, shape (n, 2), [m].
        """
        self._mounts = np.array([(disc.x, disc.y, disc.heading) for disc in body.sonars])
        self._range_max_m = body.range_max_m
        self._points = points
        self._pieces: Array = np.empty((64, COLUMNS))
        """x y of the foot, x y of the normal, half the length, [m], doubts; the first `_count` rows are held."""
        self._count = 0
        self._last: Array = np.full(len(body.sonars), body.range_max_m)

    def note(self, poses_robot_in_map: Array, rings_m: Array) -> None:
        """Take the discs that have fired since the last call.

        Args:
            poses_robot_in_map: of some ticks, in order: x y [m] heading [rad], shape (ticks, 3).
            rings_m: latest echo of each disc after each tick, shape (ticks, discs), [m].
        """
        self._make_room(rings_m.size)
        self._count = note_echoes(
            self._pieces,
            self._count,
            poses_robot_in_map,
            rings_m,
            self._last,
            self._mounts,
            self._range_max_m,
            self._points(),
        )

    def as_kernels_take_it(self, ticks: int) -> tuple[Array, int, Array, Array, float, Array]:
        """Pieces, with room for what so many ticks may bring, and how many are held; the last ring; mounts, greatest
        range, points of the map."""
        self._make_room(ticks + len(self._last))
        return self._pieces, self._count, self._last, self._mounts, self._range_max_m, self._points()

    @property
    def held(self) -> tuple[Array, int]:
        """Pieces, and how many of the rows are held."""
        return self._pieces, self._count

    def holds(self, count: int) -> None:
        """A kernel that took it has changed the pieces: so many are held now."""
        self._count = count

    def _make_room(self, pings: int) -> None:
        while self._count + len(NORMALS_RAD) * pings > len(self._pieces):
            self._pieces = np.vstack([self._pieces, np.empty_like(self._pieces)])

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
        piece = nearest_danger(self._pieces, self._count, here.x, here.y, c, s, ahead_m, room_m)
        if piece < 0:
            return None
        x, y, nx, ny, half, _ = self._pieces[piece]
        along = np.linspace(-half, half, 5)
        points = np.column_stack([x - ny * along, y + nx * along])
        return pose_robot_in_map.inverse().transform(points)


@kernel
def note_echoes(pieces, count, poses, rings, last, mounts, range_max, points):  # type: ignore[no-untyped-def]
    """Doubt, forget and add pieces, tick by tick; how many are held. `last` goes on to the last ring."""
    fresh = np.empty((len(NORMALS_RAD) * len(last), COLUMNS))
    for tick in range(len(poses)):
        x, y, heading = poses[tick, 0], poses[tick, 1], poses[tick, 2]
        c, s = math.cos(heading), math.sin(heading)
        heard = 0
        for i in range(len(last)):
            range_m = rings[tick, i]
            if range_m == last[i]:
                continue
            last[i] = range_m
            disc_x, disc_y = x + c * mounts[i, 0] - s * mounts[i, 1], y + s * mounts[i, 0] + c * mounts[i, 1]
            axis = heading + mounts[i, 2]
            count = _refute(pieces, count, disc_x, disc_y, axis, range_m, range_m >= range_max)
            if range_m < HEARD_WITHIN_M:
                half = 0.0 if _is_of_a_point(disc_x, disc_y, axis, range_m, points) else HALF_LENGTH_M
                for off in NORMALS_RAD:
                    _piece(disc_x, disc_y, axis + off, range_m, half, fresh[heard])
                    heard += 1
        if heard:
            count = _forget_far(pieces, count, x, y)
            for i in range(heard):
                _copy(fresh[i], pieces[count])
                count += 1
    return count


@inner_kernel
def _piece(x, y, direction, range_m, half, piece):  # type: ignore[no-untyped-def]
    """What an echo from this direction stands for: a wall across it so long to either side, or a point."""
    c, s = math.cos(direction), math.sin(direction)
    piece[0], piece[1], piece[2], piece[3] = x + range_m * c, y + range_m * s, c, s
    piece[4], piece[5] = half, 0.0


@inner_kernel
def _is_of_a_point(x, y, axis, range_m, points):  # type: ignore[no-untyped-def]
    """Whether an echo may be that of one of the points, shape (n, 2): as far off, and where an edge is still heard."""
    c, s = math.cos(axis), math.sin(axis)
    aside = min(POINT_WITHIN_M, range_m * math.sin(EDGE_HEARD_RAD) + POINT_HEARD_M)
    nearest, farthest = max(0.0, range_m - POINT_HEARD_M), range_m + POINT_HEARD_M
    for i in range(len(points)):
        to_x, to_y = points[i, 0] - x, points[i, 1] - y
        square = to_x * to_x + to_y * to_y
        if square < nearest * nearest - HAIR_M2 or square > farthest * farthest + HAIR_M2:
            continue
        off = abs(math.hypot(to_x, to_y) - range_m)
        if off <= POINT_HEARD_M and abs(to_y * c - to_x * s) <= aside and to_x * c + to_y * s > 0.0:
            return True
    return False


@inner_kernel
def _copy(row, to):  # type: ignore[no-untyped-def]
    for column in range(COLUMNS):  # a whole row at once takes three seconds to compile
        to[column] = row[column]


@inner_kernel
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
        across, distance = to_x * piece[2] + to_y * piece[3], 0.0
        if piece[4] > 0.0:
            distance = abs(across)
            ahead = (piece[2] * c + piece[3] * s) * (1.0 if across >= 0.0 else -1.0)
            along = abs(to_y * piece[2] - to_x * piece[3])
            heard = along <= piece[4] and ahead >= math.cos(PLANE_HEARD_RAD)
        else:
            ahead = to_x * c + to_y * s
            heard = ahead >= 0.0  # none that lies behind
            if heard:
                distance = math.hypot(to_x, to_y)
                heard = ahead >= distance * math.cos(POINT_HEARD_RAD)
        if heard and distance < range_m - BEFORE_M:
            piece[5] += 1.0 if silent else 2.0
        if piece[5] >= 2.0:
            if piece[4] == 0.0:
                continue
            piece[4], piece[5] = 0.0, 0.0
        if kept != i:
            _copy(piece, pieces[kept])
        kept += 1
    return kept


@inner_kernel
def _forget_far(pieces, count, x, y):  # type: ignore[no-untyped-def]
    """Move the pieces near the robot to the front, in their order; how many they are."""
    kept = 0
    for i in range(count):
        to_x, to_y = pieces[i, 0] - x, pieces[i, 1] - y
        square = to_x * to_x + to_y * to_y
        if square < KEPT_M * KEPT_M - HAIR_M2 or math.hypot(to_x, to_y) <= KEPT_M:
            _copy(pieces[i], pieces[kept])
            kept += 1
    return kept


@lean_kernel
def nearest_danger(pieces, count, x, y, c, s, ahead, room):  # type: ignore[no-untyped-def]
    """The piece that a drive would come nearest to, of those that it would come too near to; -1 for none."""
    nearest, found = np.inf, -1
    for i in range(count):
        piece = pieces[i]
        reach = room + ahead + piece[4] + SCRAPE_M
        # no part of it is near enough: so it is with most
        if abs(piece[0] - x) > reach or abs(piece[1] - y) > reach:
            continue
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


@inner_kernel
def glance_after(pieces, count, x, y, c, s, room, most):  # type: ignore[no-untyped-def]
    """How far the robot may go before it must glance again.

    A wall that begins at an edge is heard only from beyond that edge, and there by no disc where it lies between their
    axes: it may come nearer than the edge. A wall beside the way goes on past the piece that an echo stands for.
    """
    nearest = np.inf
    for i in range(count):
        to_x, to_y = pieces[i, 0] - x, pieces[i, 1] - y
        if pieces[i, 4] == 0.0 and to_x * c + to_y * s > -room:
            nearest = min(nearest, math.hypot(to_x, to_y))
        elif pieces[i, 4] > 0.0 and _distance(pieces[i], x, y) < room + WALL_BESIDE_M:
            most = min(most, HALF_LENGTH_M)
    return min(most, max(GLANCE_LEAST_M, (nearest - room) / NEARER_PER_M))


@inner_kernel
def _distance(piece, x, y):  # type: ignore[no-untyped-def]
    """From a point to a piece, [m]."""
    dx, dy = x - piece[0], y - piece[1]
    across = abs(dx * piece[2] + dy * piece[3])
    beyond = max(0.0, abs(-dx * piece[3] + dy * piece[2]) - piece[4])
    return math.hypot(across, beyond)
