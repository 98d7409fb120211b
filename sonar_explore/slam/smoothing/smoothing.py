"""Smoothing (beyond the paper): all scan poses, all chain lines and the wheels as one sparse least-squares problem.

The paper moves nothing retroactively: when two chains merge, the gap stays in the map, and a root keeps the
heading error of the scan that saw it. Here every scan pose and every chain's line is estimated from everything
measured so far:

- odometry between scans, with its covariance and its dependence on the two constants of the wheels and on the own
  error of each scan's turn, which the discs of the scan may tell;
- bearing and range of each associated feature to the line of its chain; a merge puts two chains on one line. All ranges
  share one scale: the air is warmer or colder than the robot thinks, all day;
- bearing and range of each point that was met again to its place (`sonar_explore.slam.turn.points`).

Gauss-Newton with a robust loss (Huber, then Cauchy), so that a false merge bends the map little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.motion import Motion, told_by_odometry
from sonar_explore.slam.smoothing.descent import descended
from sonar_explore.slam.smoothing.elimination import Elimination, Tree
from sonar_explore.slam.smoothing.factor_graph import CONSTANTS, FactorGraph, FactorKind, doubled
from sonar_explore.slam.smoothing.jacobian import losses
from sonar_explore.slam.smoothing.known_points import NONE, ONCE, KnownPoints
from sonar_explore.slam.smoothing.relative import UNKNOWN, line_covariances, pose_covariance
from sonar_explore.slam.turn.discs import TurnError
from sonar_explore.slam.turn.sighting import Sighting


@dataclass(frozen=True)
class SmoothingConfig:
    """Standard deviations of what is measured."""

    bearing_rad: float = math.radians(2.0)
    """Of a feature's normal as one disc hears it, by the lattice of headings, [rad]."""
    bearing_least_rad: float = math.radians(0.3)
    """The same, however many discs heard it, [rad]."""
    turn_error: float = 0.012
    """Of the relative error of all turns: it is learned on the way, so that a worn robot's costs a good one little."""
    bend_rad_m: float = math.radians(2.0)
    """Of the bend of straight drives, likewise, [rad/m]."""
    turn_rad: float = math.radians(1.5)
    """Random heading error of the full turn of a scan, [rad]."""
    range_m: float = 0.015
    """Of a feature's range, [m]."""
    point_bearing_rad: float = math.radians(0.45)
    """Of the bearing of a point, [rad]."""
    point_range_m: float = 0.006
    """Of the range of a point, [m]."""
    range_scale: float = 0.005
    """Of all ranges together, relative: 3 K more or less than assumed change the speed of sound by as much."""
    radius_share: float = 0.4
    """Of the radius of a column by how widely it is heard, relative."""
    iterations: int = 6
    """Gauss-Newton steps a scan at most, with Cauchy's loss; after a merge half as many with Huber's come first."""
    still_m: float = 0.02
    """A step that moves no scan farther is the last, [m]."""
    still_rad: float = 0.008
    """Nor turns any by more, [rad]."""
    settled_m: float = 0.002
    """Scans, and what they heard, stay where they were placed until the solution has moved them by more, [m],"""
    settled_rad: float = 0.001
    """or turned them by more, [rad]."""
    anchored_m: float = 0.002
    """What was heard of a pose or a point stays linearised where it was until they have moved by more, [m],"""
    anchored_rad: float = 0.001
    """and of a pose or a line until it has turned by more, [rad],"""
    anchored_scale: float = 0.0002
    """and all of it, until a constant has changed by more."""


class Smoother:
    """The whole history, solved again after each scan."""

    def __init__(self, start: Pose, config: SmoothingConfig, wheel_sigmas: tuple[float, float]) -> None:
        self._config = config
        self._start = start
        self._graph = FactorGraph()
        limits = np.full((4, 4), np.inf)
        limits[0, :3], limits[1, :3] = config.anchored_scale, (*[config.anchored_m] * 2, config.anchored_rad)
        limits[2, 0], limits[3, :2] = config.anchored_rad, config.anchored_m
        constant_limits, self._pose_limits, self._line_limits, self._point_limits = limits
        self._graph.add_variable(0.0, 0.0, 0.0, limits=constant_limits)
        self._constant_sigmas = (*wheel_sigmas, config.range_scale)
        self._poses: NDArray[np.int64] = np.zeros(64, dtype=np.int64)
        """The variable of each scan's pose, as far as there are scans,"""
        self._count = 0
        """and how many there are."""
        self._last_solved = -1
        """That of the last one that was solved."""
        self._chains: dict[int, int] = {}
        """The variable of each chain's line."""
        self._widths: dict[int, tuple[int, int, float]] = {}
        """Of a column's variable: the factor of its radius, how often it was heard, the sum of its radii by width."""
        self.known_points = KnownPoints()
        self._far_off = True
        """Whether the next solution may be far from here."""
        self._elimination = Elimination()
        self._changed: list[int] = []
        """Variables that have other factors since it was solved."""
        self._solved = 0
        """How many variables there were when it was last solved."""
        self._known = 0
        """How many factors."""

    @property
    def _scans(self) -> NDArray[np.int64]:
        """The variable of each scan's pose."""
        return self._poses[: self._count]

    @property
    def poses(self) -> Array:
        """x, y [m], heading [rad] of every scan, shape (n, 3)."""
        return self._graph.values[self._scans, :3]

    @property
    def own(self) -> Array:
        """What each scan's own turn has of error beyond the constant one, relative, shape (n,)."""
        return self._graph.values[self._scans, 3]

    @property
    def own_error(self) -> float:
        """The same of the last scan's turn."""
        return float(self._graph.values[self._poses[self._count - 1], 3])

    @property
    def constants(self) -> Array:
        """Turn error, bend [rad/m] and scale of the ranges (true over measured, less one)."""
        return self._graph.values[CONSTANTS, :3].copy()

    @property
    def radii(self) -> Array:
        """Of the columns, [m]."""
        return self._graph.values[np.array([*self._widths], dtype=np.intp), 2]

    def line(self, chain: int) -> tuple[float, float]:
        """Of a chain: the angle of the normal [rad] and the distance from the origin [m]."""
        angle, distance, _, _ = self._graph.values[self._chains[chain]].tolist()
        return angle, distance

    @property
    def chains(self) -> list[int]:
        """All that have a line."""
        return sorted(self._chains)

    def add_scan(self, pose: Pose, motion: Motion | None, turn: TurnError | None = None) -> None:
        """A new scan, first guessed here.

        Args:
            motion: from the scan before, None for the first.
            turn: what the discs say of the error of its turn.
        """
        graph = self._graph
        config = self._config
        here = graph.add_variable(pose.x, pose.y, pose.heading, 0.0, limits=self._pose_limits)
        if not self._count:
            start = self._start
            graph.add_factor(FactorKind.START, here, -1, (start.x, start.y, start.heading))
            graph.add_factor(FactorKind.ROBOT, here, -1, [1.0 / sigma for sigma in self._constant_sigmas])
        heard = (turn.relative, 1.0 / turn.sigma) if turn else (0.0, 0.0)
        graph.add_factor(FactorKind.TURN, here, -1, (math.tau / config.turn_rad, *heard))
        if motion is not None:
            before = int(self._poses[self._count - 1])
            factor = graph.add_factor(FactorKind.ODOMETRY, before, here, ())
            told_by_odometry(*motion.as_arrays(), graph.measured[factor])
        if self._count == len(self._poses):
            self._poses = doubled(self._poses)
        self._poses[self._count] = here
        self._count += 1

    def add_sighting(self, sighting: Sighting) -> None:
        """A wall on a chain; the first one of a chain makes its line."""
        if sighting.what not in self._chains:
            angle = self._direction(sighting)
            x, y, _, _ = self._graph.values[self._poses[sighting.scan]].tolist()
            distance = x * math.cos(angle) + y * math.sin(angle) + sighting.range_m
            self._chains[sighting.what] = self._graph.add_variable(angle, distance, limits=self._line_limits)
        config = self._config
        sigma = math.sqrt(config.bearing_rad**2 / sighting.discs + config.bearing_least_rad**2)
        heard = sighting.bearing_rad, sighting.sweep_rad, sighting.range_m, 1.0 / sigma, 1.0 / config.range_m
        line = self._chains[sighting.what]
        self._graph.add_factor(FactorKind.LINE, self._poses[sighting.scan], line, heard)

    def add_point(self, sighting: Sighting) -> None:
        """A point; from the second scan that hears it on it is in the problem."""
        points, number = self.known_points, sighting.what
        state = points.state(number)
        if state == NONE:
            points.first_heard(sighting, self._poses[sighting.scan])
            return
        points.heard_again(number, sighting.scan)
        if state == ONCE:
            self._bind(number)
        self._hear_point(number, self._poses[sighting.scan], points.as_heard(sighting))

    def _bind(self, number: int) -> None:
        """A point that was heard once is in the problem from now on."""
        points, graph = self.known_points, self._graph
        place, scan, first = (
            points.place(number, graph.values),
            points.variable(number),
            points.heard[number].tolist(),
        )
        if first[3] > 0.0:
            point = graph.add_variable(*place, first[3], limits=self._point_limits)
            self._widths[point] = graph.add_factor(FactorKind.RADIUS, point, -1, ()), 0, 0.0
        else:
            point = graph.add_variable(*place, limits=self._point_limits)
        points.bind(number, point)
        self._hear_point(number, scan, first)

    def _hear_point(self, number: int, scan: int, heard: Sequence[float]) -> None:
        """By the scan that has this variable: bearing, sweep [rad], range, radius [m]."""
        config, point = self._config, self.known_points.variable(number)
        column = point in self._widths
        sigmas = 1.0 / config.point_bearing_rad, 1.0 / config.point_range_m
        self._graph.add_factor(
            FactorKind.COLUMN if column else FactorKind.POINT, scan, point, (*heard[:3], *sigmas)
        )
        if column:
            factor, often, radii = self._widths[point]
            self._widths[point] = factor, often + 1, radii + heard[3]
            self._tell_radius(point)

    def _tell_radius(self, column: int) -> None:
        """A column is about as thick as its widths tell, on average."""
        factor, heard, radii = self._widths[column]
        self._graph.measured[factor, :2] = radii / heard, heard / (self._config.radius_share * radii)
        self._changed.append(column)

    def merge_points(self, survivor: int, absorbed: int) -> None:
        """Two points of one kind are one."""
        points = self.known_points
        for number in (survivor, absorbed):
            if points.state(number) == ONCE:
                self._bind(number)
        stays, goes = points.variable(survivor), points.variable(absorbed)
        points.put_together(survivor, absorbed)
        self._put_together(stays, goes)
        if goes in self._widths:
            factor, heard, radii = self._widths.pop(goes)
            self._graph.drop(factor)
            own, more, sum_ = self._widths[stays]
            self._widths[stays] = own, heard + more, radii + sum_
            self._tell_radius(stays)

    def merge(self, survivor: int, absorbed: int) -> None:
        """Two chains are one wall."""
        if absorbed in self._chains:
            self._put_together(self._chains[survivor], self._chains.pop(absorbed))

    def _put_together(self, stays: int, goes: int) -> None:
        self._changed += [stays, goes, *self._graph.put_together(stays, goes)]
        self._far_off = True

    def points(self) -> tuple[NDArray[np.int64], Array]:
        """Number and place x y, shape (n, 2), [m], of every point so far."""
        return self.known_points.places(self._graph.values)

    def solve(self) -> None:
        """Move poses, lines, points and the robot's constants to where everything agrees best."""
        graph, config, known = self._graph, self._config, self._known
        stale = np.zeros(graph.variables, dtype=bool)
        if self._changed:
            stale[self._changed] = True
        touched = stale.copy()
        touched[self._solved :] = True
        touched[graph.ends[known:]] = True
        blocks = self._elimination.lay_out(graph, touched)
        problem = graph.kinds, graph.ends, graph.measured, graph.values, graph.anchors, graph.limits
        poses, still = self._scans, (config.still_m, config.still_m, config.still_rad)
        for huber in (True, False) if self._far_off else (False,):
            steps = config.iterations // 2 if huber else config.iterations
            known = 0 if self._far_off else known  # all by the other loss
            descended(
                *(*problem, graph.rows, graph.off, graph.shared, *blocks, graph.dims),
                *(poses, still, huber, known, steps, stale, touched),
            )
        self._changed.clear()
        self._far_off = False
        self._solved, self._known = graph.variables, graph.factors
        self._last_solved = int(self._poses[self._count - 1])

    def misfit(self) -> float:
        """Of all walls and points as heard, as things stand: the sum of Cauchy's loss, in squared sigmas."""
        graph = self._graph
        problem = graph.kinds, graph.ends, graph.measured, graph.values
        return float(losses(*problem, False, np.empty((3, 11)), np.empty(3))[0])

    def copy(self) -> Smoother:
        """As it is now, whatever is added to this one or merged in it."""
        out = copy(self)
        for name in ("_graph", "_elimination", "known_points", "_poses", "_chains", "_widths", "_changed"):
            setattr(out, name, getattr(self, name).copy())
        return out

    def covariances(self, chains: Sequence[int], at: Pose, normals: Array) -> Array:
        """How unsure the robot is of chains' lines: of its heading and of its place along each normal, shape (n, 2, 2).

        Relative to the line, by what the solution has of the last scan, [rad] and [m]; zero for a chain that is not in
        the problem yet.

        Args:
            at: where the robot is now, taken as known relative to the last scan.
            normals: of the lines, shape (n, 2), to the side on which the place counts as ahead.
        """
        out, solved = np.zeros((len(chains), 2, 2)), self._solved
        lines = [self._chains.get(chain, solved) for chain in chains]
        if lines and min(lines) < solved:
            known = np.array([line if line < solved else UNKNOWN for line in lines])
            values, tree = self._graph.values, self._elimination.tree
            line_covariances(known, normals, at.x, at.y, self._last_solved, values, *tree, out)
        return out

    def drift(self, scan: int) -> Array:
        """How unsure the last pose is, seen from this scan: x, y [m], heading [rad], map frame, shape (3, 3)."""
        out = np.zeros((1, 3, 3))
        if self._solved:
            here, last = self._poses[scan], self._last_solved
            pose_covariance(here, last, self._graph.values, *self._elimination.tree, out)
        return out[0]

    @property
    def solved(self) -> tuple[NDArray[np.int64], int, Array, *Tree]:
        """What kernels find covariances by: the variable of each scan, that of the last one that was solved, -1 before
        there is any, the values of all variables, and the tree of elimination."""
        return self._scans, self._last_solved, self._graph.values, *self._elimination.tree

    def _direction(self, sighting: Sighting) -> float:
        """Of the normal or of the point, map frame, [rad]."""
        _, _, heading, own = self._graph.values[self._poses[sighting.scan]].tolist()
        error = float(self._graph.values[CONSTANTS, 0]) + own
        return float(heading + sighting.bearing_rad + sighting.sweep_rad * error)
