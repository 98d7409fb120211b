"""Local localization: first the heading, then the position (section III.F, READING section 8)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.residuals import Residuals

NEAR_M, NEAR_WEIGHT = 0.20, 0.9  # w3, figure 11
FAR_M, FAR_WEIGHT = 2.00, 0.3  # w3, figure 11
ASSOCIATION_SHARE = 0.5  # w2 = P(association) / 2, section III.F
TIE = 1e-9  # costs closer than this share of the total weight are equal


@dataclass(frozen=True)
class LocalizationConfig:
    """What may be corrected."""

    min_consensus: int = 1
    """Where several associations were found but fewer than this survive, correct nothing. 1 is the paper."""
    turn_max_rad: float = math.pi / 2
    """A correction that turns the robot by more is refused. A quarter turn, as the paper: none is, [rad]."""
    parallel_rad: float = math.radians(10.0)
    """Normals all within this of one direction observe that direction alone: the other is left as it is. The
    paper's window does this for corridors along x or y; this does it for any corridor, [rad]."""


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights of equations (4) and (5); every array has one entry for each kept association."""

    w1: Array
    """P(root) of the associated chain."""
    w2: Array
    """Half of P(association)."""
    w3: Array
    """Falls with the distance of the feature from the robot (figure 11)."""

    def only(self, chosen: NDArray[np.bool_]) -> Weights:
        """Those of the associations chosen, shape (n,)."""
        if chosen.all():
            return self
        return Weights(self.w1[chosen], self.w2[chosen], self.w3[chosen])

    @property
    def heading(self) -> Array:
        """w1 + w2 + w3, equation (4)."""
        return self.w1 + self.w2 + self.w3

    @property
    def position(self) -> Array:
        """w1 + w3, equation (5)."""
        return self.w1 + self.w3


@dataclass(frozen=True)
class Correction:
    """What is added to the predicted pose."""

    x: float = 0.0
    """[m], map frame"""
    y: float = 0.0
    """[m], map frame"""
    heading: float = 0.0
    """[rad]"""

    def applied_to(self, pose: Pose) -> Pose:
        """The corrected pose."""
        return Pose(pose.x + self.x, pose.y + self.y, pose.heading + self.heading)


def association_weights(residuals: Residuals, probability: Array) -> Weights:
    """w1, w2 and w3 of associations with P(association) as given."""
    w3 = np.interp(residuals.range_m, [NEAR_M, FAR_M], [NEAR_WEIGHT, FAR_WEIGHT])
    return Weights(residuals.root_probability, ASSOCIATION_SHARE * probability, w3)


def localize(residuals: Residuals, weights: Weights, config: LocalizationConfig) -> Correction:
    """Heading by equation (4), then position by equation (5).

    Turning the robot turns every feature about it, and NDR is taken with the feature turned parallel to its
    root about that same point, so the NDR after the heading's correction are those from before it.
    """
    if not residuals.adr_rad.size:
        return Correction()
    turn = correct_heading(residuals.adr_rad, weights.heading)
    if abs(turn) > config.turn_max_rad:
        return Correction()
    return Correction(*correct_position(residuals, weights.position, config.parallel_rad), turn)


def correct_heading(adr_rad: Array, weights: Array) -> float:
    """The turn of the robot that minimises the weighted sum of |ADR| left over, equation (4), [rad].

    ADR is the turn that takes a feature to its root, so a turn t of the robot leaves ADR - t.
    """
    return weighted_median(adr_rad, weights)


def weighted_median(values: Array, weights: Array) -> float:
    """argmin over t of sum w |v - t|; the middle of the optimum where it is flat."""
    order = np.argsort(values, kind="stable")
    values, below = values[order], np.cumsum(weights[order])
    half, slack = 0.5 * below[-1], TIE * below[-1]
    lowest = int(np.searchsorted(below, half - slack))
    highest = int(np.searchsorted(below, half + slack, side="right"))
    return float(0.5 * (values[lowest] + values[min(highest, len(values) - 1)]))


def correct_position(residuals: Residuals, weights: Array, parallel_rad: float) -> tuple[float, float]:
    """The shift (dx, dy) of the robot that minimises the weighted sum of |NDR|, equation (5), [m].

    Solved exactly, not on a lattice, so no step size leaks into the pose. Ties go to the smallest shift.
    """
    axis = _main_axis(residuals.normals, weights)
    if (np.abs(residuals.normals @ axis) >= math.cos(parallel_rad)).all():
        along = _shift_along(axis, residuals, weights)
        return float(along * axis[0]), float(along * axis[1])
    shift = _smallest_best_shift(residuals, weights, _window(residuals))
    return float(shift[0]), float(shift[1])


def _main_axis(normals: Array, weights: Array) -> Array:
    """The undirected direction that the normals share most, a unit vector of shape (2,)."""
    scatter = (normals * weights[:, None]).T @ normals
    axis: Array = np.linalg.eigh(scatter)[1][:, -1]
    return axis


def _shift_along(axis: Array, residuals: Residuals, weights: Array) -> float:
    """argmin over t of sum w |d + t (n . axis)|, the t nearest to zero where it is flat, [m]."""
    slopes = residuals.normals @ axis
    zeros, pulls = -residuals.ndr_m / slopes, weights * np.abs(slopes)
    costs = np.abs(zeros[:, None] - zeros[None, :]) @ pulls
    best = zeros[costs <= costs.min() + TIE * pulls.sum()]
    return float(np.clip(0.0, best.min(), best.max()))


def _window(residuals: Residuals) -> Array:
    """(max |dx|, max |dy|) over the normal shifts to roots and to links, shape (2,), [m]."""
    to_roots = np.abs(residuals.ndr_m[:, None] * residuals.normals)
    to_links = np.abs(residuals.link_ndr_m[:, None] * residuals.link_normals)
    window: Array = np.maximum(to_roots, to_links).max(axis=0)
    return window


def _smallest_best_shift(residuals: Residuals, weights: Array, window: Array) -> Array:
    """The cost is linear between the lines NDR = 0, so some crossing of lines or window edges is best."""
    corners = _crossings(residuals, window)
    costs = np.abs(corners @ residuals.normals.T + residuals.ndr_m) @ weights
    slack = TIE * weights.sum()
    if np.abs(residuals.ndr_m) @ weights <= costs.min() + slack:
        return np.zeros(2)
    best = np.unique(corners[costs <= costs.min() + slack].round(12), axis=0)
    candidates = [*best, *(_nearest_to_zero(a, b) for a, b in combinations(best, 2))]
    return min(candidates, key=lambda shift: float(shift @ shift))


def _crossings(residuals: Residuals, window: Array) -> Array:
    """Where two of the lines NDR = 0 and the window's edges cross, inside the window, shape (k, 2), [m]."""
    normals = np.vstack([residuals.normals, np.eye(2), np.eye(2)])
    offsets = np.concatenate([-residuals.ndr_m, window, -window])
    first, second = np.triu_indices(len(offsets), k=1)
    a, b = normals[first], normals[second]
    determinant = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    cross = np.abs(determinant) > TIE
    a, b, determinant = a[cross], b[cross], determinant[cross]
    p, q = offsets[first[cross]], offsets[second[cross]]
    points = np.stack([p * b[:, 1] - q * a[:, 1], q * a[:, 0] - p * b[:, 0]], axis=1) / determinant[:, None]
    inside: Array = points[(np.abs(points) <= window + TIE).all(axis=1)]
    return inside


def _nearest_to_zero(a: Array, b: Array) -> Array:
    """The point nearest to the origin on the segment between two points."""
    along = b - a
    t = np.clip(-(a @ along) / (along @ along), 0.0, 1.0)
    nearest: Array = a + t * along
    return nearest
