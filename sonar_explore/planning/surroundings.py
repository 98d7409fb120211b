"""What the robot knows of where it is: evidence of scans, body and drives, the map drawn from it, safe ways on it."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import shapely
from numpy.typing import NDArray

from sonar_explore.config import ExplorationConfig
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.far_walls import far_walls
from sonar_explore.mapping.looks import Look, look_of
from sonar_explore.mapping.occupancy import OccupancyGrid, OccupancyMapper
from sonar_explore.measurement import Scan
from sonar_explore.planning.paths import SafePaths
from sonar_explore.slam import ScanEntry, Slam
from sonar_explore.slam.features import Feature

Anchored = tuple[int, Pose]
"""A place: index of a scan, and where the place is in that scan's frame (the heading says nothing)."""


_TakenAs = tuple[bool, bool, bool, int]
"""Doubtful, daring, retracing, and from which scan on."""
_BELIEVED: _TakenAs = (False, False, False, 0)
_Plan = tuple[tuple[int, int], _TakenAs]
"""Where paths begin, row and column, and how the map is taken."""

FRESH_M = 6.0  # [m]: scans farther off than this may be drawn a little off, until all of the map is asked for


class Surroundings:
    """The map in the two ways it can be taken, and the ways on it in the two ways they can be planned.

    Everything is kept in the frames of the scans, so that it moves with them when a correction moves past poses.
    """

    def __init__(self, slam: Slam, config: ExplorationConfig) -> None:
        self._slam = slam
        self._config = config
        body = config.simulator.robot
        self._radius_m = body.radius_m
        self._new_mapper = partial(OccupancyMapper, config.mapping, body.radius_m, body.range_reliable_m)
        self._mapper = self._new_mapper()
        self._looks: list[Look] = []
        self._sure_looks: list[Look] = []
        """The same without hearsay: walls passed that may be two jambs."""
        self._trails: list[Array] = []
        """Where the body has been since each scan, in that scan's frame,"""
        self._been: list[tuple[float, float]] = []
        """and where since the last of them was looked at."""
        self._obstacles: list[tuple[int, Array]] = []
        """Where the ring shut the way: index of the last scan, and a piece of wall in its robot frame."""
        self._grids: dict[tuple[bool, int], OccupancyGrid] = {}
        """Believed and doubted, by the first of their scans: whichever was asked for."""
        self._plans: dict[_Plan, dict[float, SafePaths]] = {}
        """By how far they look,"""
        self._searches: dict[_Plan, SafePaths] = {}
        """and as far as anybody has looked."""
        self._scans: tuple[ScanEntry, ...] = ()
        """Those asked for last,"""
        self._scan_poses: list[Pose] = []
        """and their poses."""
        self._scan_positions: Array | None = None
        self._everywhere = False
        """Whether all scans are drawn where they are believed to stand, those far away among them."""
        self.version = 0
        """Counts the changes of the evidence."""
        self.daring = False
        """Whether ways may lead nearer to the unknown, and into gaps that the map draws too narrow."""
        self.doubtful = False
        """Whether only what is sure of the walls is believed."""
        self.retracing = False
        """Whether where the body has been is open, whatever the map says."""
        self.first_scan = 0
        """The map is that of the scans from this one on: of the last alone, where it is not 0."""
        self._bounded = True
        """Whether bounds stand where the map is doubted."""
        self.hearsay = True
        """Whether walls passed that may be two jambs are believed."""

    @property
    def grid(self) -> OccupancyGrid:
        """The map as it is taken; there from the first scan on. Drawn when somebody looks at it."""
        return self._drawn_from(self.first_scan)

    @property
    def whole_grid(self) -> OccupancyGrid:
        """The map of all scans, whichever are believed now."""
        return self._drawn_from(0)

    def _drawn_from(self, first: int) -> OccupancyGrid:
        taken_as = self.doubtful, first
        if taken_as not in self._grids:
            looks = self._looks if self.hearsay else self._sure_looks
            mapper = self._new_mapper() if first else self._mapper
            self._grids[taken_as] = mapper.draw(
                self._poses()[first:],
                looks[first:],
                self._trails_so_far()[first:],
                [(scan - first, piece) for scan, piece in self._obstacles if scan >= first],
                doubtful=self.doubtful,
                bounded=self._bounded,
                fresh_m=math.inf if self._everywhere else FRESH_M,
            )
        return self._grids[taken_as]

    @property
    def resolution_m(self) -> float:
        """Side of a cell of the map, [m]."""
        return self._config.mapping.resolution_m

    @property
    def scans(self) -> int:
        """How many there are."""
        return len(self._looks)

    @property
    def free_m2(self) -> float:
        """Of the map as it is taken, [m2]."""
        return float(np.count_nonzero(self.grid.free)) * self.grid.frame.resolution_m**2

    def inside(self, by_m: float) -> shapely.Geometry:
        """What lies so far within the convex hull of what is free as the map is taken, map frame, [m]."""
        free = self.grid.free
        rows = np.flatnonzero(free.any(axis=1))
        first, last = free[rows].argmax(axis=1), free.shape[1] - 1 - free[rows, ::-1].argmax(axis=1)
        ends = np.concatenate([np.column_stack([rows, first]), np.column_stack([rows, last])])
        return shapely.MultiPoint(self.grid.frame.centres(ends)).convex_hull.buffer(-by_m)

    @property
    def all_scan_positions(self) -> Array:
        """x y of every scan, shape (n, 2), map frame, [m]."""
        if self._scan_positions is None:
            assert self.whole_grid  # drawn of all of them
            self._scan_positions = self._mapper.scan_positions
        return self._scan_positions

    @property
    def scan_positions(self) -> Array:
        """x y of the scans that the map as it is taken is of, shape (n, 2), map frame, [m]."""
        if not self.first_scan:
            return self.all_scan_positions
        return np.array([(e.pose.x, e.pose.y) for e in self._slam.scans[self.first_scan :]])

    def add_scan(self, scan: Scan, features: Sequence[Feature]) -> None:
        """The last scan that SLAM has taken; the map is believed again."""
        self._trails_so_far()
        look = look_of(scan, features, self._config.mapping)
        far = far_walls(scan, self._config.slam, self._config.mapping.far_wall_m)
        self._looks.append(replace(look, bounds=far))
        self._sure_looks.append(self._looks[-1])
        self._trails.append(np.zeros((1, 2)))
        self.doubtful, self.first_scan = False, 0
        self._bounded = self.hearsay = True
        self._changed()

    def add_body(self, poses: Sequence[Pose]) -> None:
        """The body was here, in order: there is room for it. On the map from the next change on."""
        map_in_scan = self._slam.scans[-1].pose.inverse()
        self._been += [(at.x, at.y) for at in (map_in_scan @ here for here in poses)]

    def add_passed(self, walls: Array, sure: Array) -> None:
        """Pieces of wall that the ring heard since the last scan, and those heard from near by alone, none of which is
        two jambs, shape (n, 4) both, map frame, [m]: the very same where all are. On the map from the next change
        on."""
        if len(walls):
            map_in_scan = self._slam.scans[-1].pose.inverse()
            alike = sure is walls and self._sure_looks[-1] is self._looks[-1]
            for looks, passed in (self._looks, walls), (self._sure_looks, sure):
                in_scan = map_in_scan.transform(passed.reshape(-1, 2)).reshape(-1, 4)
                looks[-1] = replace(looks[-1], bounds=np.vstack([looks[-1].bounds, in_scan]))
            if alike:
                self._sure_looks[-1] = self._looks[-1]

    @property
    def has_hearsay(self) -> bool:
        """Whether any wall passed may be two jambs."""
        return any(map(operator.is_not, self._looks, self._sure_looks))

    def add_obstacle(self, here: Pose, obstacle: Array) -> None:
        """A piece of wall shut the way; shape (n, 2), in the frame of the robot, which is here, [m]."""
        in_scan = self._slam.scans[-1].pose.inverse() @ here
        # the middle of the piece is sure: the echo came from there
        first, last = in_scan.transform(obstacle[[1, -2]] if len(obstacle) > 2 else obstacle[[0, -1]])
        self._obstacles.append((len(self._looks) - 1, np.array([[*first, *last]])))
        self._changed()

    def anchored(self, x: float, y: float) -> Anchored:
        """A place, map frame, [m], that moves with the last scan from now on."""
        scans = self._slam.scans
        return len(scans) - 1, scans[-1].pose.inverse() @ Pose(x, y, 0.0)

    def placed(self, anchored: Sequence[Anchored]) -> list[tuple[float, float]]:
        """Where such places are by the poses now believed, x y, map frame, [m]."""
        scans = self._slam.scans if anchored else ()
        return [scans[i].pose.place_of(at) for i, at in anchored]

    def swap_obstacles(self, obstacles: list[tuple[int, Array]]) -> list[tuple[int, Array]]:
        """Take these for what has shut the way so far; what was taken for it until now."""
        before, self._obstacles = self._obstacles, obstacles
        self._changed()
        return before

    def believe(self, *, doubtful: bool) -> None:
        """Take the map as it is, or only what is sure of its walls."""
        self.doubtful = doubtful

    def believe_bounds(self, believed: bool) -> None:
        """Whether bounds stand where the map is doubted; they do again with the next scan."""
        if self._bounded != believed:
            self._bounded = believed
            self._changed()

    def believe_hearsay(self, believed: bool) -> None:
        """Whether walls passed that may be two jambs are believed; they are again with the next scan."""
        if self.hearsay != believed:
            self.hearsay = believed
            self._changed()

    def look_everywhere(self) -> bool:
        """Draw what is far away where it is believed to stand, too, until something changes; whether that is elsewhere
        on the map that is believed."""
        if self._everywhere:
            return False
        changes = self._mapper.is_late(doubtful=False)
        if changes or self._mapper.is_late(doubtful=True):
            self._changed()
        self._everywhere = True
        return changes

    def paths(self, pose: Pose, within_m: float = math.inf) -> SafePaths:
        """Safe paths from here to all that is no farther, by ways weighted by discomfort, [m]; those of before where
        neither the map nor the robot's cell has changed."""
        known = self._known_paths(pose)
        if within_m not in known:
            plan = self.near_paths(pose, within_m)
            known[within_m] = known[plan.within_m] = plan
        return known[within_m]

    def near_paths(self, pose: Pose, within_m: float) -> SafePaths:
        """The same without keeping them: for a look, not to go by."""
        here = self._plan_of(pose)
        if here not in self._searches:
            config, radius_m = self._config.planning, self._radius_m
            been = self.way_so_far()[0] if self.retracing else None
            self._searches[here] = SafePaths(
                self.grid, pose.x, pose.y, radius_m, config, daring=self.daring, been=been
            )
        return self._searches[here].as_far_as(within_m)

    def paths_as_far_as(self, pose: Pose, way_m: float) -> SafePaths:
        """Safe paths from here to all that is no farther than this, and perhaps to more: those that are known."""
        known = [within_m for within_m in self._known_paths(pose) if within_m >= way_m]
        return self.paths(pose, min(known, default=math.inf))

    def beyond_belief(
        self, pose: Pose, way_m: float, places: Sequence[tuple[float, float]], about_m: float
    ) -> list[int]:
        """How many cells have their middles so near to each of these places, x y, [m], that ways so long, [m], lead to
        as the map is taken, and no safe way on the map that is believed."""
        taken_as = self._taken_as
        within = self.paths_as_far_as(pose, way_m).within
        self._taken_as = _BELIEVED
        beyond = within & ~self.paths(pose).within
        self._taken_as = taken_as
        frame, found = self.grid.frame, []
        reach = math.ceil(about_m / frame.resolution_m) + 1
        for place in places:
            row, column = frame.cell(*place)
            low, left = max(0, row - reach), max(0, column - reach)
            cells = np.argwhere(beyond[low : row + reach + 1, left : column + reach + 1]) + (low, left)
            off = frame.centres(cells) - place
            found.append(int(np.count_nonzero(np.hypot(off[:, 0], off[:, 1]) <= about_m)))
        return found

    def all_paths(self, pose: Pose, way_m: float, detour_m: float) -> Iterator[tuple[SafePaths, float]]:
        """Paths as far as a way is long, [m], and how long they may be, [m]: before those of the map as it is taken,
        safe ones on the map that is believed. A place worth a doubt is no reason to drive through walls on the way.
        """
        taken_as = self._taken_as
        believed = {_BELIEVED, (False, self.daring, False, 0)}
        for ways in sorted({taken_as} if self.first_scan else {*believed, taken_as}):
            self._taken_as = ways
            paths = self.paths_as_far_as(pose, way_m if ways == taken_as else max(way_m, detour_m))
            self._taken_as = taken_as
            yield paths, math.inf if ways == taken_as else detour_m

    def way_so_far(self) -> tuple[Array, NDArray[np.intp]]:
        """Where the body has been in order, map frame, shape (n, 2), [m]; and which of it are scan positions."""
        parts = [e.pose.transform(t) for e, t in zip(self._slam.scans, self._trails_so_far(), strict=True)]
        begins = np.cumsum([0, *(len(part) for part in parts[:-1])])
        return np.vstack(parts), begins

    @property
    def recent_points(self) -> Array:
        """Edges, corners and thin columns that the last scans saw, x y, shape (n, 2), map frame, [m]."""
        return self._mapper.recent_points

    @property
    def _taken_as(self) -> _TakenAs:
        """How the map is taken."""
        return self.doubtful, self.daring, self.retracing, self.first_scan

    @_taken_as.setter
    def _taken_as(self, ways: _TakenAs) -> None:
        self.doubtful, self.daring, self.retracing, self.first_scan = ways

    def _plan_of(self, pose: Pose) -> _Plan:
        return self.grid.frame.cell(pose.x, pose.y), self._taken_as

    def _known_paths(self, pose: Pose) -> dict[float, SafePaths]:
        return self._plans.setdefault(self._plan_of(pose), {})

    def _poses(self) -> list[Pose]:
        """Of all scans, as now believed."""
        if self._slam.scans is not self._scans:
            self._scans = self._slam.scans
            self._scan_poses = [*map(operator.attrgetter("pose"), self._scans)]
        return self._scan_poses

    def _trails_so_far(self) -> list[Array]:
        if self._been:
            self._trails[-1] = np.concatenate([self._trails[-1], self._been])
            self._been = []
        return self._trails

    def _changed(self) -> None:
        self._everywhere = False
        self.version += 1
        self._scan_positions = None
        self._grids.clear()
        self._plans.clear()
        self._searches.clear()
