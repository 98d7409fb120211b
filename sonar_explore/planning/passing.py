"""Walls that the robot passes between two scans: from along a plane, one disc after another hears it.

A scan is sure of a wall only about the foot of its normal. What lies between two feet, or beside a wall that no scan
stood square to, stays open on the map; rays slip through and clear what is outside. The ring hears the rest of the
wall on the way. An edge answers from one place: the echoes of a few pings in line are a wall, those of two are none.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array

NEAREST_M = 0.15  # the dead zone
FARTHEST_M = 2.5  # farther off, rooms are left out for walls heard amiss
SURE_M = 1.3  # and nearer than this hardly any wall is heard amiss
LINE_M = 0.03  # feet this near to one line,
TURN_RAD = math.radians(12.0)  # under axes this alike, are of one wall
# of an echo inside a wall, another lies so far to either side: those of one edge spread less
BESIDE_M = (0.17, 0.40)
JOINED_M = 0.25  # feet this near along the wall leave no gap
HALF_LENGTH_M = 0.10  # of the piece of wall that an echo is sure of


class Passing:
    """What the ring has heard since the last scan."""

    def __init__(self, body: AmigoBot) -> None:
        self._mounts = np.array([(disc.x, disc.y, disc.heading) for disc in body.sonars])
        self._poses: list[Array] = []
        self._rings: list[Array] = [np.full((1, len(body.sonars)), body.range_max_m)]

    def note(self, poses_robot_in_map: Array, rings_m: Array) -> None:
        """The robot was here at some ticks, in order, x y [m] heading [rad], shape (ticks, 3); latest echo of each
        disc, shape (ticks, discs), [m]."""
        self._poses.append(poses_robot_in_map)
        self._rings.append(rings_m)

    def forget(self) -> None:
        """A scan was taken."""
        self._poses, self._rings = [], [self._rings[-1][-1:]]

    def walls(self) -> tuple[Array, Array]:
        """Pieces of wall on the way, and those that what was heard from near by makes alone, shape (n, 4) both, map
        frame, [m]; the very same where all was."""
        if not self._poses:
            return np.zeros((0, 4)), np.zeros((0, 4))
        rings = np.concatenate(self._rings)
        tick, disc = np.nonzero(rings[1:] != rings[:-1])
        heard = rings[1:][tick, disc]
        near = (heard >= NEAREST_M) & (heard <= FARTHEST_M)
        tick, disc, heard = tick[near], disc[near], heard[near]
        x, y, heading = np.concatenate(self._poses)[tick].T
        mount_x, mount_y, axis = self._mounts[disc].T
        c, s, axis = np.cos(heading), np.sin(heading), heading + axis
        discs = np.column_stack([x + c * mount_x - s * mount_y, y + s * mount_x + c * mount_y])
        feet, sure = discs + heard[:, None] * _along(axis), heard <= SURE_M
        walls = walls_along(feet, axis)
        return walls, walls if sure.all() else walls_along(feet[sure], axis[sure])


def walls_along(feet: Array, axes_rad: Array) -> Array:
    """Pieces of wall that echoes in line stand for, shape (k, 4), [m].

    Args:
        feet: x y of the echoes if they came from on the axis, shape (n, 2), [m].
        axes_rad: from the disc to them, shape (n,), [rad].
    """
    wall, normals = np.empty(len(feet), dtype=np.int64), _along(axes_rad)
    _sort_by_wall(feet, normals, axes_rad, *BESIDE_M, wall)
    pieces: list[Array] = [np.zeros((0, 4))]
    for k in sorted({*wall.tolist()} - {-1}):
        of_it = np.flatnonzero(wall == k)
        pieces.append(_piece(feet[of_it], normals[of_it], axes_rad[of_it]))
    return np.concatenate(pieces)


@kernel
def _sort_by_wall(feet, normals, axes, least, most, wall):  # type: ignore[no-untyped-def]
    """The first echo of the wall that each one lies inside, -1 for one that lies inside none.

    Echoes are of one wall if they are joined, directly or by others, in either direction.
    """
    for i in range(len(feet)):
        left, right = False, False
        for j in range(len(feet)):
            along = _along_wall(feet, normals, axes, i, j, most)
            left, right = left or -along >= least, right or (along >= least and along <= most)
        wall[i] = len(feet) if left and right else -1
    waiting = np.empty(len(feet), dtype=np.int64)
    for first in range(len(feet)):
        if wall[first] != len(feet):
            continue
        waiting[0], wall[first], count = first, first, 1
        while count > 0:
            count -= 1
            i = waiting[count]
            for j in range(len(feet)):
                if wall[j] == len(feet) and (
                    abs(_along_wall(feet, normals, axes, i, j, most)) <= JOINED_M
                    or abs(_along_wall(feet, normals, axes, j, i, most)) <= JOINED_M
                ):
                    waiting[count], wall[j] = j, first
                    count += 1


@inner_kernel
def _along_wall(feet, normals, axes, i, j, most):  # type: ignore[no-untyped-def]
    """How far along the wall of echo i, up to so much, lies echo j, [m]; inf where it is not in line."""
    off_x, off_y = feet[j, 0] - feet[i, 0], feet[j, 1] - feet[i, 1]
    if not abs(off_x * normals[i, 0] + off_y * normals[i, 1]) <= LINE_M:
        return np.inf
    along = off_y * normals[i, 0] - off_x * normals[i, 1]
    turned = math.pi - (math.pi - (axes[j] - axes[i])) % (2.0 * math.pi)
    return along if abs(along) <= most and abs(turned) <= TURN_RAD else np.inf


def _piece(feet: Array, normals: Array, axes_rad: Array) -> Array:
    """One piece of wall through all feet, or where they are not in line a short one through each, shape (k, 4)."""
    x, y = (normals.sum(axis=0) / len(feet)).tolist()
    length = math.hypot(x, y)
    x, y = x / length, y / length
    across = feet @ np.array([x, y])
    if across.max() - across.min() > 2.0 * LINE_M:
        tangents = HALF_LENGTH_M * _along(axes_rad + 0.5 * math.pi)
        return np.hstack([feet - tangents, feet + tangents])
    along, middle = (feet @ np.array([-y, x])).tolist(), float(across.sum()) / len(feet)
    ends = [min(along) - HALF_LENGTH_M, max(along) + HALF_LENGTH_M]
    return np.array([[c for end in ends for c in (middle * x - end * y, middle * y + end * x)]])


def _along(angles_rad: Array) -> Array:
    return np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
