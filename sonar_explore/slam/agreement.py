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
from dataclasses import dataclass, field, replace

import numpy as np

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.discs import TurnError, agreeing, aside, mean, turn_error
from sonar_explore.slam.features import (
    Feature,
    FeatureConfig,
    FeatureKind,
    extract_features,
    tangent,
)
from sonar_explore.slam.heard import walls_heard
from sonar_explore.slam.points import Point, PointConfig, points_of


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
    others = [
        f
        for f in first
        if f.kind is not FeatureKind.WALL
        and not any(_near(f, a.bearing_rad, a.range_m, agreement) for a in agreed)
    ]
    features = tuple(sorted([*agreed, *others], key=lambda feature: feature.bearing_rad))
    points, swept = points_of(scan, config, agreement.points)
    turn = turn_error([*((w.sweep, w.bearing) for w in walls), *swept], agreement.noise_rad)
    return Extraction(features, points, turn)


def _heard(scan: Scan, first: Sequence[Feature], others: Sequence[Array]) -> _Heard:
    """The walls among the features of the scan's own disc, and those that the others heard."""
    own = [(f.bearing_rad, f.range_m, f.sweep_rad, f.width_rad) for f in first if f.kind is FeatureKind.WALL]
    found = [np.array(own, dtype=float).reshape(-1, 4), *others]
    counts = [len(walls) for walls in found]
    beside = [aside(disc.pose_sonar_in_robot) for disc in (scan, *scan.others)]
    bearing, depth, sweep, width = np.ascontiguousarray(np.concatenate(found).T)
    disc = np.repeat(np.arange(len(found)), counts)
    return _Heard(disc, bearing, depth, sweep, width, np.repeat(beside, counts))


def _things(heard: _Heard, config: AgreementConfig) -> list[np.ndarray]:
    """Rows of each thing that enough discs heard, one row a disc."""
    distance = np.full((len(heard.disc), len(heard.disc)), np.inf)
    _compare(heard.bearing, heard.range, config.bearing_rad, config.range_m, distance)
    return agreeing(distance, heard.disc, heard.bearing, config.discs_min)


@kernel
def _compare(bearing, depth, bearing_rad, range_m, distance):  # type: ignore[no-untyped-def]
    """How unlike walls are in bearing and range, where they are alike enough."""
    for i in range(len(bearing)):
        for j in range(len(bearing)):
            off = math.pi - (math.pi - (bearing[i] - bearing[j])) % (2.0 * math.pi)
            turned, farther = abs(off) / bearing_rad, abs(depth[i] - depth[j]) / range_m
            if turned <= 1.0 and farther <= 1.0:
                distance[i, j] = turned + farther


def _unwrapped(thing: _Heard) -> _Heard:
    """With bearings that do not jump at half a turn."""
    bearing = thing.bearing[0] + wrap_angle(thing.bearing - thing.bearing[0])
    return replace(thing, bearing=bearing)


def _feature(
    thing: _Heard, first: Sequence[Feature], config: FeatureConfig, agreement: AgreementConfig
) -> Feature:
    """The wall or the point that all of these heard."""
    depth = mean(thing.range)
    beside = thing.aside / depth
    middle = mean(beside)
    lever = beside - middle
    scatter = float(lever @ lever)
    share = float(lever @ thing.bearing) / scatter if scatter > 1e-9 else 0.0
    bearing, width = mean(thing.bearing), mean(thing.width)
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
        sweep_rad=mean(thing.sweep),
        discs=len(thing.disc),
    )


def _near(feature: Feature, bearing: float, depth: float, config: AgreementConfig) -> bool:
    return (
        abs(wrap_angle(feature.bearing_rad - bearing)) <= config.bearing_rad
        and abs(feature.range_m - depth) <= config.range_m
    )
