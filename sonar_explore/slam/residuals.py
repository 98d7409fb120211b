"""ADR and NDR: how far each associated feature lies from the root of its chain (sections III.C and III.F).

Association asks the nearest link, correction asks the root: roots are older, and nearer the truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, lean_kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.association import Association
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.features import Feature


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

    @classmethod
    def empty(cls, n: int) -> Residuals:
        """Of n associations, to be filled in."""
        one = [np.empty(n) for _ in range(6)]
        return cls(one[0], one[1], np.empty((n, 2)), one[2], np.empty((n, 2)), *one[3:])

    def only(self, chosen: NDArray[np.bool_]) -> Residuals:
        """Those of the associations chosen, shape (n,)."""
        if chosen.all():
            return self
        rows = np.flatnonzero(chosen)
        return Residuals(
            *(self.adr_rad[rows], self.ndr_m[rows], self.normals[rows]),
            *(self.link_ndr_m[rows], self.link_normals[rows]),
            *(self.root_probability[rows], self.range_m[rows], self.discs[rows]),
        )


def residuals_to_lines(
    pose_robot_in_map: Pose,
    features: Sequence[Feature],
    associations: Sequence[Association],
    chains: ChainMap,
    roots: Array,
) -> Residuals:
    """ADR and NDR of every association, to these lines in the place of the roots, shape (n, 4), [m]."""
    n, pose = len(associations), pose_robot_in_map
    found, links = Residuals.empty(n), np.empty((n, 4))
    bearings = np.empty(n)
    for i, a in enumerate(associations):
        feature = features[a.feature]
        links[i] = chains.segments[chains.row(a.chain, a.link)]
        bearings[i], found.range_m[i] = feature.bearing_rad, feature.range_m
        found.discs[i], found.root_probability[i] = feature.discs, chains.root_probability(a.chain)
    to_links = found.link_ndr_m, found.link_normals
    to_roots = found.adr_rad, found.ndr_m, found.normals
    place = pose.x, pose.y, pose.heading
    _offsets(*place, bearings, found.range_m, links, roots, *to_links, *to_roots)
    return found


@lean_kernel
def _offsets(x, y, heading, bearings, ranges, links, roots, link_ndr, link_normals, adr, ndr, normals):  # type: ignore[no-untyped-def]
    """To the lines of links and of roots."""
    _offsets_to(x, y, heading, bearings, ranges, links, adr, link_ndr, link_normals)
    _offsets_to(x, y, heading, bearings, ranges, roots, adr, ndr, normals)


@inner_kernel
def _offsets_to(x, y, heading, bearings, ranges, lines, angles, distances, normals):  # type: ignore[no-untyped-def]
    """Angle from each feature to its line [rad], signed normal distance once parallel to it [m], normal of the line."""
    for i in range(len(bearings)):
        direction = undirected(math.atan2(lines[i, 3] - lines[i, 1], lines[i, 2] - lines[i, 0]))
        in_map = heading + bearings[i]
        angles[i] = undirected(direction - (in_map + math.pi / 2))
        foot_x = x + ranges[i] * math.cos(in_map + angles[i])
        foot_y = y + ranges[i] * math.sin(in_map + angles[i])
        normals[i, 0], normals[i, 1] = -math.sin(direction), math.cos(direction)
        distances[i] = (foot_x - lines[i, 0]) * normals[i, 0] + (foot_y - lines[i, 1]) * normals[i, 1]


@inner_kernel
def undirected(angle):  # type: ignore[no-untyped-def]
    """`geometry.wrap_undirected`."""
    return math.pi / 2 - (math.pi / 2 - angle) % math.pi
