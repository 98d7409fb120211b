"""Feature association: a new wall meets the links of existing chains (section III.B, READING section 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.features import Feature, FeatureKind

MAX_LINE_DISTANCE_M = 0.20  # d1, section III.B
MAX_END_GAP_M = 0.50  # d2, section III.B
MAX_ANGLE_RAD = math.radians(20.0)  # a1, section III.B
TIE = 1e9  # distances equal to a nanometre are a tie: which link is closest must not hang on the last bit


@dataclass(frozen=True)
class AssociationConfig:
    """The gates of section III.B."""

    line_distance_max_m: float = MAX_LINE_DISTANCE_M
    """d1: mean distance of both ends and the middle of the feature from the link's line, [m]."""
    end_gap_max_m: float = MAX_END_GAP_M
    """d2: between the nearest ends, only where the two do not overlap, [m]."""
    angle_max_rad: float = MAX_ANGLE_RAD
    """a1: between the two lines, [rad]."""
    facing: bool = False
    """Beyond the paper: a wall is heard from one side, and is not what is heard of its other side."""


@dataclass(frozen=True)
class Association:
    """One edge of the initial link graph: a feature of this scan and the closest link of one chain."""

    feature: int
    """Index among the scan's features."""
    chain: int
    """Id of the chain."""
    link: int
    """Index of the closest link in its chain, when the association was made."""
    line_distance_m: float
    """d1, [m]."""
    end_gap_m: float
    """d2, [m]; 0 where the two overlap."""
    angle_rad: float
    """a1, signed from the feature to the link, [rad]."""


def associate(
    pose_robot_in_map: Pose, features: Sequence[Feature], chains: ChainMap, config: AssociationConfig
) -> tuple[Association, ...]:
    """At most one association for each wall and chain, ordered by feature, then chain.

    The closest link stands for its chain: smallest d1, then d2, then angle, then the older link. A feature
    may meet several chains (section III.G). Chains hold earlier scans alone: features of one scan never meet.
    """
    walls = [i for i, feature in enumerate(features) if feature.kind is FeatureKind.WALL]
    if not walls or not len(chains):
        return ()
    measured, placed = np.array([features[i].segment.as_row() for i in walls]), np.empty((len(walls), 4))
    pose, links, owners = pose_robot_in_map, chains.segments, chains.owners
    # Both ends within the first gate of a line are within three times its width (the mean of ends and middle), so
    # where the two overlap they come that close, and where they do not, as close as the second gate.
    reach = max(3.0 * config.line_distance_max_m, config.end_gap_max_m) + 1e-6
    near, rises = _near(measured, pose.x, pose.y, pose.heading, reach, links, placed)
    if not len(near):
        return ()
    angles, most = np.arctan2(rises[0], rises[1]), len(walls) * len(near)
    found, gaps = np.empty((most, 2), dtype=np.intp), np.empty((most, 3))
    count = _meet(placed, near, angles, links, owners, _gates(config), found, gaps)
    return tuple(
        Association(walls[wall], *owners[row, :2].tolist(), *gap)
        for (wall, row), gap in zip(found[:count].tolist(), gaps[:count].tolist(), strict=True)
    )


@lru_cache(maxsize=4)
def _gates(config: AssociationConfig) -> Array:
    """As the kernel takes them."""
    return np.array(
        [config.line_distance_max_m, config.end_gap_max_m, config.angle_max_rad, config.facing], dtype=float
    )


@kernel
def _near(measured, x, y, heading, reach, links, placed):  # type: ignore[no-untyped-def]
    """Segments of a scan are `placed` by its pose; the rows of the links whose boxes come this near to theirs, rising,
    and what each segment and then each of these links rises by in y, and in x."""
    c, s = math.cos(heading), math.sin(heading)
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for i in range(len(measured)):
        for k in (0, 2):
            px = x + c * measured[i, k] - s * measured[i, k + 1]
            py = y + s * measured[i, k] + c * measured[i, k + 1]
            placed[i, k], placed[i, k + 1] = px, py
            x0, y0, x1, y1 = min(x0, px), min(y0, py), max(x1, px), max(y1, py)
    x0, y0, x1, y1 = x0 - reach, y0 - reach, x1 + reach, y1 + reach
    n, rows = 0, np.empty(len(links), dtype=np.int64)
    for i in range(len(links)):
        ax, ay, bx, by = links[i, 0], links[i, 1], links[i, 2], links[i, 3]
        if (ax < x0 and bx < x0) or (ax > x1 and bx > x1) or (ay < y0 and by < y0) or (ay > y1 and by > y1):
            continue
        rows[n] = i
        n += 1
    m, rises = len(placed), np.empty((2, len(placed) + n))
    for i in range(m + n):
        segment = placed[i] if i < m else links[rows[i - m]]
        rises[0, i], rises[1, i] = segment[3] - segment[1], segment[2] - segment[0]
    return rows[:n].copy(), rises


@kernel
def _meet(walls, near, angles, links, owners, gates, found, gaps):  # type: ignore[no-untyped-def]
    """Wall and row of the link of each association into `found`, d1, d2 and a1 into `gaps`: how many.

    Args:
        near: rows of the links that are looked at.
        angles: of the walls, then of these links.
    """
    along = np.empty((len(near), 3))
    for j in range(len(near)):
        link, angle = links[near[j]], angles[len(walls) + j]
        along[j, 0], along[j, 1] = math.cos(angle), math.sin(angle)
        along[j, 2] = np.hypot(link[2] - link[0], link[3] - link[1])
    count = 0
    for i in range(len(walls)):
        first = count
        for j in range(len(near)):
            turn = angles[len(walls) + j] - angles[i]
            angle = math.pi / 2 - (math.pi / 2 - turn) % math.pi
            if abs(angle) > gates[2] or (gates[3] and not math.cos(turn) > 0.0):
                continue
            line_distance, end_gap = _gaps(walls[i], links[near[j]], along[j])
            if not (line_distance <= gates[0] and end_gap <= gates[1]):
                continue
            at = first
            while at < count and owners[found[at, 1], 0] < owners[near[j], 0]:
                at += 1
            if at < count and owners[found[at, 1], 0] == owners[near[j], 0]:
                if not _closer(line_distance, end_gap, angle, gaps[at]):
                    continue
            else:
                for k in range(count, at, -1):
                    found[k, 0], found[k, 1] = found[k - 1, 0], found[k - 1, 1]
                    gaps[k, 0], gaps[k, 1], gaps[k, 2] = gaps[k - 1, 0], gaps[k - 1, 1], gaps[k - 1, 2]
                count += 1
            found[at, 0], found[at, 1] = i, near[j]
            gaps[at, 0], gaps[at, 1], gaps[at, 2] = line_distance, end_gap, angle
    return count


@inner_kernel
def _gaps(wall, link, along):  # type: ignore[no-untyped-def]
    """d1 and d2 of a wall and a link of this direction and length."""
    c, s, length = along[0], along[1], along[2]
    dx1, dy1, dx2, dy2 = wall[0] - link[0], wall[1] - link[1], wall[2] - link[0], wall[3] - link[1]
    across1, across2 = dy1 * c - dx1 * s, dy2 * c - dx2 * s
    at1, at2 = dx1 * c + dy1 * s, dx2 * c + dy2 * s
    end_gap = 0.0
    if not (max(at1, at2) >= 0.0 and min(at1, at2) <= length):
        first = min(np.hypot(at1, across1), np.hypot(at1 - length, across1))
        end_gap = min(first, np.hypot(at2, across2), np.hypot(at2 - length, across2))
    return (abs(across1) + abs(across2) + 0.5 * abs(across1 + across2)) / 3.0, end_gap


@inner_kernel
def _closer(line_distance, end_gap, angle, gaps):  # type: ignore[no-untyped-def]
    """Whether a link is closer than one before it, which has these gaps."""
    for one, other in ((line_distance, gaps[0]), (end_gap, gaps[1]), (abs(angle), abs(gaps[2]))):
        apart = np.rint(one * TIE) - np.rint(other * TIE)
        if apart != 0.0:
            return apart < 0.0
    return False
