"""How sure an association is (section III.D), and how sure a new root (section III.E); READING section 7."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonar_explore.geometry import Array
from sonar_explore.slam.association import Association

DOOR_WIDTH_M = 0.80  # d_w of figure 10(a); the value is READING's
DISTANCE_ZERO_M = 0.50  # figure 10(a)
CLUSTER_HALF_WIDTH_RAD = math.radians(5.0)  # figure 10(b)
FIRST_ROOT_PROBABILITY = 1.0  # P(root_of_first_scan), section III.A
DANGLING_SHARE = 0.5  # section III.E, case (b)


@dataclass(frozen=True)
class ProbabilityConfig:
    """The shapes of figures 10(a) and 10(b)."""

    door_width_m: float = DOOR_WIDTH_M
    """d_w: P(dist) is 1 up to half of it, [m]."""
    distance_zero_m: float = DISTANCE_ZERO_M
    """P(dist) is 0 from here on, [m]."""
    cluster_half_width_rad: float = CLUSTER_HALF_WIDTH_RAD
    """Members of a cluster stay this close to its mean; P(ang) is 0 there, [rad]."""


def clusters(adr_rad: Array, half_width_rad: float) -> tuple[tuple[int, ...], ...]:
    """Group signed ADR so that members stay within `half_width_rad` of their group's mean.

    The largest group is taken first, ties by the smaller spread. Each group is a tuple of indices.
    """
    off = adr_rad.tolist()
    left, groups = sorted(range(len(off)), key=off.__getitem__), []
    while left:
        first, length = _largest_window([off[i] for i in left], half_width_rad + 1e-12)
        groups.append(tuple(left[first : first + length]))
        del left[first : first + length]
    return tuple(groups)


def _largest_window(rising: list[float], half_width: float) -> tuple[int, int]:
    """First and length of the longest run of rising values within `half_width` of their mean; ties by the spread."""
    for length in range(len(rising), 1, -1):
        fitting = [
            (round(rising[i + length - 1] - rising[i], 12), i)
            for i in range(len(rising) - length + 1)
            if _reach(rising[i : i + length]) <= half_width
        ]
        if fitting:
            return min(fitting)[1], length
    return 0, 1


def _reach(rising: list[float]) -> float:
    middle = _mean(rising)
    return max(abs(rising[0] - middle), abs(rising[-1] - middle))


def _mean(values: list[float]) -> float:
    """`np.mean(values)`, without its overhead where they are few."""
    if len(values) >= 8:
        return float(np.mean(values))
    total = 0.0
    for value in values:
        total += value
    return total / len(values)


def p_distance(end_gap_m: float | Sequence[float], config: ProbabilityConfig) -> Array:
    """P(dist), figure 10(a), of each gap: 1 up to half a door, then linear to 0."""
    half_door = 0.5 * config.door_width_m
    return np.asarray(np.interp(end_gap_m, [half_door, config.distance_zero_m], [1.0, 0.0]))


def p_angle(off_mean_rad: float, config: ProbabilityConfig) -> float:
    """P(ang), figure 10(b): a triangle about the cluster's mean."""
    return max(0.0, 1.0 - abs(off_mean_rad) / config.cluster_half_width_rad)


def association_probabilities(
    kept: Sequence[Association], adr_rad: Array, config: ProbabilityConfig
) -> Array:
    """P(association) of each edge of the final link graph, equations (1) and (2), shape (n,).

    Equation (2) is the union of P(cluster), P(dist) and P(ang).
    """
    probabilities, off = [0.0] * len(kept), adr_rad.tolist()
    p_dist = p_distance([association.end_gap_m for association in kept], config).tolist()
    for group in clusters(adr_rad, config.cluster_half_width_rad):
        p_cluster = len(group) / len(kept)  # equation (1)
        middle = _mean([off[i] for i in group])
        for i in group:
            p_ang = p_angle(off[i] - middle, config)
            probabilities[i] = 1.0 - (1.0 - p_cluster) * (1.0 - p_dist[i]) * (1.0 - p_ang)
    return np.array(probabilities)


@dataclass(frozen=True)
class RootCertainty:
    """P(new root) for the features of one scan that no chain holds (section III.E)."""

    probability: float
    """P(root) of the chains that this scan roots."""
    dangling: bool
    """Case (b): no feature of the scan was associated."""
    latest_case_a: float
    """The most recent value of equation (3): case (b) halves this one, so that it does not compound."""

    @classmethod
    def of_first_scan(cls) -> RootCertainty:
        """Section III.A."""
        return cls(FIRST_ROOT_PROBABILITY, False, FIRST_ROOT_PROBABILITY)

    def after(self, kept_root_probability: Array) -> RootCertainty:
        """The certainty of the next scan, given P(root) of its surviving associations, shape (n,)."""
        if len(kept_root_probability):
            mean = _mean(kept_root_probability.tolist())  # equation (3)
            return RootCertainty(mean, False, mean)
        return RootCertainty(DANGLING_SHARE * self.latest_case_a, True, self.latest_case_a)
