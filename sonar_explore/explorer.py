"""The robot's mind less its will: measurement in, situation out. Nothing here knows the truth."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.config import ExplorationConfig
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.frontiers import Frontier, find_frontiers
from sonar_explore.mapping.near import any_within, any_within_in_blocks
from sonar_explore.mapping.occupancy import Look, OccupancyGrid, OccupancyMapper, look_of
from sonar_explore.measurement import Scan
from sonar_explore.planning.candidates import Candidate, CandidateFinder
from sonar_explore.planning.driving import DriveEnd, Driver, DriveReport
from sonar_explore.planning.loops import open_loops
from sonar_explore.planning.paths import SafePaths, path_length, sampled, straightened
from sonar_explore.robot import Robot
from sonar_explore.slam import Chain, ScanUpdate, Slam

MIN_FRONTIER_M = 0.15
MAX_REPLANS = 4
LOOP_TRIPS = 12  # drives to close loops
NEAR_M = 3.0  # what is left within this is finished before the robot goes farther
DOUBTS = 24  # places gone to by a map that believes less, after nothing is left on the one that believes all
DOUBT_AREA_M2 = 0.5  # new area for which that is worth it,
DOUBT_AREA_PER_M = 0.15  # [m2/m], and for each metre of the way
DOUBT_AREA_ENOUGH_M2 = 1.5  # more makes no way worth it: outside the walls there is any amount of it
SECOND_CHANCE_AFTER_M2 = 4.0  # of free space found since the last one
DOUBTED_M = 0.75  # places nearer to one that was tried so are not tried again
POINT_WITHIN_M = 0.12
FAMILIAR_M = 0.35
BACK_OFF_M_S, BACK_OFF_TICKS = 0.1, 20


@dataclass(frozen=True, eq=False)
class Situation:
    """All that a policy decides from."""

    pose: Pose
    """`pose_robot_in_map`, as believed."""
    grid: OccupancyGrid
    chains: tuple[Chain, ...]
    frontiers: tuple[Frontier, ...]
    candidates: tuple[Candidate, ...]
    """Where the robot could go next; empty when nothing reachable is left."""
    scan_positions: Array
    """x y of every scan so far, shape (n, 2), map frame, [m]."""
    underway_to: tuple[float, float] | None = None
    """Where the last drive was going when it stopped for a scan, map frame, [m]; None where it was not."""


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
        self._mapper = OccupancyMapper(config.mapping, body.radius_m, body.range_reliable_m)
        self._finder = CandidateFinder(
            config.candidates, body.radius_m, body.range_min_m, body.range_reliable_m
        )
        self._looks: list[Look] = []
        self._trails: list[Array] = []
        """Where the body has been since each scan, in that scan's frame."""
        self._obstacles: list[tuple[int, Array]] = []
        """Where the ring shut the way: index of the last scan, and a piece of wall in its robot frame."""
        self._leg_trail: list[Pose] = []
        mind = weakref.proxy(
            self
        )  # no circle of references: an explorer and its maps go when nobody needs them
        self._driver = Driver(
            robot,
            body,
            lambda: mind._traced(),
            lambda x, y: mind._is_point(x, y),
            config.driving,
            None if known_pose is not None else lambda odometry: mind._all_traced(odometry),
        )
        self._put_aside: list[tuple[float, float]] = []
        self._tried: dict[int, int] = {}
        self._paths: SafePaths
        self._grids: dict[bool, OccupancyGrid] = {}
        """Of the map as it is, believed and doubted: whichever was asked for."""
        self._plans: dict[tuple[bool, float, float, bool], SafePaths] = {}
        self._offers: dict[tuple[object, ...], tuple[Candidate, ...]] = {}
        self._daring = False
        self._doubtful = False
        self._doubts = DOUBTS
        self._doubted: list[tuple[float, float]] = []
        self._goal: tuple[float, float] | None = None
        self._free_m2_at_chance = -math.inf
        self._loop_trips = LOOP_TRIPS
        self.gave_up = False
        """Whether all that is left are places that were put aside because the way to them was shut."""
        self.grid: OccupancyGrid
        """The map; there from the first scan on."""

    def look(self) -> ScanUpdate:
        """Take a scan here and map it."""
        direction = -1 if self._config.alternate_spin and len(self._looks) % 2 else 1
        if self._known_pose is not None:
            self._slam.place(self._known_pose())
        scan = self._robot.ring_scan if self._config.scan == "ring" else self._robot.scan
        return self.observe(scan(direction))

    def observe(self, scan: Scan) -> ScanUpdate:
        """Take a scan from the robot or from a log: correct the pose, draw the map."""
        update = self._slam.update(scan)
        self._driver.forget()
        self._looks.append(look_of(scan, update.features, self._config.mapping))
        self._trails.append(np.zeros((1, 2)))
        self._doubtful = False
        self._map()
        return update

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
        candidates: tuple[Candidate, ...] = ()
        for within_m in (NEAR_M, math.inf):
            for offer in (self._safe, self._dared, self._doubted_walls):
                candidates = candidates or offer(pose, within_m)
        candidates = candidates or self._second_chance(pose)
        if not candidates:
            self.gave_up = self._is_kept_from_something(pose)
            candidates = self._close_a_loop(pose)
        return Situation(
            pose=pose,
            grid=self.grid,
            chains=self._slam.chains.chains,
            frontiers=find_frontiers(self.grid, self._body.radius_m, MIN_FRONTIER_M),
            candidates=candidates,
            scan_positions=self._scan_positions(),
            underway_to=self._goal,
        )

    def _scan_positions(self) -> Array:
        return np.array([(e.pose.x, e.pose.y) for e in self._slam.scans])

    def _candidates(self, pose: Pose, put_aside: Sequence[tuple[float, float]]) -> tuple[Candidate, ...]:
        paths, key = self._plan(pose), (self._doubtful, pose.x, pose.y, self._daring, tuple(put_aside))
        if key not in self._offers:
            aside = np.array(put_aside).reshape(-1, 2)
            chains = self._slam.chains.chains
            self._offers[key] = self._finder.find(
                self.grid, paths, chains, self._scan_positions(), aside, self._tried
            )
        return self._offers[key]

    def _safe(self, pose: Pose, within_m: float) -> tuple[Candidate, ...]:
        """Every place with room on the way; none unless one is so near."""
        self._daring = False
        found = self._candidates(pose, self._put_aside)
        return found if any(c.path_length_m <= within_m for c in found) else ()

    def _dared(self, pose: Pose, within_m: float) -> tuple[Candidate, ...]:
        """Places so near, by ways nearer to the unknown and into gaps that the map draws too narrow."""
        self._daring = True
        return tuple(c for c in self._candidates(pose, self._put_aside) if c.path_length_m <= within_m)

    def _doubted_walls(self, pose: Pose, within_m: float) -> tuple[Candidate, ...]:
        """Places so near where much is to be seen if only what is sure of the walls is there.

        An edge, a column or a wall drawn too long can shut an open door on the map. The ring of eight tells on the way.
        """
        if not self._doubts:
            return ()
        self._daring = True
        self._believe(doubtful=True)
        found = [
            c
            for c in self._candidates(pose, self._put_aside)
            if c.path_length_m <= within_m
            and _is_worth_a_doubt(c)
            and all(math.hypot(x - c.x, y - c.y) > DOUBTED_M for x, y in self._doubted)
        ]
        if found:
            x, y = self._goal or (math.inf, math.inf)
            return tuple(c for c in found if math.hypot(c.x - x, c.y - y) <= DOUBTED_M) or tuple(found)
        self._believe(doubtful=False)
        return ()

    def _second_chance(self, pose: Pose) -> tuple[Candidate, ...]:
        """Places that were put aside, once more as if the way had not been shut; again only after much was found."""
        if not self._put_aside:
            return ()
        put_aside, obstacles = self._put_aside, self._obstacles
        self._put_aside, self._obstacles, self._daring = [], [], True
        self._map()
        free_m2 = float(self.grid.free.sum()) * self.grid.frame.resolution_m**2
        found = tuple(c for c in self._candidates(pose, ()) if c.new_area_m2 >= DOUBT_AREA_M2)
        if found and free_m2 >= self._free_m2_at_chance + SECOND_CHANCE_AFTER_M2:
            self._free_m2_at_chance = free_m2
            return found
        self._put_aside, self._obstacles = put_aside, obstacles
        self._map()
        return ()

    def _is_kept_from_something(self, pose: Pose) -> bool:
        """Whether places are left that were put aside because the way to them was shut."""
        self._daring = True
        return bool(self._put_aside and self._candidates(pose, ()))

    def _close_a_loop(self, pose: Pose) -> tuple[Candidate, ...]:
        """Before calling it finished: drive the last stretch of a loop, or go to where that stretch begins."""
        if not self._config.planning.close_loops or not self._loop_trips:
            return ()
        paths, offers, apart_m = self._plan(pose), [], self._config.candidates.apart_m
        trail, scans = self._way_so_far()
        for loop in open_loops(trail, scans, self.grid):
            for x, y in loop.goals.tolist():
                path = paths.to(x, y)
                aside = any(math.hypot(x - a, y - b) <= apart_m for a, b in self._put_aside)
                if path is None or aside or math.hypot(x - pose.x, y - pose.y) <= apart_m:
                    continue
                length = path_length(path)
                offers.append((not loop.closed_by(path), length, Candidate(x, y, length, 0.0, (), 0.0, ())))
        if not offers:
            return ()
        self._loop_trips -= 1
        return (min(offers, key=lambda offer: offer[:2])[2],)

    def _way_so_far(self) -> tuple[Array, NDArray[np.intp]]:
        """Where the body has been in order, map frame, shape (n, 2), [m]; and which of it are scan positions."""
        parts = [e.pose.transform(t) for e, t in zip(self._slam.scans, self._trails, strict=True)]
        begins = np.cumsum([0, *(len(part) for part in parts[:-1])])
        return np.vstack(parts), begins

    def go_to(self, candidate: Candidate) -> Trip:
        """Drive there; where the way is shut, find another; put the place aside if there is none.

        A long way is driven in legs, with a scan after each: nobody stays sure of his pose for long without one.
        """
        for chain in candidate.missing_links:
            self._tried[chain] = self._tried.get(chain, 0) + 1
            self._offers.clear()
        self._leg_trail = []
        first = None
        end = DriveEnd.BLOCKED
        for _ in range(MAX_REPLANS):
            path = self._way(candidate)
            if path is None:
                break
            first = path if first is None else first
            leg = self._first_leg(path)
            report = self._driver.follow(leg, self._familiar())
            end = report.end
            if end is DriveEnd.ARRIVED:
                end = end if leg is path else DriveEnd.UNDERWAY
                break
            self._remember_shut(report)
            if end is DriveEnd.BUMPED:  # nobody knows where the body touched: look before going on
                break
        if end in (DriveEnd.BLOCKED, DriveEnd.BUMPED):
            self._put_aside.append((candidate.x, candidate.y))
        self._goal = (candidate.x, candidate.y) if end is DriveEnd.UNDERWAY else None
        if self._doubtful and end is not DriveEnd.UNDERWAY:
            self._doubts -= 1
            self._doubted.append((candidate.x, candidate.y))
        here = self.pose()
        return Trip(end, np.array([[here.x, here.y]]) if first is None else first, (*self._leg_trail, here))

    def _is_point(self, x: float, y: float) -> bool:
        """Whether the map has an edge, a corner or a thin column at a place."""
        return any_within(self._mapper.recent_points, x, y, POINT_WITHIN_M)

    def _map(self) -> None:
        """Something has changed: draw the map anew."""
        for known in (self._grids, self._plans, self._offers):
            known.clear()
        self._believe(doubtful=self._doubtful)

    def _believe(self, *, doubtful: bool) -> None:
        """Take the map as it is, or only what is sure of its walls."""
        self._doubtful = doubtful
        if doubtful not in self._grids:
            poses = [entry.pose for entry in self._slam.scans]
            obstacles = [poses[i].transform(o.reshape(-1, 2)).reshape(-1, 4) for i, o in self._obstacles]
            walls = np.vstack(obstacles) if obstacles else np.zeros((0, 4))
            grid = self._mapper.draw(poses, self._looks, self._trails, walls, doubtful=doubtful)
            self._grids[doubtful] = grid
        self.grid = self._grids[doubtful]

    def _plan(self, pose: Pose) -> SafePaths:
        """Safe paths from here; those of before where neither the map nor the robot has changed."""
        key = (self._doubtful, pose.x, pose.y, self._daring)
        if key not in self._plans:
            config, radius = self._config.planning, self._body.radius_m
            self._plans[key] = SafePaths(self.grid, pose.x, pose.y, radius, config, daring=self._daring)
        self._paths = self._plans[key]
        return self._paths

    def _way(self, candidate: Candidate) -> Array | None:
        pose = self.pose()
        paths = self._plan(pose)
        path = paths.to(candidate.x, candidate.y)
        if path is None:
            return None
        path = straightened(path, paths.room_m, self.grid.frame)
        return np.vstack([[pose.x, pose.y], path[1:], [candidate.x, candidate.y]])

    def _first_leg(self, path: Array) -> Array:
        """The path, or where it is long its first part, up to a place with room for a scan."""
        longest = self._config.planning.leg_m
        if path_length(path) <= 1.5 * longest:
            return path
        points = sampled(path, self.grid.frame.resolution_m)
        driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        cells = self.grid.frame.cells(points)
        room = self._finder.roomy(self.grid)[cells[:, 0], cells[:, 1]]
        fit = np.flatnonzero(room & (driven >= 0.5 * longest) & (driven <= 1.5 * longest))
        if not len(fit):
            return path
        stop = fit[np.argmin(np.abs(driven[fit] - longest))]
        corners = path[: np.searchsorted(np.cumsum(np.hypot(*np.diff(path, axis=0).T)), driven[stop]) + 1]
        return np.vstack([corners, points[stop : stop + 1]])

    def _familiar(self) -> Callable[[float, float], float]:
        """Room of a place on the map; none where the body has not been near, for the map may miss a wall there.

        A doubted map misses many. Dead ahead, where no disc of the ring hears an edge, only a glance helps.
        """
        if self._doubtful:
            return lambda x, y: 0.0
        trail = self._mapper.trail
        paths = self._paths

        def room(x: float, y: float) -> float:
            return paths.room_at(x, y) if any_within_in_blocks(trail, x, y, FAMILIAR_M) else 0.0

        return room

    def _all_traced(self, odometry: Sequence[Pose]) -> list[Pose]:
        """`_traced` at each of these readings of the odometry."""
        return [self._noted(self._slam.predict(pose)) for pose in odometry]

    def _traced(self) -> Pose:
        """`pose`, noting the way every 5 cm."""
        return self._noted(self.pose())

    def _noted(self, here: Pose) -> Pose:
        if not self._leg_trail or here.distance_to(self._leg_trail[-1]) >= 0.05:
            self._leg_trail.append(here)
            in_scan = self._slam.scans[-1].pose.inverse() @ here
            self._trails[-1] = np.vstack([self._trails[-1], (in_scan.x, in_scan.y)])
        return here

    def _remember_shut(self, report: DriveReport) -> None:
        scan = self._slam.scans[-1].pose
        in_scan = scan.inverse() @ self.pose()
        # the middle of the piece is sure: the echo came from there
        first, last = in_scan.transform(
            report.obstacle[[1, -2]] if len(report.obstacle) > 2 else report.obstacle[[0, -1]]
        )
        self._obstacles.append((len(self._looks) - 1, np.array([[*first, *last]])))
        self._map()
        if report.end is DriveEnd.BUMPED:  # back off, the way the body came
            for _ in range(BACK_OFF_TICKS):
                self._robot.tick(-BACK_OFF_M_S, 0.0)


def _is_worth_a_doubt(candidate: Candidate) -> bool:
    area_m2 = min(candidate.new_area_m2, DOUBT_AREA_ENOUGH_M2)
    return area_m2 >= max(DOUBT_AREA_M2, DOUBT_AREA_PER_M * candidate.path_length_m)
