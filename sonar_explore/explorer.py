"""The robot's mind less its will: measurement in, situation out. Nothing here knows the truth."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.config import ExplorationConfig
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.frontiers import Frontier, find_frontiers
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.measurement import Scan
from sonar_explore.planning.candidates import Candidate, CandidateFinder
from sonar_explore.planning.driving import DriveEnd, Driver, DriveReport
from sonar_explore.planning.offers import Offers
from sonar_explore.planning.paths import path_length, sampled, straightened
from sonar_explore.planning.polyline import spaced
from sonar_explore.planning.surroundings import Surroundings
from sonar_explore.robot import Robot
from sonar_explore.slam import Chain, ScanUpdate, Slam

MIN_FRONTIER_M = 0.15
MAX_REPLANS = 4
BLIND_LEGS = 3.0  # times as long a leg may be where no scan on the way would hear a wall
DETOUR = 1.5  # times as long a way is taken on the map that is believed, before one through doubted walls
BACK_OFF_M_S, BACK_OFF_TICKS = 0.1, 20


@dataclass(frozen=True, eq=False)
class Situation:
    """All that a policy decides from."""

    pose: Pose
    """`pose_robot_in_map`, as believed."""
    grid: OccupancyGrid
    chains: tuple[Chain, ...]
    candidates: tuple[Candidate, ...]
    """Where the robot could go next; empty when nothing reachable is left."""
    scan_positions: Array
    """x y of every scan so far, shape (n, 2), map frame, [m]."""
    underway_to: tuple[float, float] | None = None
    """Where the last drive was going when it stopped for a scan, map frame, [m]; None where it was not."""
    body_radius_m: float = AmigoBot.radius_m
    """Of the robot's disc, [m]."""

    @cached_property
    def frontiers(self) -> tuple[Frontier, ...]:
        """Where free space that the body can reach meets space nobody has looked at, the longest first; looked for when
        somebody asks."""
        return find_frontiers(self.grid, self.body_radius_m, MIN_FRONTIER_M)


@dataclass(frozen=True)
class Trip:
    """How the way to a candidate went."""

    end: DriveEnd
    path: Array
    """As first planned, shape (n, 2), map frame, [m]."""
    trail: tuple[Pose, ...]
    """Believed poses on the way."""


class Explorer:
    """Looks, maps, offers candidate scan positions and goes to the one that was chosen."""

    def __init__(
        self,
        robot: Robot,
        slam: Slam,
        config: ExplorationConfig,
        known_pose: Callable[[], Pose] | None = None,
    ) -> None:
        """
        Args:
            robot: what drives and measures.
            slam: what corrects the pose.
            config: every choice.
            known_pose: the pose as somebody outside knows it (motion capture; `--slam truth`), else None.
        """
        self._robot = robot
        self._slam = slam
        self._config = config
        self._known_pose = known_pose
        body = config.simulator.robot
        self._body = body
        self._surroundings = Surroundings(slam, config)
        self._finder = CandidateFinder(
            config.candidates, body.radius_m, body.range_min_m, body.range_reliable_m
        )
        self._offers = Offers(self._surroundings, slam, self._finder, config)
        self._leg_trail: list[Pose] = []
        mind = _Mind(self)
        self._heard_nothing = False
        """Whether the last scan heard no wall and no point."""
        believing = known_pose is None
        self._driver = Driver(
            robot,
            body,
            mind.traced,
            mind.points,
            config.driving,
            mind.all_traced if believing else None,
            mind.belief if believing else _no_belief,
        )

    @property
    def grid(self) -> OccupancyGrid:
        """The map of all scans; there from the first scan on."""
        return self._surroundings.whole_grid

    @property
    def gave_up(self) -> bool:
        """Whether all that is left are places that were put aside because the way to them was shut."""
        return self._offers.gave_up

    def look(self) -> ScanUpdate:
        """Take a scan here and map it."""
        direction = -1 if self._config.alternate_spin and self._surroundings.scans % 2 else 1
        if self._known_pose is not None:
            self._slam.place(self._known_pose())
        ring = self._config.scan == "ring" or self._is_in_the_open()
        return self.observe((self._robot.ring_scan if ring else self._robot.scan)(direction))

    def observe(self, scan: Scan) -> ScanUpdate:
        """Take a scan from the robot or from a log: correct the pose, draw the map."""
        self._surroundings.add_passed(*self._driver.walls_passed())
        update = self._slam.update(scan)
        self._driver.forget()
        self._heard_nothing = not update.features
        self._surroundings.add_scan(scan, update.features)
        return update

    def _is_in_the_open(self) -> bool:
        """Whether the last scan heard nothing, and no wall is known so near that this one should."""
        if not (self._heard_nothing and self._config.ring_in_the_open):
            return False
        here = self.pose()
        cell = self.grid.frame.cell(here.x, here.y)
        return bool(self.grid.to_walls_m[cell] > self._config.planning.blind_m)

    def pose(self) -> Pose:
        """`pose_robot_in_map` now, by odometry since the last scan."""
        pose = self._slam.predict(self._robot.pose_robot_in_odometry)
        if self._known_pose is not None:
            pose = self._known_pose()
            self._slam.place(pose)
        return pose

    def situation(self) -> Situation:
        """What there is to decide from."""
        pose = self.pose()
        candidates = self._offers.now(pose)
        return Situation(
            pose=pose,
            grid=self.grid,
            chains=self._slam.chains.chains,
            candidates=candidates,
            scan_positions=self._surroundings.all_scan_positions,
            underway_to=self._offers.goal,
            body_radius_m=self._body.radius_m,
        )

    def go_to(self, candidate: Candidate) -> Trip:
        """Drive there; where the way is shut, find another; put the place aside if there is none.

        A long way is driven in legs, with a scan after each: nobody stays sure of his pose for long without one.
        """
        self._offers.chosen(candidate)
        self._leg_trail = []
        first = None
        end = DriveEnd.BLOCKED
        for _ in range(MAX_REPLANS):
            pose = self.pose()
            path = self._way(pose, candidate, again=first is not None)
            if path is None:
                break
            first = path if first is None else first
            leg = self._first_leg(path)
            report = self._driver.follow(leg)
            end = report.end
            if end is DriveEnd.ARRIVED:
                end = end if leg is path else DriveEnd.UNDERWAY
                break
            self._remember_shut(report)
            if end is DriveEnd.BUMPED:  # nobody knows where the body touched: look before going on
                break
        here = self.pose()
        driven = np.array([(pose.x, pose.y) for pose in [*self._leg_trail, here]])
        self._offers.learn(candidate, end, here, path_length(driven))
        return Trip(end, np.array([[here.x, here.y]]) if first is None else first, (*self._leg_trail, here))

    def _way(self, pose: Pose, candidate: Candidate, *, again: bool = False) -> Array | None:
        """The safest way of those that are not much longer, and of any length once one was shut; None where there is
        none."""
        way_m = candidate.path_length_m
        for paths, longest_m in self._surroundings.all_paths(
            pose, math.inf if again else way_m, DETOUR * way_m
        ):
            path = paths.to(candidate.x, candidate.y)
            if path is not None and path_length(path) <= longest_m:
                if not self._surroundings.retracing:  # the way it came is kept to
                    path = straightened(path, paths.room_m, paths.frame)
                return np.vstack([[pose.x, pose.y], path[1:], [candidate.x, candidate.y]])
        return None

    def _first_leg(self, path: Array) -> Array:
        """The path, or where it is long its first part, up to a place with room for a scan."""
        longest = self._config.planning.leg_m
        if path_length(path) <= 1.5 * longest:
            return path
        grid = self._surroundings.grid
        points = sampled(path, grid.frame.resolution_m)
        driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        cells = grid.frame.cells(points)
        room = self._finder.roomy(grid, cells)
        fit = np.flatnonzero(room & (driven >= 0.5 * longest) & (driven <= BLIND_LEGS * longest))
        usual = fit[driven[fit] <= 1.5 * longest]
        if not len(usual):
            return path
        # a scan that hears no wall is a full turn for nothing: the heading loses by it
        hears = grid.to_walls_m[cells[:, 0], cells[:, 1]] <= self._config.planning.blind_m
        if hears[usual].any():
            usual = usual[hears[usual]]
            stop = usual[np.argmin(np.abs(driven[usual] - longest))]
        else:
            stop = fit[np.argmax(hears[fit])] if hears[fit].any() else fit[-1]
        corners = path[: np.searchsorted(np.cumsum(np.hypot(*np.diff(path, axis=0).T)), driven[stop]) + 1]
        return np.vstack([corners, points[stop : stop + 1]])

    def _all_traced(self, odometry: Array) -> Array:
        """`_traced` at each of these readings of the odometry: x y [m] heading [rad], shape (n, 3) both."""
        poses = self._slam.predict_along(odometry)
        self._note(poses)
        return poses

    def _traced(self) -> Pose:
        """`pose`, noting the way every 5 cm."""
        here = self.pose()
        self._note(np.array([here.as_row()]))
        return here

    def _note(self, poses: Array) -> None:
        passed = spaced(poses, self._leg_trail[-1] if self._leg_trail else None, 0.05)
        self._leg_trail += passed
        if passed:
            self._surroundings.add_body(passed)

    def _remember_shut(self, report: DriveReport) -> None:
        self._surroundings.add_obstacle(self.pose(), report.obstacle)
        if report.end is DriveEnd.BUMPED:  # back off, the way the body came
            for _ in range(BACK_OFF_TICKS):
                self._robot.tick(-BACK_OFF_M_S, 0.0)


class _Mind:
    """The explorer as its driver asks it: held weakly, for in a circle of references maps would stay when nobody needs
    them. A copy, or one that is pickled, asks the explorer that was copied with it."""

    def __init__(self, explorer: Explorer) -> None:
        self._explorer = weakref.ref(explorer)

    def __reduce__(self) -> tuple[type[_Mind], tuple[Explorer]]:
        return _Mind, (self._now(),)

    def traced(self) -> Pose:
        """The pose, noted down."""
        return self._now()._traced()

    def all_traced(self, odometry: Array) -> Array:
        """The pose at each reading of the odometry, noted down."""
        return self._now()._all_traced(odometry)

    def points(self) -> Array:
        """Edges and corners on the map now."""
        return self._now()._surroundings.recent_points

    def belief(self) -> Array | None:
        """What carries the pose along."""
        return self._now()._slam.belief

    def _now(self) -> Explorer:
        explorer = self._explorer()
        assert explorer is not None, "a driver without its explorer"
        return explorer


def _no_belief() -> None:
    """Of a robot that is told where it is."""
