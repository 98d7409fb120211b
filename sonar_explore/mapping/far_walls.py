"""Walls from farther off than SLAM relies on: from across a room, a scan hears what those beside the wall slip past.

A wall is sure only about the feet of normals, and only scans within reliable range find any. A plane sends its echo
back from farther off, too, and where discs agree on it that is seldom anything else. It tells that nothing behind was
seen, and that no door is there; it is not good enough to drive by, and not one of SLAM's walls.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonar_explore.geometry import Array
from sonar_explore.measurement import Scan
from sonar_explore.slam import SlamConfig
from sonar_explore.slam.turn.agreement import walls_heard

DISCS = 2  # so many agree, where several listen
HALF_LENGTH_M = 0.12  # of the piece about the foot


def far_walls(scan: Scan, slam: SlamConfig, farthest_m: float) -> Array:
    """Pieces of wall beyond the reliable range, in the robot frame of the scan, shape (n, 4), [m].

    Args:
        scan: what all discs heard.
        slam: how walls are told; its reliable range ends where these begin.
        farthest_m: what is farther off is left out, [m].
    """
    reliable_m = slam.features.range_max_m
    if farthest_m <= reliable_m:
        return np.zeros((0, 4))
    agreement = replace(slam.agreement, discs_min=min(DISCS, slam.agreement.discs_min))
    feet = walls_heard(scan, replace(slam.features, range_max_m=farthest_m), agreement)
    feet = feet[feet[:, 0] > reliable_m]
    range_m, bearing = feet[:, :1], feet[:, 1]
    normals = np.column_stack([np.cos(bearing), np.sin(bearing)])
    along = HALF_LENGTH_M * np.column_stack([normals[:, 1], -normals[:, 0]])
    return np.hstack([range_m * normals + along, range_m * normals - along])
