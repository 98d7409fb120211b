"""Iterative closest points, point to line, of sonar scans (after Censi 2008 and Burguera et al. 2009).

A scan's points are those along its walls: the tangents of its regions of constant depth, which turn with the robot,
so that a point brings a direction along. A point is matched with the line through the points of past scans
about it that face as it does; the odometry since the last scan is a prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sonar_explore.geometry import Array, Pose, wrap_undirected
from sonar_explore.slam.baselines.end_points import EndPoints, placed

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


@dataclass(frozen=True)
class ScanMatchConfig:
    """What is matched with what, and how much it counts."""

    reach_m: float = 0.80
    """Points farther apart are not of one wall, [m]."""
    angle_rad: float = math.radians(6.0)
    """Nor are points whose walls face differently by more, [rad]."""
    distance_m: float = 0.02
    """Standard deviation of a wall's points from the line they are matched with, [m]."""
    facing_rad: float = math.radians(0.5)
    """Standard deviation of a wall's direction from that line's, [rad]."""
    neighbours: int = 30
    """Past points that a line is made of, at most."""
    rounds: int = 20
    """Of matching anew and moving, at most."""


class PastScans:
    """The points of all scans so far, where they are now taken to be."""

    def __init__(self, config: ScanMatchConfig) -> None:
        self._config = config
        self._xy: Array = np.zeros((0, 2))
        self._normals: Array = np.zeros(0)

    def add(self, pose: Pose, points: EndPoints) -> None:
        """Keep a scan where it was matched."""
        xy, normals = placed(points, np.array([[pose.x, pose.y, pose.heading]]))
        self._xy = np.vstack([self._xy, xy[0]])
        self._normals = np.concatenate([self._normals, normals[0]])

    def match(self, predicted: Pose, spread: Array, points: EndPoints) -> Pose:
        """The pose that fits the points best.

        Args:
            spread: covariance of the predicted pose, x y heading, map frame, shape (3, 3).
        """
        if not len(self._xy) or not len(points.range_m):
            return predicted
        from scipy.spatial import cKDTree  # here: 6 MB that no other SLAM needs

        tree, prior = cKDTree(self._xy), np.linalg.inv(spread + np.diag([1e-6, 1e-6, 1e-8]))
        start = np.array([predicted.x, predicted.y, predicted.heading])
        pose = start.copy()
        for _ in range(self._config.rounds):
            step = self._step(tree, prior, start, pose, points)
            pose = pose + step
            if np.abs(step).max() < 1e-4:
                break
        return Pose(*map(float, pose))

    def _step(self, tree: cKDTree, prior: Array, start: Array, pose: Array, points: EndPoints) -> Array:
        cfg = self._config
        xy, normals = (a[0] for a in placed(points, pose[None]))
        mean, facing, found = self._lines(tree, xy, normals)
        c, s = np.cos(facing), np.sin(facing)
        off = (xy - mean)[:, 0] * c + (xy - mean)[:, 1] * s
        turn = wrap_undirected(normals - facing)
        arm = (xy[:, 1] - pose[1]) * -c + (xy[:, 0] - pose[0]) * s
        squared = (off / cfg.distance_m) ** 2 + (turn / cfg.facing_rad) ** 2
        weight = np.where(found, points.weight / (1.0 + squared / 4.0), 0.0)  # Cauchy
        by_distance = np.column_stack([c, s, arm]) / cfg.distance_m
        by_facing = np.column_stack([np.zeros_like(c), np.zeros_like(c), np.ones_like(c)]) / cfg.facing_rad
        jacobian = np.vstack([by_distance, by_facing])
        residual = np.concatenate([off / cfg.distance_m, turn / cfg.facing_rad])
        pull = jacobian.T * np.tile(weight, 2)
        return np.asarray(
            np.linalg.solve(pull @ jacobian + prior, -(pull @ residual + prior @ (pose - start)))
        )

    def _lines(self, tree: cKDTree, xy: Array, normals: Array) -> tuple[Array, Array, Array]:
        """For each point the line of the past: a point on it, its normal, and whether there is one."""
        cfg = self._config
        near, index = tree.query(xy, k=cfg.neighbours, distance_upper_bound=cfg.reach_m)
        known = np.isfinite(near)
        index = np.where(known, index, 0)
        alike = known & (np.abs(wrap_undirected(self._normals[index] - normals[:, None])) <= cfg.angle_rad)
        share = alike / np.maximum(alike.sum(axis=1, keepdims=True), 1)
        mean = (share[..., None] * self._xy[index]).sum(axis=1)
        doubled = 2.0 * self._normals[index]
        facing = 0.5 * np.arctan2(
            (share * np.sin(doubled)).sum(axis=1), (share * np.cos(doubled)).sum(axis=1)
        )
        return mean, facing, alike.any(axis=1)


def turned(covariance: Array, heading: float) -> Array:
    """Of x, y and heading in a frame that is turned, shape (3, 3): in the frame that holds it."""
    c, s = math.cos(heading), math.sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ covariance @ turn.T)
