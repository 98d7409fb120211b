"""Walls on which several discs agree (beyond the paper).

While the robot turns once, every one of its discs hears the whole room, each at other headings of the lattice, at
other times of the turn, and from another place beside the turning axis. The paper keeps one and throws seven away.
Kept, they tell three things that one cannot:

- the bearing of a wall, as the mean of up to eight;
- whether it is a wall: the normal of a plane has one bearing for all of them, while a point (edge, corner, column) is
  heard when the axis of the disc goes through it, which for a disc beside the turning axis is another heading. Two
  discs 15 cm apart across their axes hear an edge a metre away 9 degrees apart;
- how wrong the turn was: the same wall, heard early by one disc and late by another, has moved by the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import (
    Feature,
    FeatureConfig,
    FeatureKind,
    extract_features,
    tangent,
)
from sonar_explore.slam.heard import walls_heard


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
    """Standard deviation of one disc's bearing of a wall, [rad]."""


@dataclass(frozen=True)
class TurnError:
    """By how much more the robot truly turned than its odometry says, as the walls tell it."""

    relative: float
    """True turn over counted turn, less one."""
    sigma: float
    """Its standard deviation."""


@dataclass(frozen=True)
class Extraction:
    """What one turn of the robot says."""

    features: tuple[Feature, ...]
    """By bearing."""
    turn: TurnError | None = None
    """None where no wall was heard by several discs."""


@dataclass(frozen=True, eq=False)
class _Heard:
    """What passed for a wall with some disc; every array has shape (n,)."""

    disc: np.ndarray
    """Which of the discs heard it, counted from the scan's own."""
    bearing: Array
    """Of its normal, robot frame at the start of the scan, [rad]."""
    range: Array
    """From the robot's centre, [m]."""
    sweep: Array
    """How far the robot had turned by then, signed, [rad]."""
    width: Array
    """From the first to the last heading that heard it, [rad]."""
    aside: Array
    """How far the axis of the disc passes from the turning axis, to its left, [m]."""

    def only(self, rows: Array) -> _Heard:
        columns = self.disc, self.bearing, self.range, self.sweep, self.width, self.aside
        return _Heard(*(column[rows] for column in columns))


def extract(scan: Scan, config: FeatureConfig, agreement: AgreementConfig) -> Extraction:
    """Features of one scan: those that its one disc heard (the paper), or those on which all its discs agree."""
    first = extract_features(scan, config)
    if not agreement.enabled or not scan.others:
        return Extraction(first)
    heard = _heard(scan, first, walls_heard(scan.others, config))
    things = [_unwrapped(heard.only(rows)) for rows in _things(heard, agreement)]
    agreed = [_feature(thing, first, config, agreement) for thing in things]
    walls = [t for t, f in zip(things, agreed, strict=True) if f.kind is FeatureKind.WALL]
    points = [
        f
        for f in first
        if f.kind is not FeatureKind.WALL
        and not any(_near(f, a.bearing_rad, a.range_m, agreement) for a in agreed)
    ]
    features = tuple(sorted([*agreed, *points], key=lambda feature: feature.bearing_rad))
    return Extraction(features, turn_error([(w.sweep, w.bearing) for w in walls], agreement.noise_rad))


def _heard(scan: Scan, first: Sequence[Feature], others: Sequence[Array]) -> _Heard:
    """The walls among the features of the scan's own disc, and those that the others heard."""
    own = [(f.bearing_rad, f.range_m, f.sweep_rad, f.width_rad) for f in first if f.kind is FeatureKind.WALL]
    found = [np.array(own, dtype=float).reshape(-1, 4), *others]
    counts = [len(walls) for walls in found]
    beside = [aside(disc.pose_sonar_in_robot) for disc in (scan, *scan.others)]
    bearing, depth, sweep, width = np.ascontiguousarray(np.concatenate(found).T)
    disc = np.repeat(np.arange(len(found)), counts)
    return _Heard(disc, bearing, depth, sweep, width, np.repeat(beside, counts))


@cache
def aside(mount: Pose) -> float:
    """How far the axis of a disc passes from the turning axis, to its left, [m]."""
    return mount.y * math.cos(mount.heading) - mount.x * math.sin(mount.heading)


def _things(heard: _Heard, config: AgreementConfig) -> list[np.ndarray]:
    """Rows of each thing that enough discs heard, one row a disc."""
    distance = np.full((len(heard.disc), len(heard.disc)), np.inf)
    _compare(heard.bearing, heard.range, config.bearing_rad, config.range_m, distance)
    return agreeing(distance, heard.disc, heard.bearing, config.discs_min)


def agreeing(distance: Array, disc: NDArray[np.int64], order: Array, least: int) -> list[np.ndarray]:
    """Rows of each thing that enough discs heard, one row a disc: what most discs heard first, then the closest.

    Args:
        distance: between what was heard, inf where it cannot be one thing, shape (n, n); is used up.
        disc: which one heard it, rising, shape (n,).
        order: decides between equals, the least first, shape (n,).
        least: how many discs must agree.
    """
    n = len(disc)
    members, ends = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    count = _group(distance, disc, order, least, members, ends)
    return np.split(members[: ends[count - 1]], ends[: count - 1]) if count else []


@kernel
def _compare(bearing, depth, bearing_rad, range_m, distance):  # type: ignore[no-untyped-def]
    """How unlike walls are in bearing and range, where they are alike enough."""
    for i in range(len(bearing)):
        for j in range(len(bearing)):
            off = math.pi - (math.pi - (bearing[i] - bearing[j])) % (2.0 * math.pi)
            turned, farther = abs(off) / bearing_rad, abs(depth[i] - depth[j]) / range_m
            if turned <= 1.0 and farther <= 1.0:
                distance[i, j] = turned + farther


@kernel
def _group(distance, disc, order, least_discs, members, ends):  # type: ignore[no-untyped-def]
    """The rows of one thing after the other into `members`, where each one's end into `ends`; how many things."""
    n = len(disc)
    discs = disc[n - 1] + 1 if n else 0
    nearest, best = np.empty(discs, dtype=np.int64), np.empty(discs, dtype=np.int64)
    things = used = 0
    while True:
        most, least, seed = 0, np.inf, -1
        for i in range(n):
            count, spread = _nearest(distance[i], disc, nearest)
            spread = np.rint(spread * 1e9) / 1e9
            closer = seed < 0 or spread < least or (spread == least and order[i] < order[seed])
            if count > most or (count == most and closer):
                most, least, seed = count, spread, i
        if seed < 0 or most < least_discs:
            return things
        _nearest(distance[seed], disc, best)
        for k in range(discs):
            if best[k] >= 0:
                members[used] = best[k]
                used += 1
                for i in range(n):
                    distance[best[k], i] = distance[i, best[k]] = np.inf
        ends[things] = used
        things += 1


@inner_kernel
def _nearest(distance, disc, nearest):  # type: ignore[no-untyped-def]
    """The nearest row of each disc, -1 where all are far: of how many discs, and the sum of their distances."""
    for k in range(len(nearest)):
        nearest[k] = -1
    for i in range(len(distance)):
        at = nearest[disc[i]]
        if distance[i] < (distance[at] if at >= 0 else np.inf):
            nearest[disc[i]] = i
    count, spread = 0, 0.0
    for k in range(len(nearest)):
        if nearest[k] >= 0:
            count += 1
            spread += distance[nearest[k]]
    return count, spread


def _unwrapped(thing: _Heard) -> _Heard:
    """With bearings that do not jump at half a turn."""
    bearing = thing.bearing[0] + wrap_angle(thing.bearing - thing.bearing[0])
    return replace(thing, bearing=bearing)


def _feature(
    thing: _Heard, first: Sequence[Feature], config: FeatureConfig, agreement: AgreementConfig
) -> Feature:
    """The wall or the point that all of these heard."""
    depth = _mean(thing.range)
    beside = thing.aside / depth
    middle = _mean(beside)
    lever = beside - middle
    scatter = float(lever @ lever)
    share = float(lever @ thing.bearing) / scatter if scatter > 1e-9 else 0.0
    bearing, width = _mean(thing.bearing), _mean(thing.width)
    kind = FeatureKind.WALL
    if abs(share) > agreement.point_share:
        kind, bearing = FeatureKind.EDGE, bearing - share * middle
    own = [f for f in first if f.kind is FeatureKind.WALL and _near(f, bearing, depth, agreement)]
    return Feature(
        kind=kind,
        bearing_rad=wrap_angle(bearing),
        range_m=depth,
        width_rad=width,
        segment=tangent(kind, bearing, depth, width, config),
        readings=own[0].readings if own else (),
        sweep_rad=_mean(thing.sweep),
        discs=len(thing.disc),
    )


def _near(feature: Feature, bearing: float, depth: float, config: AgreementConfig) -> bool:
    return (
        abs(wrap_angle(feature.bearing_rad - bearing)) <= config.bearing_rad
        and abs(feature.range_m - depth) <= config.range_m
    )


def turn_error(heard: Sequence[tuple[Array, Array]], noise_rad: float) -> TurnError | None:
    """Least squares over what several discs heard: each has one bearing, less the error times the turn by then.

    Args:
        heard: how far the robot had turned when each disc heard it, and at what bearing, shape (n,) both, [rad].
        noise_rad: standard deviation of one disc's bearing, [rad].
    """
    swept = [sweep - _mean(sweep) for sweep, _ in heard]
    pull = sum(float(sweep @ bearing) for sweep, (_, bearing) in zip(swept, heard, strict=True))
    weight = sum(float((sweep**2).sum()) for sweep in swept)
    if weight <= 0.0:
        return None
    return TurnError(-pull / weight, noise_rad / math.sqrt(weight))


def _mean(values: Array) -> float:
    """`values.mean()`, without its overhead."""
    return float(np.add.reduce(values)) / len(values)
