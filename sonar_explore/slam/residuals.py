"""ADR and NDR: how far each associated feature lies from the root of its chain (sections III.C and III.F).

Association asks the nearest link, correction asks the root: roots are older, and nearer the truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose, Segment, wrap_undirected
from sonar_explore.slam.association import Association
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.features import Feature
from sonar_explore.slam.reference import ReferenceConfig, reference_line


@dataclass(frozen=True, eq=False)
class Residuals:
    """One entry for each association, in the map frame."""

    adr_rad: Array
    """Signed angle from the feature to the root of its chain, shape (n,), [rad]."""
    ndr_m: Array
    """Signed normal distance from the feature's middle to the root's line, after the feature alone was turned
    about the robot until parallel to the root, shape (n,), [m]."""
    normals: Array
    """Unit normal of the root's line: a shift s of the robot adds normal . s to NDR, shape (n, 2)."""
    link_ndr_m: Array
    """The same distance to the associated link's line, shape (n,), [m]."""
    link_normals: Array
    """Unit normal of the link's line, shape (n, 2)."""
    root_probability: Array
    """P(root), equation (3), shape (n,)."""
    range_m: Array
    """Distance of the feature from the robot, shape (n,), [m]."""
    discs: Array
    """How many discs agree on the feature, shape (n,)."""

    def only(self, chosen: NDArray[np.bool_]) -> Residuals:
        """Those of the associations chosen, shape (n,)."""
        return Residuals(**{item.name: getattr(self, item.name)[chosen] for item in fields(self)})


def residuals_to_roots(
    pose_robot_in_map: Pose,
    features: Sequence[Feature],
    associations: Sequence[Association],
    chains: ChainMap,
    reference: ReferenceConfig | None = None,
) -> Residuals:
    """ADR and NDR of every association, to the root or to what `reference` says instead."""
    seen = [features[a.feature] for a in associations]
    roots = [reference_line(chains[a.chain], reference or ReferenceConfig()) for a in associations]
    links = [chains[a.chain].links[a.link].segment for a in associations]
    to_root = [_offset(pose_robot_in_map, f, line) for f, line in zip(seen, roots, strict=True)]
    to_link = [_offset(pose_robot_in_map, f, line) for f, line in zip(seen, links, strict=True)]
    return Residuals(
        adr_rad=np.array([angle for angle, _ in to_root], dtype=float),
        ndr_m=np.array([distance for _, distance in to_root], dtype=float),
        normals=np.array([line.unit_normal for line in roots], dtype=float).reshape(-1, 2),
        link_ndr_m=np.array([distance for _, distance in to_link], dtype=float),
        link_normals=np.array([line.unit_normal for line in links], dtype=float).reshape(-1, 2),
        root_probability=np.array([chains[a.chain].root_probability for a in associations], dtype=float),
        range_m=np.array([feature.range_m for feature in seen], dtype=float),
        discs=np.array([feature.discs for feature in seen], dtype=float),
    )


def _offset(pose: Pose, feature: Feature, line: Segment) -> tuple[float, float]:
    """(angle to the line [rad], signed normal distance once parallel to it [m])."""
    normal_in_map = pose.heading + feature.bearing_rad
    angle = wrap_undirected(line.direction - (normal_in_map + math.pi / 2))
    x = pose.x + feature.range_m * math.cos(normal_in_map + angle)
    y = pose.y + feature.range_m * math.sin(normal_in_map + angle)
    return angle, line.signed_distance(x, y)
