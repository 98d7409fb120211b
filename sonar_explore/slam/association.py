"""Feature association: a new wall meets the links of existing chains (section III.B, READING section 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array, Pose, wrap_undirected
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.features import Feature, FeatureKind

MAX_LINE_DISTANCE_M = 0.20  # d1, section III.B
MAX_END_GAP_M = 0.50  # d2, section III.B
MAX_ANGLE_RAD = math.radians(20.0)  # a1, section III.B
TIE_DECIMALS = (
    9  # distances equal to a nanometre are a tie: which link is closest must not hang on the last bit
)


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


@dataclass(frozen=True, eq=False)
class _Gaps:
    """How features lie to links; every array has shape (features, links)."""

    line_distance: Array
    end_gap: Array
    angle: Array
    same_side: NDArray[np.bool_]
    """Whether both were heard from the same side: the segment of a wall runs to the left of who hears it."""


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
    segments = np.array([features[i].segment.transformed(pose_robot_in_map).as_row() for i in walls])
    near = _near_links(segments, chains.segments, config)
    gaps = _gaps(segments, chains.segments[near])
    chain_ids, link_indices = chains.chain_ids[near], chains.link_indices[near]
    rows, columns = np.nonzero(_inside_gates(gaps, config))
    return tuple(
        Association(
            feature=walls[row],
            chain=int(chain_ids[column]),
            link=int(link_indices[column]),
            line_distance_m=float(gaps.line_distance[row, column]),
            end_gap_m=float(gaps.end_gap[row, column]),
            angle_rad=float(gaps.angle[row, column]),
        )
        for row, column in _closest(gaps, rows, columns, chain_ids)
    )


def _near_links(features: Array, links: Array, config: AssociationConfig) -> NDArray[np.intp]:
    """Rows of the links that could pass the gates of any feature, rising: the others cost no more than a look.

    Both ends within the first gate of a line are within three times its width (the mean of ends and middle),
    so where the two overlap they come that close, and where they do not, as close as the second gate.
    """
    reach = max(3.0 * config.line_distance_max_m, config.end_gap_max_m) + 1e-6
    xy = features.reshape(-1, 2)
    (x0, y0), (x1, y1) = xy.min(axis=0) - reach, xy.max(axis=0) + reach
    rows = np.empty(len(links), dtype=np.intp)
    return rows[: _meeting_box(links, x0, y0, x1, y1, rows)]


@kernel
def _meeting_box(segments, x0, y0, x1, y1, rows):  # type: ignore[no-untyped-def]
    """Rows of the segments whose bounding box meets a box, into `rows`: how many."""
    n = 0
    for i in range(len(segments)):
        ax, ay, bx, by = segments[i, 0], segments[i, 1], segments[i, 2], segments[i, 3]
        if (ax < x0 and bx < x0) or (ax > x1 and bx > x1) or (ay < y0 and by < y0) or (ay > y1 and by > y1):
            continue
        rows[n] = i
        n += 1
    return n


def _gaps(features: Array, links: Array) -> _Gaps:
    """Compare segments (m, 4) with segments (n, 4)."""
    feature_angles = np.arctan2(features[:, 3] - features[:, 1], features[:, 2] - features[:, 0])
    link_angles = np.arctan2(links[:, 3] - links[:, 1], links[:, 2] - links[:, 0])
    along = np.stack([np.cos(link_angles), np.sin(link_angles)], axis=1)
    dx1, dy1 = (features[:, None, k] - links[None, :, k] for k in (0, 1))
    dx2, dy2 = features[:, None, 2] - links[None, :, 0], features[:, None, 3] - links[None, :, 1]
    across1 = dy1 * along[:, 0] - dx1 * along[:, 1]
    across2 = dy2 * along[:, 0] - dx2 * along[:, 1]
    at1 = dx1 * along[:, 0] + dy1 * along[:, 1]
    at2 = dx2 * along[:, 0] + dy2 * along[:, 1]
    lengths = np.hypot(links[:, 2] - links[:, 0], links[:, 3] - links[:, 1])
    overlap = (np.maximum(at1, at2) >= 0.0) & (np.minimum(at1, at2) <= lengths)
    ends = [
        np.hypot(at - end, across)
        for at, across in ((at1, across1), (at2, across2))
        for end in (0.0, lengths)
    ]
    return _Gaps(
        line_distance=(np.abs(across1) + np.abs(across2) + 0.5 * np.abs(across1 + across2)) / 3.0,
        end_gap=np.where(overlap, 0.0, np.minimum.reduce(ends)),
        angle=wrap_undirected(link_angles[None, :] - feature_angles[:, None]),
        same_side=np.cos(link_angles[None, :] - feature_angles[:, None]) > 0.0,
    )


def _inside_gates(gaps: _Gaps, config: AssociationConfig) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (
        (gaps.line_distance <= config.line_distance_max_m)
        & (gaps.end_gap <= config.end_gap_max_m)
        & (np.abs(gaps.angle) <= config.angle_max_rad)
    )
    return inside & gaps.same_side if config.facing else inside


def _closest(
    gaps: _Gaps, rows: NDArray[np.intp], columns: NDArray[np.intp], chain_ids: NDArray[np.intp]
) -> list[tuple[int, int]]:
    """The (feature row, link column) that stands for each feature and chain."""
    keys = [
        np.abs(gap[rows, columns]).round(TIE_DECIMALS)
        for gap in (gaps.angle, gaps.end_gap, gaps.line_distance)
    ]
    order = np.lexsort((columns, *keys, chain_ids[columns], rows))
    best: dict[tuple[int, int], tuple[int, int]] = {}
    for row, column in zip(rows[order], columns[order], strict=True):
        best.setdefault((int(row), int(chain_ids[column])), (int(row), int(column)))
    return list(best.values())
