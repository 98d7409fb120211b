"""A scan as points for grids and scan matching: along its walls, the tangents of its regions of constant depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from sonar_explore.geometry import Array
from sonar_explore.slam.features import Feature, FeatureKind

SPACING_M = 0.10
"""Of the points along a wall feature, [m]."""


@dataclass(frozen=True, eq=False)
class EndPoints:
    """Points of one scan, robot frame; every array has shape (n,)."""

    bearing: Array
    """Direction of each point, [rad]."""
    range_m: Array
    """Its distance, [m]."""
    normal: Array
    """Direction that its wall faces, undirected, [rad]."""
    foot: Array
    """1 for the foot of the normal, the point that answered; 0 for the rest of the tangent."""
    weight: Array
    """How much each counts: the points of one wall count as one."""


def end_points(features: Sequence[Feature]) -> EndPoints:
    """The points of a scan's walls."""
    rows = []
    for feature in features:
        if feature.kind is not FeatureKind.WALL:
            continue
        count = round(0.5 * feature.segment.length / SPACING_M)
        for k in range(-count, count + 1):
            bearing = feature.bearing_rad + np.arctan2(k * SPACING_M, feature.range_m)
            range_m = np.hypot(feature.range_m, k * SPACING_M)
            rows.append((bearing, range_m, feature.bearing_rad, k == 0, 1.0 / (2 * count + 1)))
    return EndPoints(*np.array(rows, dtype=float).reshape(-1, 5).T)


def placed(points: EndPoints, poses: Array) -> tuple[Array, Array]:
    """Points as seen from several poses, shape (k, 3), x, y [m], heading [rad].

    Returns:
        x y of the points, shape (k, n, 2), [m], and the directions their walls face, shape (k, n), [rad].
    """
    direction = poses[:, 2:] + points.bearing
    x = poses[:, :1] + points.range_m * np.cos(direction)
    y = poses[:, 1:2] + points.range_m * np.sin(direction)
    return np.stack([x, y], axis=-1), poses[:, 2:] + points.normal


def feet_of(points: EndPoints) -> EndPoints:
    """The feet of the normals alone: one point a wall, for what counts each point in full."""
    rows = points.foot > 0.0
    return EndPoints(*(getattr(points, item.name)[rows] for item in fields(points)))
