# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Where the robot could go next, from places that a finder is made to find."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely

from sonar_explore.config import ExplorationConfig
from sonar_explore.geometry import Pose
from sonar_explore.planning.candidates import Candidate
from sonar_explore.planning.driving import DriveEnd
from sonar_explore.planning.offers import (
    BEHIND_M2,
    CUT_OFF_M2,
    DOOR_M2,
    DOUBTS,
    DOUBTS_AGAIN_AFTER_M2,
    FAR_LEAST_M,
    FAR_SHARE,
    FEW_M,
    LATEST,
    LINK_LEAST_M,
    LINK_SHARE,
    NEAR_M,
    RETRACES,
    WITHIN_M,
    Offers,
)
from sonar_explore.planning.put_aside import SHUT_NEAR_M

HERE = Pose(0.0, 0.0, 0.0)
AWAY = Pose(5.0, 0.0, 0.0)


def place(x, y, way_m=1.0):
    return Candidate(x, y, way_m, 2.0, (), 0.0, ())


class Land:
    """Surroundings where all that is left is behind walls that may be doubted, and a finder of it."""

    dared = False
    """Whether daring is enough to get there."""
    shut_in = False
    retracing = False
    retraced = False
    """Whether the way that the robot came leads there."""
    first_scan, scans = 0, 100
    seen_lately: tuple[Candidate, ...] = ()
    """What the last scans alone lead to."""
    on_the_map: tuple[Candidate, ...] = ()
    """What of it the whole map leads to as well."""
    only_by_track_m2 = 0.0
    """Room that nothing but the way it came leads to."""
    behind_m2 = 2.0
    """What is free behind each place, and no safe way leads to."""
    resolution_m = 0.05
    has_hearsay = True
    rim_x_m = math.inf
    """What is known ends there."""
    drifted = False
    """Whether scans far away are drawn elsewhere than they are believed to stand: no way leads there on such a map."""

    def __init__(self, *places):
        self.places, self.version, self.doubtful, self.daring, self.free_m2 = places, 0, False, False, 50.0
        self.correction_m, self.bounded, self.hearsay = 0.0, True, True
        self.grid, self.scan_positions, self.safe = None, np.zeros((0, 2)), False

    def believe(self, *, doubtful):
        self.doubtful = doubtful

    def believe_bounds(self, believed):
        self.version += believed != self.bounded
        self.bounded = believed

    def believe_hearsay(self, believed):
        self.version += believed != self.hearsay
        self.hearsay = believed

    def inside(self, by_m):
        return shapely.box(-1e3, -1e3, min(self.rim_x_m, 1e3) - by_m, 1e3)

    def look_everywhere(self):
        drifted, self.drifted, self.safe = self.drifted, False, self.drifted
        self.version += drifted
        return drifted

    def anchored(self, x, y):
        return 0, Pose(x - self.correction_m, y, 0.0)

    def placed(self, anchored):
        return [(at.x + self.correction_m, at.y) for _, at in anchored]

    def paths(self, pose, within_m=np.inf):
        beyond = round(self.only_by_track_m2 / self.resolution_m**2)
        within = np.array([not self.shut_in] + beyond * [self.retracing])
        known = {(c.x, c.y): np.zeros((2, 2)) for c in self.on_the_map}
        return SimpleNamespace(
            within=within,
            room_m=np.arange(len(within)) < 1,
            least_room_m=0.2,
            within_m=within_m,
            to=lambda x, y: known.get((x, y)),
        )

    def near_paths(self, pose, within_m):
        return self.paths(pose, within_m)

    def beyond_belief(self, pose, way_m, places, about_m):
        cells = round(self.behind_m2 / self.resolution_m**2)
        return [cells * sum(np.hypot(c.x - x, c.y - y) <= about_m for c in self.places) for x, y in places]

    def swap_obstacles(self, obstacles):
        self.version += 1
        return []

    def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
        return tuple(
            c
            for c in (self.seen_lately if self.first_scan else self.places)
            if (
                self.safe
                or self.first_scan
                or self.doubtful
                or (self.dared and self.daring)
                or (self.retraced and self.retracing)
            )
            and not (np.hypot(*(put_aside - (c.x, c.y)).T) < 0.3).any()
        )


def offers_in(land, driven_m=2.0 * FEW_M):
    planning = SimpleNamespace(close_loops=False)
    config: Any = SimpleNamespace(planning=planning, candidates=ExplorationConfig().candidates)
    offers = Offers(land, SimpleNamespace(chains=SimpleNamespace(chains=())), land, config)
    offers._driven_m = driven_m
    return offers


def try_one(offers, land, end, here, driven_m=1.0):
    found = offers.now(HERE)
    if found:
        land.version += 1
        offers.learn(found[0], end, here, driven_m)
        land.believe(doubtful=False)
    return found


def test_a_place_where_the_robot_looked_in_doubt_is_not_looked_from_again():
    land = Land(place(0.5, 0.0), place(0.9, 0.0))
    offers = offers_in(land)
    assert try_one(offers, land, DriveEnd.ARRIVED, Pose(0.5, 0.0, 0.0))
    assert offers.now(HERE) == ()


def test_a_way_that_was_shut_far_from_a_doubtful_place_says_nothing_of_what_is_to_be_seen_there():
    land = Land(place(0.5, 0.0), place(0.9, 0.0))
    offers = offers_in(land)
    assert try_one(offers, land, DriveEnd.BLOCKED, AWAY)
    assert offers.now(AWAY) == (place(0.9, 0.0),)


@pytest.mark.parametrize(("stopped_m", "again"), [(0.9 * SHUT_NEAR_M, False), (1.1 * SHUT_NEAR_M, True)])
def test_a_place_is_given_another_try_from_elsewhere_where_the_way_to_it_was_shut_far_from_it(
    stopped_m, again
):
    goal = place(20.0, 0.0)
    land = Land(goal)
    offers = offers_in(land)
    offers._second_chance = lambda pose: ()
    stop = Pose(20.0 - stopped_m, 0.0, 0.0)
    for tries in (again, False):
        land.doubtful = True
        offers.learn(goal, DriveEnd.BLOCKED, stop, 1.0)
        offers._doubted.clear()
        land.believe(doubtful=False)
        land.version += 1
        assert offers.now(stop) == () and (goal in offers.now(HERE)) == tries
        land.believe(doubtful=False)


@pytest.mark.parametrize("end", [DriveEnd.UNDERWAY, DriveEnd.ARRIVED])
def test_a_second_chance_goes_on_over_its_legs_and_once_it_is_there_no_more(end):
    goal = place(20.0, 0.0, 20.0)
    land = Land(goal)
    land.dared, land.behind_m2 = True, 0.0  # too far off to be dared for its own sake
    offers = offers_in(land)
    offers.learn(goal, DriveEnd.BLOCKED, HERE, 1.0)
    offers._doubts = 0
    assert try_one(offers, land, end, Pose(1.5, 0.0, 0.0)) == (goal,)
    assert offers.now(Pose(1.5, 0.0, 0.0)) == ((goal,) if end is DriveEnd.UNDERWAY else ())


@pytest.mark.parametrize("driven_m", [0.5 * FEW_M, 2.0 * FEW_M])
def test_a_wall_of_a_small_building_is_doubted_whatever_was_seen_behind_it(driven_m):
    land = Land(place(1.0, 0.0, 2.0 * NEAR_M))
    land.behind_m2 = 0.0
    assert bool(offers_in(land, driven_m).now(HERE)) == (driven_m < FEW_M)


def test_before_the_end_a_door_is_looked_into_that_shows_too_little_of_its_room_to_go_so_far_for():
    class Door(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            lenient = worth is not None and worth.enough_m2 <= DOOR_M2
            return self.places if lenient and not self.daring else ()

    land = Door(place(9.0, 0.0, 20.0))
    assert offers_in(land).now(HERE) == land.places and not land.daring


@pytest.mark.parametrize("way_m", [2.0 * NEAR_M, 5.0 * FAR_LEAST_M])
@pytest.mark.parametrize("behind_m2", [0.5 * BEHIND_M2, 2.0 * BEHIND_M2])
def test_before_the_end_a_narrow_door_is_entered_however_far_off_where_the_robot_has_seen_what_is_behind_it(
    behind_m2, way_m
):
    class Narrow(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            roomless = worth is not None and worth.least_room_m <= worth.least_room_narrow_m
            return self.places if roomless and self.daring and not self.doubtful else ()

    land = Narrow(place(9.0, 0.0, way_m))
    land.behind_m2 = behind_m2
    assert bool(offers_in(land).now(HERE)) == (behind_m2 > BEHIND_M2)


FAR_M = NEAR_M + 5.0


@pytest.mark.parametrize("dared", [False, True])
def test_what_is_far_and_doubtful_is_tried_again_once_that_is_a_small_share_of_the_way_driven(dared):
    class Crumbs(Land):
        """What shows less than a room does from before its door."""

        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            asks_for_a_room = worth is not None and (
                worth.enough_m2 <= DOOR_M2 or worth.least_area_m2 >= worth.enough_m2
            )
            if asks_for_a_room:
                return ()
            return super().find(grid, paths, chains, scanned, put_aside, tried, worth)

    land = Crumbs(place(9.0, 0.0, FAR_M), place(20.0, 0.0, FAR_M))
    land.dared = dared
    offers = offers_in(land)
    assert try_one(offers, land, DriveEnd.ARRIVED, Pose(9.0, 0.0, 0.0), driven_m=FAR_LEAST_M)
    assert offers.now(HERE) == ()  # what it cost is spent
    land.daring = land.doubtful = False
    offers.learn(place(5.0, 0.0), DriveEnd.ARRIVED, AWAY, 1.01 * FAR_M / FAR_SHARE)
    assert land.places[1] in offers.now(HERE)


@pytest.mark.parametrize("found_m2", [0.0, DOUBTS_AGAIN_AFTER_M2])
def test_a_shut_room_far_off_is_tried_however_little_was_driven_and_another_after_a_find(found_m2):
    land = Land(place(9.0, 0.0, FAR_M), place(20.0, 0.0, FAR_M))
    offers = offers_in(land)
    assert try_one(offers, land, DriveEnd.ARRIVED, Pose(9.0, 0.0, 0.0), driven_m=FAR_LEAST_M)
    land.free_m2 += found_m2
    assert bool(offers.now(HERE)) == (found_m2 > 0.0)


def test_a_robot_that_its_map_shuts_in_goes_back_the_way_it_came_but_not_for_ever():
    land = Land(*(place(float(x), 0.0, 20.0) for x in range(9, 9 + RETRACES + 2)))
    land.shut_in = land.retraced = True
    offers = offers_in(land)
    offers._doubts = 0
    offers._free_m2_at_doubts = land.free_m2
    for _ in range(RETRACES):
        assert try_one(offers, land, DriveEnd.BLOCKED, HERE) and land.retracing
    assert offers.now(HERE) == () and not land.retracing


@pytest.mark.parametrize("shut_in", [False, True])
def test_only_a_robot_that_its_map_shuts_in_believes_its_last_scans_alone_and_those_from_then_on(shut_in):
    land = Land()
    land.shut_in, land.seen_lately = shut_in, (place(1.0, 0.0), place(2.0, 0.0))
    offers = offers_in(land)
    assert offers.now(HERE) == (land.seen_lately if shut_in else ())
    assert land.first_scan == (land.scans - LATEST if shut_in else 0)
    land.scans, land.version = land.scans + 5, 1
    offers.now(HERE)
    assert land.first_scan == (land.scans - 5 - LATEST if shut_in else 0)
    land.seen_lately, land.version = (), 2
    assert offers.now(HERE) == () and not land.first_scan


def test_of_what_the_last_scans_lead_to_what_lies_beyond_the_map_comes_first():
    land = Land()
    land.shut_in, land.seen_lately = True, (place(1.0, 0.0), place(2.0, 0.0))
    land.on_the_map = land.seen_lately[:1]
    assert offers_in(land).now(HERE) == land.seen_lately[1:]


def test_who_has_taken_few_scans_has_no_last_ones_to_believe_instead():
    land = Land()
    land.shut_in, land.seen_lately, land.scans = True, (place(1.0, 0.0),), LATEST
    assert offers_in(land).now(HERE) == () and not land.first_scan


def test_a_way_out_by_the_last_scans_is_not_taken_from_what_may_be_spent_on_far_tries():
    land = Land(place(9.0, 0.0, 20.0))
    land.shut_in, land.seen_lately = True, (place(1.0, 0.0, 20.0),)
    offers = offers_in(land)
    offers._doubts = 0
    offers._free_m2_at_doubts = land.free_m2
    assert try_one(offers, land, DriveEnd.ARRIVED, HERE, driven_m=20.0) and offers._far_m >= FAR_LEAST_M


def test_nobody_believes_the_last_scans_for_ever_if_their_ways_are_shut():
    land = Land()
    land.shut_in, land.seen_lately = True, tuple(place(float(x), 0.0) for x in range(9, 9 + RETRACES + 2))
    offers = offers_in(land)
    for _ in range(RETRACES):
        assert try_one(offers, land, DriveEnd.BLOCKED, HERE) and land.first_scan
    assert offers.now(HERE) == () and not land.first_scan


@pytest.mark.parametrize("shut_in", [False, True])
def test_a_robot_that_its_map_shuts_in_tries_what_bounds_shut_before_the_way_it_came(shut_in):
    class Bounded(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            return self.places if self.doubtful and not self.bounded else ()

    land = Bounded(place(9.0, 0.0, 20.0))
    land.shut_in = shut_in
    assert offers_in(land).now(HERE) == (land.places if shut_in else ())
    assert land.bounded != shut_in and land.doubtful == shut_in and not land.retracing


@pytest.mark.parametrize("daring", [False, True])
@pytest.mark.parametrize("behind_m2", [0.5 * BEHIND_M2, 2.0 * BEHIND_M2])
def test_before_the_end_a_room_is_looked_for_behind_walls_passed_far_off_but_from_no_place_twice(
    daring, behind_m2
):
    class Jambs(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            return () if self.doubtful or self.hearsay or self.daring != daring else self.places

    land = Jambs(place(9.0, 0.0, 20.0))
    land.behind_m2 = behind_m2
    offers = offers_in(land)
    found = try_one(offers, land, DriveEnd.ARRIVED, Pose(9.0, 0.0, 0.0))
    assert found == (() if daring and behind_m2 < BEHIND_M2 else land.places)
    land.believe_hearsay(True)
    assert offers.now(HERE) == () and land.hearsay


@pytest.mark.parametrize("within_m", [0.5 * WITHIN_M, 2.0 * WITHIN_M])
def test_behind_a_wall_passed_at_the_rim_of_what_is_known_no_room_is_looked_for(within_m):
    class Outer(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            return () if self.doubtful or self.hearsay else self.places

    land = Outer(place(9.0, 0.0, 20.0))
    land.rim_x_m = 9.0 + within_m
    assert bool(offers_in(land).now(HERE)) == (within_m > WITHIN_M)


def test_where_no_wall_may_be_two_jambs_none_is_doubted_for_that():
    class Outer(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            return () if self.doubtful or self.hearsay else self.places

    land = Outer(place(9.0, 0.0, 20.0))
    land.has_hearsay = False
    assert offers_in(land).now(HERE) == () and land.version == 0


def test_what_is_less_than_a_room_is_no_reason_to_doubt_walls_passed_far_off():
    class Crumb(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            return () if self.doubtful or self.hearsay else self.places

    land = Crumb(replace(place(9.0, 0.0, 20.0), new_area_m2=1.0, missing_links=(7,)))
    assert offers_in(land).now(HERE) == ()


@pytest.mark.parametrize("retraced", [False, True])
def test_who_is_not_shut_in_does_not_drive_through_what_the_map_draws(retraced):
    land = Land(place(9.0, 0.0, 20.0))
    land.retraced = retraced
    offers = offers_in(land)
    offers._doubts, offers._free_m2_at_doubts = 0, land.free_m2
    assert offers.now(HERE) == ()


@pytest.mark.parametrize("room_m2", [0.0, 0.5 * CUT_OFF_M2, 2.0 * CUT_OFF_M2])
def test_where_its_own_way_is_shut_on_the_map_it_is_driven_back_and_nothing_is_called_explored(room_m2):
    land = Land(place(9.0, 0.0, 20.0))
    land.retraced, land.only_by_track_m2 = True, room_m2
    offers = offers_in(land)
    offers._doubts, offers._free_m2_at_doubts = 0, land.free_m2
    cut_off = room_m2 >= CUT_OFF_M2
    assert bool(offers.now(HERE)) == land.retracing == cut_off
    land.version, land.retraced = land.version + 1, False
    assert offers.now(HERE) == () and offers.gave_up == cut_off


def test_a_robot_that_is_shut_in_dares_any_way_out():
    land = Land(place(9.0, 0.0, 20.0))
    land.dared = land.shut_in = True
    assert offers_in(land).now(HERE) == land.places


@pytest.mark.parametrize(
    ("found_m2", "again"), [(0.5 * DOUBTS_AGAIN_AFTER_M2, False), (DOUBTS_AGAIN_AFTER_M2, True)]
)
@pytest.mark.parametrize("corrected_m2", [0.0, 20.0])
def test_doubts_come_back_with_what_is_found_also_where_a_correction_made_the_map_smaller(
    corrected_m2, found_m2, again
):
    land = Land(*(place(2.0 * i, 0.0) for i in range(2 * DOUBTS)))
    offers = offers_in(land)
    for i in range(DOUBTS):
        assert try_one(offers, land, DriveEnd.ARRIVED, Pose(2.0 * i, 0.0, 0.0))
    land.free_m2 -= corrected_m2
    assert offers.now(HERE) == ()
    land.free_m2 += found_m2
    assert bool(offers.now(HERE)) == again


@pytest.mark.parametrize("correction_m", [0.0, 2.0])
def test_what_was_put_aside_or_looked_from_moves_with_the_map(correction_m):
    land = Land(place(0.5, 0.0), place(1.9, 0.0))
    offers = offers_in(land)
    assert try_one(offers, land, DriveEnd.BLOCKED, Pose(1.9, 0.0, 0.0))  # goes to 0.5, looks from 1.9
    land.version, land.correction_m = land.version + 1, correction_m
    moved = place(0.5 + correction_m, 0.0), place(1.9 + correction_m, 0.0)
    land.places = (*moved, place(8.0, 0.0), place(8.0 + correction_m, 1.0))
    assert not set(moved) & set(offers.now(HERE)) and place(8.0, 0.0) in offers.now(HERE)


@pytest.mark.parametrize(("near", "looked_m"), [(True, [12.0]), (False, [12.0, 3.1, 3.1, np.inf])])
def test_while_something_near_is_left_the_whole_building_is_not_looked_through(near, looked_m):
    land = Land(place(0.5, 0.0))
    offers, asked = offers_in(land), []

    def paths(pose, within_m=np.inf):
        asked.append(within_m)
        land.doubtful = near or within_m == np.inf  # there the finder finds something
        return SimpleNamespace(within_m=within_m)

    land.paths = paths  # type: ignore[method-assign]
    land.near_paths = paths  # type: ignore[method-assign]
    assert offers.now(HERE) and asked == looked_m


@pytest.mark.parametrize("way_m", [1.0, 2.0 * NEAR_M])
def test_a_wall_is_doubted_only_where_the_robot_has_seen_what_is_behind_it(way_m):
    for behind_m2 in (0.5 * BEHIND_M2, 2.0 * BEHIND_M2):
        land = Land(place(1.0, 0.0, way_m))
        land.behind_m2 = behind_m2
        assert bool(offers_in(land).now(HERE)) == (behind_m2 > BEHIND_M2)


def test_a_narrow_gap_near_by_is_tried_and_one_far_off_only_where_the_robot_has_seen_what_is_behind_it():
    for way_m, behind_m2, tried in ((1.0, 0.0, True), (2.0 * NEAR_M, 0.0, False), (2.0 * NEAR_M, 2.0, True)):
        land = Land(place(1.0, 0.0, way_m))
        land.dared, land.behind_m2 = True, behind_m2
        assert bool(offers_in(land).now(HERE)) == tried


def test_where_every_scan_leaves_chains_that_dangle_the_robot_does_not_go_round_after_them_for_ever():
    class Dangling(Land):
        def find(self, grid, paths, chains, scanned, put_aside, tried, worth=None):
            return () if tried is None else (Candidate(1.0, 0.0, 1.0, 0.0, (), 0.0, (self.version,)),)

    land = Dangling()
    offers = offers_in(land)
    trips = 0
    while offers.now(HERE):
        try_one(offers, land, DriveEnd.ARRIVED, HERE)
        trips += 1
        assert trips <= LINK_LEAST_M
    assert trips == LINK_LEAST_M
    offers.learn(
        place(1.0, 0.0), DriveEnd.ARRIVED, HERE, 1.5 / LINK_SHARE
    )  # something new was looked at on the way
    assert offers.now(HERE)


def test_all_of_the_map_is_drawn_where_it_is_believed_before_safe_ways_are_given_up():
    far = replace(place(20.0, 0.0), path_length_m=5.0)
    for drifted in (False, True):
        land = Land(far)
        land.drifted = drifted
        assert offers_in(land).now(HERE) == (far,) and land.doubtful is not drifted
