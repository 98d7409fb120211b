"""Walls that the robot passes between two scans: from along a plane, one disc after another hears it.

A scan is sure of a wall only about the foot of its normal. What lies between two feet, or beside a wall that no scan
stood square to, stays open on the map; rays slip through and clear what is outside. The ring hears the rest of the
wall on the way. An edge answers from one place: the echoes of a few pings in line are a wall, those of two are none.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, wrap_angle
from sonar_explore.mapping.grid import Mask

NEAREST_M = 0.15  # the dead zone
FARTHEST_M = 1.2  # beyond, the echoes of an edge spread as far as those of a wall
LINE_M = 0.03  # feet this near to one line,
TURN_RAD = math.radians(12.0)  # under axes this alike, are of one wall
BESIDE_M = (0.15, 0.40)  # of an echo inside a wall, another lies so far to either side
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

    def walls(self) -> Array:
        """Pieces of wall that it was sure of on the way, shape (n, 4), map frame, [m]."""
        if not self._poses:
            return np.zeros((0, 4))
        rings = np.concatenate(self._rings)
        tick, disc = np.nonzero(rings[1:] != rings[:-1])
        heard = rings[1:][tick, disc]
        near = (heard >= NEAREST_M) & (heard <= FARTHEST_M)
        tick, disc, heard = tick[near], disc[near], heard[near]
        x, y, heading = np.concatenate(self._poses)[tick].T
        mount_x, mount_y, axis = self._mounts[disc].T
        c, s, axis = np.cos(heading), np.sin(heading), heading + axis
        discs = np.column_stack([x + c * mount_x - s * mount_y, y + s * mount_x + c * mount_y])
        return walls_along(discs + heard[:, None] * _along(axis), axis)


def walls_along(feet: Array, axes_rad: Array) -> Array:
    """Pieces of wall that echoes in line stand for, shape (k, 4), [m].

    Args:
        feet: x y of the echoes if they came from on the axis, shape (n, 2), [m].
        axes_rad: from the disc to them, shape (n,), [rad].
    """
    x, y = feet.T
    normal_x, normal_y = _along(axes_rad).T
    off_x, off_y = x[None] - x[:, None], y[None] - y[:, None]
    across = off_x * normal_x[:, None] + off_y * normal_y[:, None]
    along = off_y * normal_x[:, None] - off_x * normal_y[:, None]
    least, most = BESIDE_M
    foot, other = np.nonzero((np.abs(across) <= LINE_M) & (np.abs(along) <= most))
    in_line = np.abs(wrap_angle(axes_rad[other] - axes_rad[foot])) <= TURN_RAD
    foot, other = foot[in_line], other[in_line]
    along = along[foot, other]
    both_sides = np.ones(len(feet), dtype=bool)
    for side in (along, -along):
        both_sides &= np.bincount(foot[(side >= least) & (side <= most)], minlength=len(feet)) > 0
    sure = np.flatnonzero(both_sides)
    if not len(sure):
        return np.zeros((0, 4))
    joined = np.zeros((len(feet), len(feet)), dtype=bool)
    near = np.abs(along) <= JOINED_M
    joined[foot[near], other[near]] = True
    wall = joined_groups(joined[np.ix_(sure, sure)])
    pieces = [_piece(feet[sure[wall == k]], axes_rad[sure[wall == k]]) for k in np.unique(wall)]
    return np.vstack([np.zeros((0, 4)), *pieces])


def joined_groups(joined: Mask) -> NDArray[np.int64]:
    """The first of those that each is joined to, directly or by others, in either direction, shape (k,)."""
    joined = joined | joined.T
    first = np.arange(len(joined))
    while True:
        lower = np.where(joined, first, len(first)).min(axis=1)
        lower = lower[lower]
        if (lower == first).all():
            return first
        first = lower


def _piece(feet: Array, axes_rad: Array) -> Array:
    """One piece of wall through all feet, or where they are not in line a short one through each, shape (k, 4)."""
    normal = _along(axes_rad).mean(axis=0)
    normal /= math.hypot(*normal)
    across = feet @ normal
    if np.ptp(across) > 2.0 * LINE_M:
        tangents = HALF_LENGTH_M * _along(axes_rad + 0.5 * math.pi)
        return np.hstack([feet - tangents, feet + tangents])
    tangent = np.array([-normal[1], normal[0]])
    along = feet @ tangent
    ends = np.array([[along.min() - HALF_LENGTH_M], [along.max() + HALF_LENGTH_M]])
    return (across.mean() * normal + ends * tangent).reshape(1, 4)


def _along(angles_rad: Array) -> Array:
    return np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
