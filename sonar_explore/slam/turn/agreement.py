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
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from sonar_explore.compiled import inner_allocating_kernel, inner_kernel, kernel, lean_kernel
from sonar_explore.geometry import Array, Segment
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import (
    Feature,
    FeatureConfig,
    FeatureKind,
    extract_features,
)
from sonar_explore.slam.turn.discs import TurnError, adds_to_turn, agreeing
from sonar_explore.slam.turn.heard import (
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
from sonar_explore.slam.turn.points import Point, PointConfig, points_among
from sonar_explore.sums import dot, total

X1, Y1, X2, Y2, COLUMNS = range(LENGTH + 1, LENGTH + 6)
"""Columns of a feature, after those of what is heard: its ends; and how many there are."""
KINDS = {WALL: FeatureKind.WALL, CORNER: FeatureKind.CORNER, EDGE: FeatureKind.EDGE}


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


@dataclass(frozen=True, eq=False)
class Extraction:
    """What one turn of the robot says."""

    points: tuple[Point, ...] = ()
    """Edges, corners and columns on which several discs agree."""
    turn: TurnError | None = None
    """None where nothing was heard by several discs."""
    of_one_disc: tuple[Feature, ...] = ()
    """By bearing, where one disc alone was asked."""
    of_several: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """On which several agree, and what else the scan's own heard, by bearing: columns of `heard`, of which that of the
    disc says how many, then both ends [m]; shape (n, 13)."""
    around: tuple[int, ...] = ()
    """Their readings counter-clockwise, twice over."""

    def features(self, error: float | None = None) -> tuple[Feature, ...]:
        """By bearing, each turned by this share of how far the robot had turned when it was heard."""
        rows, found = self.of_several, self.of_one_disc
        if error is not None:
            rows, found = rows.copy(), tuple(f.turned(error * f.sweep_rad) for f in found)
            _straightened(rows, error)
        around = self.around
        return found + tuple(
            [
                Feature(
                    KINDS[int(kind)],
                    bearing,
                    depth,
                    width,
                    Segment(x1, y1, x2, y2),
                    around[int(start) : int(start + length)],
                    sweep,
                    int(discs),
                )
                for bearing, depth, sweep, width, _, discs, kind, start, length, x1, y1, x2, y2 in rows.tolist()
            ]
        )


def extract(
    scan: Scan, config: FeatureConfig, agreement: AgreementConfig, turn_error: float = 0.0
) -> Extraction:
    """Features of one scan: those that its one disc heard (the paper), or those on which all its discs agree.

    Args:
        turn_error: true over counted turn, less one, as far as is known.
    """
    if not agreement.enabled or not scan.others:
        return Extraction(of_one_disc=extract_features(scan.turned(turn_error), config))
    heard = heard_by_discs(scan, config, agreement.points, turn_error)
    rows, sums = _agreed(heard, config, agreement)
    points = points_among(heard.in_front, config.beam, agreement.points, sums)
    around = _around(len(scan.ranges_m), bool(scan.headings_rad[-1] < scan.headings_rad[0]))
    turn = TurnError.of(sums, agreement.noise_rad)
    return Extraction(points, turn, of_several=rows, around=around)


def walls_heard(scan: Scan, config: FeatureConfig, agreement: AgreementConfig) -> Array:
    """Range [m] and bearing [rad] of the walls among the features that `extract` finds, shape (n, 2)."""
    if not agreement.enabled or not scan.others:
        found = extract(scan, config, agreement).of_one_disc
        walls = [(f.range_m, f.bearing_rad) for f in found if f.kind is FeatureKind.WALL]
        return np.array(walls).reshape(-1, 2)
    rows, _ = _agreed(heard_by_discs(scan, config, agreement.points), config, agreement)
    return np.asarray(rows[rows[:, KIND] == WALL][:, [RANGE, BEARING]])


def _agreed(heard: Heard, config: FeatureConfig, agreement: AgreementConfig) -> tuple[Array, Array]:
    """`Extraction.of_several`, and what the walls say of the turn: sums for `TurnError`."""
    sums, rows = np.zeros(2), np.empty((len(heard.walls) + len(heard.others), COLUMNS))
    count = _agree(heard.walls, heard.others, _limits(config, agreement), rows, sums)
    return rows[:count], sums


@lru_cache(maxsize=4)
def _around(n: int, clockwise: bool) -> tuple[int, ...]:
    """The readings counter-clockwise, twice over."""
    return (*range(n - 1, -1, -1),) * 2 if clockwise else (*range(n),) * 2


@lru_cache(maxsize=4)
def _limits(config: FeatureConfig, agreement: AgreementConfig) -> Array:
    """What is alike, and what is a wall, as the kernel takes it."""
    alike = agreement.discs_min, agreement.bearing_rad, agreement.range_m, agreement.point_share
    return np.array([*alike, config.width_max_beams * config.beam_rad])


@kernel
def _agree(walls, others, limits, out, sums):  # type: ignore[no-untyped-def]
    """What several discs heard, and the corners and edges of the scan's own disc that are none of it, into `out` by
    bearing: how many. What the walls say of the turn is added to `sums`.
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
    for k in range(count):
        rows, thing = members[(ends[k - 1] if k else 0) : ends[k]], out[k]
        _thing(walls, rows, limits, thing, sums)
        thing[START] = thing[LENGTH] = 0.0
        for i in range(n):
            if disc[i] == 0 and _near(walls[i], thing, limits):
                thing[START], thing[LENGTH] = walls[i, START], walls[i, LENGTH]
                break
    things = count
    for i in range(len(others)):
        alone = True
        for k in range(things):
            alone = alone and not _near(others[i], out[k], limits)
        if alone:
            for column in range(others.shape[1]):
                out[count, column] = others[i, column]
            out[count, DISC] = 1.0
            count += 1
    for k in range(count):
        _cut(out[k], limits[4])
        out[k, BEARING] = wrapped(out[k, BEARING])
    _sort(out[:count])
    return count


@inner_kernel
def _cut(row, widest):  # type: ignore[no-untyped-def]
    """`features.tangent`: the ends of what was heard."""
    half = 0.0
    if row[KIND] == WALL:
        half = row[RANGE] * math.tan(0.5 * min(row[WIDTH], widest))
    c, s = math.cos(row[BEARING]), math.sin(row[BEARING])
    x, y = row[RANGE] * c, row[RANGE] * s
    row[X1], row[Y1], row[X2], row[Y2] = x + half * s, y - half * c, x - half * s, y + half * c


@inner_allocating_kernel
def _sort(rows):  # type: ignore[no-untyped-def]
    """By bearing; of equals the earlier stays first."""
    row = np.empty(rows.shape[1])
    for i in range(1, len(rows)):
        at = i
        for column in range(len(row)):
            row[column] = rows[i, column]
        while at > 0 and rows[at - 1, BEARING] > row[BEARING]:
            for column in range(len(row)):
                rows[at, column] = rows[at - 1, column]
            at -= 1
        for column in range(len(row)):
            rows[at, column] = row[column]


@lean_kernel
def _straightened(rows, error):  # type: ignore[no-untyped-def]
    """`Feature.turned`, by this share of how far the robot had turned."""
    for i in range(len(rows)):
        turn, x1, y1, x2, y2 = error * rows[i, SWEEP], rows[i, X1], rows[i, Y1], rows[i, X2], rows[i, Y2]
        c, s = math.cos(turn), math.sin(turn)
        rows[i, BEARING] = wrapped(rows[i, BEARING] + turn)
        rows[i, X1], rows[i, Y1] = c * x1 - s * y1, s * x1 + c * y1
        rows[i, X2], rows[i, Y2] = c * x2 - s * y2, s * x2 + c * y2


@inner_allocating_kernel
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
