"""Edges, corners and columns that pass for walls, told by how they answer two scan positions (beyond the paper).

When the robot moves along a wall, the foot of the normal moves with it and the normal keeps its direction.
When it moves past an edge, a corner or a thin column, the foot stays and the normal turns about it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam.association import Association
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.features import Feature


@dataclass(frozen=True)
class TurningConfig:
    """When a foot has stayed behind."""

    enabled: bool = False
    """The paper leaves this to the link graph."""
    moved_m: float = 0.20
    """Least way along the wall between the two positions, [m]; less tells nothing."""
    share: float = 0.5
    """A foot that went less than this share of that way belongs to no wall."""


def follows_the_wall(
    pose_robot_in_map: Pose,
    features: Sequence[Feature],
    associations: Sequence[Association],
    chains: ChainMap,
    pose_of_scan: Callable[[int], Pose],
    config: TurningConfig,
) -> NDArray[np.bool_]:
    """Which associations may be of one wall seen twice, shape (n,)."""
    if not config.enabled:
        return np.ones(len(associations), dtype=bool)
    verdicts = []
    for a in associations:
        row = chains.row(a.chain, a.link)
        link, scan = Segment(*chains.segments[row].tolist()), int(chains.scan_indices[row])
        verdicts.append(_follows(pose_robot_in_map, features[a.feature], link, pose_of_scan(scan), config))
    return np.array(verdicts, dtype=bool)


def _follows(pose: Pose, feature: Feature, link: Segment, link_pose: Pose, config: TurningConfig) -> bool:
    along_x, along_y = math.cos(link.direction), math.sin(link.direction)
    robot = (pose.x - link_pose.x) * along_x + (pose.y - link_pose.y) * along_y
    if abs(robot) < config.moved_m:
        return True
    x, y = link.midpoint
    bearing = pose.heading + feature.bearing_rad
    foot_x = pose.x + feature.range_m * math.cos(bearing)
    foot_y = pose.y + feature.range_m * math.sin(bearing)
    foot = (foot_x - x) * along_x + (foot_y - y) * along_y
    return foot / robot >= config.share
