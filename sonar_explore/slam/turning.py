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

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.association import Association
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.features import Feature
from sonar_explore.slam.residuals import undirected


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
    poses_of: Callable[[NDArray[np.intp]], Array],
    config: TurningConfig,
) -> NDArray[np.bool_]:
    """Which associations may be of one wall seen twice, shape (n,).

    Args:
        poses_of: x, y [m], heading [rad] of the scans of these indices, shape (n,), as rows.
    """
    out = np.ones(len(associations), dtype=bool)
    if not config.enabled or not associations:
        return out
    rows = [chains.row(a.chain, a.link) for a in associations]
    heard = [(features[a.feature].bearing_rad, features[a.feature].range_m) for a in associations]
    pose, limits = pose_robot_in_map.as_row(), (config.moved_m, config.share)
    scans = chains.scan_indices[rows]
    _follow(pose, np.array(heard), chains.segments[rows], poses_of(scans), limits, out)
    return out


@lean_kernel
def _follow(pose, heard, links, link_poses, limits, out):  # type: ignore[no-untyped-def]
    """Whether the foot of each wall, heard at a bearing and range, went along with the robot since the link."""
    for i in range(len(links)):
        x1, y1, x2, y2 = links[i, 0], links[i, 1], links[i, 2], links[i, 3]
        direction = undirected(math.atan2(y2 - y1, x2 - x1))
        along_x, along_y = math.cos(direction), math.sin(direction)
        robot = (pose[0] - link_poses[i, 0]) * along_x + (pose[1] - link_poses[i, 1]) * along_y
        if abs(robot) < limits[0]:
            continue
        bearing = pose[2] + heard[i, 0]
        foot_x = pose[0] + heard[i, 1] * math.cos(bearing)
        foot_y = pose[1] + heard[i, 1] * math.sin(bearing)
        foot = (foot_x - 0.5 * (x1 + x2)) * along_x + (foot_y - 0.5 * (y1 + y2)) * along_y
        out[i] = foot / robot >= limits[1]
