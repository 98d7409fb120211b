"""Where the robot could go next: what is near and safe first, then what takes daring, doubt or a second chance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from sonar_explore.config import ExplorationConfig
from sonar_explore.geometry import Pose
from sonar_explore.planning.candidates import Candidate, CandidateConfig, CandidateFinder
from sonar_explore.planning.driving import DriveEnd
from sonar_explore.planning.loop_drives import LOOP_TRIPS, LoopDrives
from sonar_explore.planning.put_aside import PutAside
from sonar_explore.planning.surroundings import Anchored, Surroundings
from sonar_explore.slam import Slam

NEAR_M = 3.0  # what is left within this is finished before the robot goes farther
OFFERED_M = 12.0  # and what is farther than this is not looked for then: no score makes up for such a way
NEARLY_M = 0.1  # more than rounding can do to the length of a way
DOUBTS = 12  # places gone to by a map that believes less, after nothing is left on the one that believes all;
DOUBTS_AGAIN_AFTER_M2 = 4.0  # [m2] of free space found: as many again
DOUBT_AREA_M2 = 0.5  # new area for which that is worth it,
DOUBT_AREA_PER_M = 0.05  # [m2/m], and for each metre of the way; the share below bounds what it costs
DOUBT_AREA_ENOUGH_M2 = 1.5  # more counts for nothing, outside is any amount: so none leads beyond 30 m
BEHIND_M2 = 0.25  # [m2] free that only daring or doubt leads to make a place worth that,
BEHIND_M = 2.0  # [m], where they lie within so much of it: a room whose door looks shut was seen into
DOOR_M2 = 0.9  # of a room so much is seen from before its door: worth any way where nothing else is left
WITHIN_M = 0.5  # and so far within the hull of what is known, [m], a wall is hardly the building's own
FEW_M = 30.0  # [m]: where no more was driven and nothing seems left, a door that looks shut is likelier than a hut
DOUBTED_M = 0.75  # places nearer to one that was tried so are not tried again
SECOND_CHANCE_AFTER_M2 = 4.0  # of free space found since the last one
FAR_SHARE = 0.05  # of the way driven may be spent on daring and doubts farther off: they seldom find much;
FAR_LEAST_M = 8.0  # [m], and so much from each find on: a room may be left behind a door that looks shut;
FAR_FIND_SHARE = 0.1  # or, where that is more, so much of the way driven till then
# of the way driven may be spent on meeting dangling chains where nothing new is to be seen,
LINK_SHARE = 0.05
LINK_LEAST_M = 3.0  # [m], and so much more: where the pose is off, every scan leaves chains that dangle
RETRACES = 4  # times that the way it came may turn out shut, or one that the last scans lead
CUT_OFF_M2 = 1.0  # [m2] of room that only the way it came leads to: the map shuts what was open
LATEST = 20  # scans that stand right to each other, however the map is turned


class Offers:
    """Offers candidate scan positions, and learns from how the way to them went."""

    def __init__(
        self, surroundings: Surroundings, slam: Slam, finder: CandidateFinder, config: ExplorationConfig
    ) -> None:
        self._surroundings = surroundings
        self._slam = slam
        self._finder = finder
        self._config = config
        worth = config.candidates  # and what is, where nothing is left by that
        self._before_doors = replace(worth, enough_m2=min(DOOR_M2, worth.enough_m2))
        least_room_m = min(worth.least_room_narrow_m, worth.least_room_m)
        self._in_doors = replace(self._before_doors, least_room_m=least_room_m)
        self._rooms = replace(worth, least_area_m2=worth.enough_m2)
        self._blindly = replace(worth, enough_m2=min(DOUBT_AREA_M2, worth.enough_m2))
        self._found: dict[tuple[object, ...], tuple[Candidate, ...]] = {}
        self._shut = PutAside(surroundings, worth.apart_m)
        self._aside: list[tuple[float, float]] = []
        """Places not to be offered now, x y, [m]."""
        self._tried: dict[int, int] = {}
        """How often the robot has gone to meet each dangling chain."""
        self._doubts = DOUBTS
        self._free_m2_at_doubts = -math.inf
        self._doubted: list[Anchored] = []
        """Places that the robot looked from by a doubted map, anchored."""
        self._free_m2_at_chance = -math.inf
        self._chance: Anchored | None = None
        """The place that a second chance is underway to, anchored."""
        self._chancing = False
        """Whether what is on offer is one."""
        trips = LOOP_TRIPS if config.planning.close_loops else 0
        self._loops = LoopDrives(surroundings, slam, self._shut, worth.apart_m, trips)
        self._closing = False
        """Whether what is on offer is a drive to close a loop."""
        self._free_m2_afresh = -math.inf
        """When it last began afresh,"""
        self._afresh_from = 0
        """and from which scan on."""
        self._retraces = RETRACES
        """How often it may still set out on the way that it came, or afresh."""
        self._far_m = FAR_LEAST_M
        """What may be spent on daring and doubts farther off than `NEAR_M`, [m]."""
        self._links_m = LINK_LEAST_M
        """What may be spent on meeting dangling chains alone, [m]."""
        self._driven_m = 0.0
        """Since the start."""
        self.goal: tuple[float, float] | None = None
        """Where the last drive was going when it stopped for a scan, map frame, [m]; None where it was not."""
        self.gave_up = False
        """Whether all that is left are places that were put aside because the way to them was shut."""

    def now(self, pose: Pose) -> tuple[Candidate, ...]:
        """What to choose from at this pose; leaves the surroundings as they were taken for it."""
        self._closing = self._chancing = False
        self._surroundings.retracing, self._surroundings.first_scan = False, 0
        self._aside = self._shut.at(pose)
        candidates: tuple[Candidate, ...] = ()
        for offer in (self._safe, self._dared, self._doubted_walls):
            candidates = candidates or offer(pose, NEAR_M)
        candidates = candidates or self._safe(pose, math.inf)
        if not candidates and self._surroundings.look_everywhere():
            candidates = self._safe(pose, math.inf)
        if not candidates:
            far_m, hemmed_in = max(NEAR_M, self._far_m), self._is_hemmed_in(pose)
            candidates = self._dared(pose, math.inf if hemmed_in else far_m)
            candidates = candidates or self._doubted_walls(pose, far_m)
            candidates = candidates or self._before_the_end(pose) or self._past_hearsay(pose)
            candidates = candidates or self._chance_underway(pose) or self._second_chance(pose)
            if not candidates and (hemmed_in or self._is_cut_off(pose)):
                candidates = self._afresh(pose) or self._past_bounds(pose) or self._back_out(pose)
        if not candidates:
            self.gave_up = self._is_kept_from_something(pose) or self._is_cut_off(pose)
            candidates = self._loops.next(pose)
            self._closing = bool(candidates)
        return candidates

    def chosen(self, candidate: Candidate) -> None:
        """The robot sets out for this one."""
        for chain in candidate.missing_links:
            self._tried[chain] = self._tried.get(chain, 0) + 1

    def learn(self, candidate: Candidate, end: DriveEnd, here: Pose, driven_m: float) -> None:
        """How the way there went, where the robot stands now, and how far it drove, [m]."""
        self._driven_m += driven_m
        whole = not self._surroundings.first_scan  # a way out is no look at what may be there
        far = whole and self._surroundings.daring and candidate.path_length_m > NEAR_M
        self._far_m += -driven_m if far else FAR_SHARE * driven_m
        nothing_new = candidate.new_area_m2 < self._config.candidates.least_area_m2
        self._links_m += -driven_m if candidate.missing_links and nothing_new else LINK_SHARE * driven_m
        place = candidate.x, candidate.y
        if self._surroundings.retracing or self._surroundings.first_scan:
            self._retraces = self._retraces - 1 if end in (DriveEnd.BLOCKED, DriveEnd.BUMPED) else RETRACES
        if end in (DriveEnd.BLOCKED, DriveEnd.BUMPED):
            self._shut.add(place, here)
        if self._closing and end is not DriveEnd.UNDERWAY:
            self._loops.went(place)
        self.goal = place if end is DriveEnd.UNDERWAY else None
        if self._chancing:
            self._chance = self._surroundings.anchored(*place) if end is DriveEnd.UNDERWAY else None
        in_doubt = self._surroundings.doubtful or not self._surroundings.hearsay
        if in_doubt and end is not DriveEnd.UNDERWAY:
            self._doubts -= 1
            # it looks from here, wherever it was going
            self._doubted.append(self._surroundings.anchored(here.x, here.y))

    def _near(
        self, pose: Pose, within_m: float, worth: CandidateConfig | None = None
    ) -> tuple[Candidate, ...]:
        """Of the places worth a scan, those so near; looked for among all only where something near is worth one."""
        if within_m < OFFERED_M and not self._candidates(
            pose, self._aside, within_m + NEARLY_M, near=True, worth=worth
        ):
            return ()
        found = self._candidates(pose, self._aside, max(within_m, OFFERED_M), worth=worth)
        return tuple(c for c in found if c.path_length_m <= within_m)

    def _candidates(
        self,
        pose: Pose,
        places: Sequence[tuple[float, float]],
        reach_m: float = math.inf,
        *,
        near: bool = False,
        worth: CandidateConfig | None = None,
    ) -> tuple[Candidate, ...]:
        """Places worth a scan, none near those; farther ones, by ways weighted by discomfort, [m], are not looked
        for. `near` is for a look: nobody goes by those ways. `worth` as for `CandidateFinder.find`."""
        here = self._surroundings
        tried = self._tried if self._links_m > 0.0 else None
        paths = here.near_paths(pose, reach_m) if near else here.paths(pose, reach_m)
        taken_as = here.doubtful, here.daring, here.retracing, here.first_scan
        taken = *taken_as, pose.x, pose.y, paths.within_m, worth
        key = (here.version, *taken, tuple(places), tried is None or tuple(sorted(tried.items())))
        if key not in self._found:
            self._found = {k: v for k, v in self._found.items() if k[0] == here.version}
            aside = np.array(places).reshape(-1, 2)
            chains = self._slam.chains.chains
            self._found[key] = self._finder.find(
                here.grid, paths, chains, here.scan_positions, aside, tried, worth
            )
        return self._found[key]

    def _safe(self, pose: Pose, within_m: float) -> tuple[Candidate, ...]:
        """Every place with room on the way, the farthest left out where one is so near; none unless one is."""
        self._surroundings.daring = False
        found = self._candidates(pose, self._aside, max(within_m, OFFERED_M))
        return found if any(c.path_length_m <= within_m for c in found) else ()

    def _dared(self, pose: Pose, within_m: float, *, blindly: bool = False) -> tuple[Candidate, ...]:
        """Places so near, by ways nearer to the unknown and into gaps that the map draws too narrow; farther off only
        where the robot has seen into what lies behind, or blindly."""
        self._surroundings.daring = True
        found = self._near(pose, within_m, self._blindly if blindly else None)
        return self._leading_on(pose, found) if NEAR_M < within_m < math.inf and not blindly else found

    def _before_the_end(self, pose: Pose) -> tuple[Candidate, ...]:
        """Places that show as much as is seen of a room from before its door; then by daring ways, in doors too narrow
        for others as well, where the robot has seen into what lies behind; and, where little was driven, whatever
        daring and doubt lead to."""
        here, far_m = self._surroundings, max(NEAR_M, self._far_m)
        here.daring = False
        found = self._near(pose, math.inf, self._before_doors)
        if not found:
            here.daring = True
            least_m2 = self._in_doors.least_area_m2  # a chain to be met there is no reason
            narrow = [c for c in self._near(pose, math.inf, self._in_doors) if c.new_area_m2 >= least_m2]
            found = self._leading_on(pose, narrow)
        if self._driven_m < FEW_M:
            found = found or self._dared(pose, far_m, blindly=True)
            found = found or self._doubted_walls(pose, far_m, blindly=True)
        return found

    def _past_hearsay(self, pose: Pose) -> tuple[Candidate, ...]:
        """Places that show a room if walls passed far off are none: what was heard may be the jambs of a door. By safe
        ways, then by daring ones where the robot has seen into what lies behind; none at the rim of what is known,
        where such a wall is the building's own."""
        here = self._surroundings
        if not self._doubts or not here.has_hearsay:
            return ()
        inside = here.inside(WITHIN_M)
        here.believe_hearsay(False)
        here.daring = False
        found = self._rooms_in(pose, inside)
        if not found:
            here.daring = True
            found = self._leading_on(pose, self._rooms_in(pose, inside))
        if not found:
            here.believe_hearsay(True)
        return found

    def _rooms_in(self, pose: Pose, inside: shapely.Geometry) -> tuple[Candidate, ...]:
        """Places in there that show a room."""
        places = self._not_looked_from(self._near(pose, math.inf, self._rooms))
        rooms = [c for c in places if c.new_area_m2 >= self._rooms.least_area_m2]
        return tuple(c for c in rooms if shapely.contains_xy(inside, c.x, c.y))

    def _not_looked_from(self, places: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """Those of the places near which the robot has not looked in doubt yet."""
        looked = self._surroundings.placed(self._doubted)
        return tuple(c for c in places if all(math.hypot(x - c.x, y - c.y) > DOUBTED_M for x, y in looked))

    def _leading_on(self, pose: Pose, places: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """Those of the places about which enough is free that no safe way on the map that is believed leads to."""
        if not places:
            return ()
        here, farthest_m = self._surroundings, max(c.path_length_m for c in places)
        beyond = here.beyond_belief(pose, farthest_m + BEHIND_M, [(c.x, c.y) for c in places], BEHIND_M)
        least = BEHIND_M2 / here.resolution_m**2
        return tuple(c for c, cells in zip(places, beyond, strict=True) if cells >= least)

    def _is_hemmed_in(self, pose: Pose) -> bool:
        """Whether most of the places with room cannot be got to without daring."""
        self._surroundings.daring = False
        paths = self._surroundings.paths(pose)
        got_to = np.count_nonzero(paths.within)
        return bool(2 * got_to < np.count_nonzero(paths.room_m >= paths.least_room_m))

    def _is_cut_off(self, pose: Pose) -> bool:
        """Whether the way it came leads to room that no other way does, however daring: something that is not there
        is drawn across it."""
        here = self._surroundings
        here.daring = True
        cells = int(np.count_nonzero(here.paths(pose).within))
        here.retracing = True
        more = int(np.count_nonzero(here.paths(pose).within)) - cells
        here.retracing = False
        return more * here.resolution_m**2 >= CUT_OFF_M2

    def _afresh(self, pose: Pose) -> tuple[Candidate, ...]:
        """Where most of the map is cut off: what the last scans alone lead to, first where the map has no way and then
        all about, as if the robot had begun among them. Where the map is turned its walls stand in the one door, but
        the last scans stand right to each other."""
        if not self._retraces:
            return ()
        here = self._surroundings
        here.retracing, here.daring = False, True
        if here.free_m2 >= self._free_m2_afresh + SECOND_CHANCE_AFTER_M2:
            self._free_m2_afresh, self._afresh_from = here.free_m2, max(0, here.scans - LATEST)
        self._free_m2_afresh = min(self._free_m2_afresh, here.free_m2)
        if not self._afresh_from:
            return ()
        on_the_map = here.paths(pose)
        here.first_scan = self._afresh_from
        found = self._candidates(pose, self._aside)
        if not found:
            here.first_scan = 0
        return tuple(c for c in found if on_the_map.to(c.x, c.y) is None) or found

    def _past_bounds(self, pose: Pose) -> tuple[Candidate, ...]:
        """Where most of the map is cut off: what is to be seen if bounds are none. One heard from far off stands aside
        where the map is turned, and may shut the one door."""
        here = self._surroundings
        here.retracing = False
        here.believe_bounds(False)
        found = self._doubted_walls(pose, math.inf)
        if not found:
            here.believe_bounds(True)
        return found

    def _back_out(self, pose: Pose) -> tuple[Candidate, ...]:
        """Where most of the map is cut off: places that the way it came leads to, whatever is drawn across it."""
        if not self._retraces:
            return ()
        here = self._surroundings
        here.daring = here.retracing = True
        found = self._near(pose, math.inf)
        here.retracing = bool(found)
        return found

    def _doubted_walls(self, pose: Pose, within_m: float, *, blindly: bool = False) -> tuple[Candidate, ...]:
        """Places so near where much is to be seen if only what is sure of the walls is there.

        An edge, a column or a wall drawn too long can shut an open door on the map. The ring of eight tells on the way.
        Only where the robot has seen into what lies behind, or blindly.
        """
        here = self._surroundings
        free_m2 = here.free_m2
        if free_m2 >= self._free_m2_at_doubts + DOUBTS_AGAIN_AFTER_M2:
            self._free_m2_at_doubts, self._doubts = free_m2, DOUBTS
            self._far_m = max(self._far_m, FAR_LEAST_M, FAR_FIND_SHARE * self._driven_m)
        # what was drawn twice and is drawn once since the poses were corrected was no find
        self._free_m2_at_doubts = min(self._free_m2_at_doubts, free_m2)
        if not self._doubts:
            return ()
        here.daring = True
        here.believe(doubtful=True)
        places = self._not_looked_from(self._near(pose, within_m, self._blindly if blindly else None))
        found = tuple(c for c in places if _is_worth_a_doubt(c))
        found = found if blindly else self._leading_on(pose, found)
        if found:
            x, y = self.goal or (math.inf, math.inf)
            return tuple(c for c in found if math.hypot(c.x - x, c.y - y) <= DOUBTED_M) or found
        here.believe(doubtful=False)
        return ()

    def _chance_underway(self, pose: Pose) -> tuple[Candidate, ...]:
        """Places about the one that a second chance was going to when it stopped for a scan: nothing else leads on to
        what lies so far off."""
        if self._chance is None:
            return ()
        ((x, y),) = self._surroundings.placed([self._chance])
        self._chance = None
        self._surroundings.daring = True
        found = self._candidates(pose, self._aside)
        near = tuple(c for c in found if math.hypot(c.x - x, c.y - y) <= DOUBTED_M)
        self._chancing = bool(near)
        return near

    def _second_chance(self, pose: Pose) -> tuple[Candidate, ...]:
        """Places that were put aside, once more as if the way had not been shut; again only after much was found."""
        if not self._shut:
            return ()
        here = self._surroundings
        here.daring = True
        obstacles = here.swap_obstacles([])
        free_m2 = here.free_m2
        self._free_m2_at_chance = min(self._free_m2_at_chance, free_m2)
        found = tuple(c for c in self._candidates(pose, ()) if c.new_area_m2 >= DOUBT_AREA_M2)
        if found and free_m2 >= self._free_m2_at_chance + SECOND_CHANCE_AFTER_M2:
            self._free_m2_at_chance = free_m2
            self._shut.forget()
            self._chancing = True
            return found
        here.swap_obstacles(obstacles)
        return ()

    def _is_kept_from_something(self, pose: Pose) -> bool:
        """Whether places are left that were put aside because the way to them was shut."""
        self._surroundings.daring = True
        return bool(self._shut and self._candidates(pose, ()))


def _is_worth_a_doubt(candidate: Candidate) -> bool:
    area_m2 = min(candidate.new_area_m2, DOUBT_AREA_ENOUGH_M2)
    return area_m2 >= max(DOUBT_AREA_M2, DOUBT_AREA_PER_M * candidate.path_length_m)
