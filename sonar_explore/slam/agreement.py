"""Walls on which several discs agree, and what one turn of the robot says in all (beyond the paper).

While the robot turns once, every one of its discs hears the whole room, each at other headings of the lattice, at
other times of the turn, and from another place beside the turning axis. The paper keeps one and throws seven away.
Kept, they tell three things that one cannot:

- the bearing of a wall, as the mean of up to eight;
- whether it is a wall: the normal of a plane has one bearing for all of them, while a point (edge, corner, column) is
  heard when the axis of the disc goes through it, which for a disc beside the turning axis is another heading. Two
  discs 15 cm apart across their axes hear an edge a metre away 9 degrees apart;
- how wrong the turn was: the same wall, or point, heard early by one disc and late by another, has moved by the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from operator import attrgetter

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.discs import TurnError, adds_to_turn, agreeing
from sonar_explore.slam.features import (
    Feature,
    FeatureConfig,
    FeatureKind,
    extract_features,
    tangent,
)
from sonar_explore.slam.heard import (
    ASIDE,
    BEARING,
    CORNER,
    DISC,
    EDGE,
    KIND,
    LENGTH,
    RANGE,
    START,
    SWEEP,
    WALL,
    WIDTH,
    Heard,
    heard_by_discs,
    wrapped,
)
from sonar_explore.slam.points import Point, PointConfig, points_among
from sonar_explore.sums import dot, total


@dataclass(frozen=True)
class AgreementConfig:
    """What counts as the same thing heard by several discs, and as a wall."""

    enabled: bool = False
    """The paper stores the readings of only one sensor (section IV)."""
    discs_min: int = 4
    """Fewer discs agree on nothing."""
    bearing_rad: float = math.radians(6.0)
    """Bearings of one thing differ by no more, [rad]."""
    range_m: float = 0.03
    """Nor its ranges by more than this, [m]."""
    point_share: float = 0.5
    """Bearings that shift with the discs by more than this share of what a point's would are no wall's."""
    noise_rad: float = math.radians(1.2)
    """Standard deviation of one disc's bearing of a wall or a point, [rad]."""
    points: PointConfig = field(default_factory=PointConfig)
    """What counts as a point."""


@dataclass(frozen=True)
class Extraction:
    """What one turn of the robot says."""

    features: tuple[Feature, ...]
    """By bearing."""
    points: tuple[Point, ...] = ()
    """Edges, corners and columns on which several discs agree."""
    turn: TurnError | None = None
    """None where nothing was heard by several discs."""


def extract(
    scan: Scan, config: FeatureConfig, agreement: AgreementConfig, turn_error: float = 0.0
) -> Extraction:
    """Features of one scan: those that its one disc heard (the paper), or those on which all its discs agree.

    Args:
        turn_error: true over counted turn, less one, as far as is known.
    """
    if not agreement.enabled or not scan.others:
        return Extraction(extract_features(scan.turned(turn_error), config))
    heard = heard_by_discs(scan, config, agreement.points, turn_error)
    sums = np.zeros(2)
    features = _agreed(heard, len(scan.ranges_m), scan.bearings_rad, config, agreement, sums)
    points = points_among(heard.in_front, config.beam, agreement.points, sums)
    return Extraction(features, points, TurnError.of(sums, agreement.noise_rad))


def _agreed(
    heard: Heard, n: int, bearings: Array, config: FeatureConfig, agreement: AgreementConfig, sums: Array
) -> tuple[Feature, ...]:
    """What several discs heard, and the corners and edges of the scan's own disc that are none of it, by bearing.

    What the walls say of the turn is added to `sums`.
    """
    things, alone = np.empty((len(heard.walls), 9)), np.ones(len(heard.others), dtype=bool)
    count = _agree(heard.walls, heard.others, _limits(agreement), things, alone, sums)
    around = _around(n, bool(bearings[-1] < bearings[0]))
    rows = [*things[:count].tolist(), *heard.others[alone].tolist()]
    return tuple(sorted([_feature(row, around, config) for row in rows], key=_bearing))


@lru_cache(maxsize=4)
def _around(n: int, clockwise: bool) -> tuple[int, ...]:
    """The readings counter-clockwise, twice over."""
    return (*range(n - 1, -1, -1),) * 2 if clockwise else (*range(n),) * 2


@lru_cache(maxsize=4)
def _limits(config: AgreementConfig) -> Array:
    """What is alike, and what is a wall, as the kernel takes it."""
    return np.array([config.discs_min, config.bearing_rad, config.range_m, config.point_share])


KINDS = {WALL: FeatureKind.WALL, CORNER: FeatureKind.CORNER, EDGE: FeatureKind.EDGE}
_bearing = attrgetter("bearing_rad")


def _feature(row: Sequence[float], around: tuple[int, ...], config: FeatureConfig) -> Feature:
    """One row of what is heard, the column of the disc being how many discs heard it."""
    bearing, depth, sweep, width, _, discs, number, start, length = row
    kind, start = KINDS[int(number)], int(start)
    return Feature(
        kind,
        wrap_angle(bearing),
        depth,
        width,
        tangent(kind, bearing, depth, width, config),
        around[start : start + int(length)],
        sweep,
        int(discs),
    )


@kernel
def _agree(walls, others, limits, things, alone, sums):  # type: ignore[no-untyped-def]
    """Walls and points on which enough discs agree, into `things`: how many; `alone` is false for what they are.

    The columns are those of what one disc heard, but for the number of discs in place of the disc's, in both.
    """
    n = len(walls)
    distance, disc = np.empty((n, n)), np.empty(n, dtype=np.int64)
    for i in range(n):
        disc[i] = int(walls[i, DISC])
        for j in range(n):
            distance[i, j] = np.inf
            farther = abs(walls[i, RANGE] - walls[j, RANGE]) / limits[2]
            if farther <= 1.0:
                turned = abs(wrapped(walls[i, BEARING] - walls[j, BEARING])) / limits[1]
                if turned <= 1.0:
                    distance[i, j] = turned + farther
    members, ends = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    count = agreeing(distance, disc, walls[:, BEARING], limits[0], members, ends)
    for i in range(len(others)):
        others[i, DISC] = 1
    for k in range(count):
        rows, thing = members[(ends[k - 1] if k else 0) : ends[k]], things[k]
        _thing(walls, rows, limits, thing, sums)
        thing[START] = thing[LENGTH] = 0.0
        for i in range(n):
            if disc[i] == 0 and _near(walls[i], thing, limits):
                thing[START], thing[LENGTH] = walls[i, START], walls[i, LENGTH]
                break
        for i in range(len(others)):
            alone[i] = alone[i] and not _near(others[i], thing, limits)
    return count


@kernel
def _thing(walls, rows, limits, thing, sums):  # type: ignore[no-untyped-def]
    """The wall or the point that the discs of these rows heard."""
    n = len(rows)
    bearing, beside, sweep = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        sweep[k], beside[k] = walls[rows[k], RANGE], walls[rows[k], WIDTH]
    depth, thing[WIDTH] = total(sweep) / n, total(beside) / n
    for k in range(n):
        wall, first = walls[rows[k]], walls[rows[0], BEARING]
        bearing[k] = first + wrapped(wall[BEARING] - first)  # does not jump at half a turn
        beside[k], sweep[k] = wall[ASIDE] / depth, wall[SWEEP]
    middle = total(beside) / n
    thing[BEARING], thing[RANGE], thing[SWEEP] = total(bearing) / n, depth, total(sweep) / n
    thing[KIND], thing[DISC], thing[ASIDE] = WALL, n, middle
    for k in range(n):
        beside[k] -= middle
    scatter = dot(beside, beside)
    share = dot(beside, bearing) / scatter if scatter > 1e-9 else 0.0
    if abs(share) > limits[3]:
        thing[KIND] = EDGE
        thing[BEARING] -= share * middle
    else:
        adds_to_turn(sweep, bearing, sums)


@inner_kernel
def _near(one, other, limits):  # type: ignore[no-untyped-def]
    turned = abs(wrapped(one[BEARING] - other[BEARING]))
    return turned <= limits[1] and abs(one[RANGE] - other[RANGE]) <= limits[2]
