# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What the ring has heard bars the way just where the body would come too near."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Pose
from sonar_explore.planning.echoes import KEPT_M, POINT_HEARD_RAD, EchoMemory

BODY = AmigoBot()
AHEAD_M, ROOM_M = 0.14, 0.21
poses = st.builds(Pose, st.floats(-3, 3), st.floats(-3, 3), st.floats(-7, 7))


def row(pose):
    return np.array([pose.as_row()])


def memory(pose, heard, is_point=False):
    """After the discs named have heard something at these ranges."""
    discs = [pose @ BODY.sonars[i] for i in heard]
    feet = [disc.transform(np.array([r, 0.0])) for disc, r in zip(discs, heard.values(), strict=True)]
    echoes = EchoMemory(BODY, lambda: np.array(feet if is_point else []).reshape(-1, 2))
    ring = np.full(8, BODY.range_max_m)
    ring[list(heard)] = list(heard.values())
    echoes.note(row(pose), ring[None])
    return echoes


@settings(deadline=None)
@given(poses, st.sampled_from([2, 3]), st.floats(0.02, 0.12))
def test_a_wall_ahead_blocks_and_is_told_in_the_robots_frame(pose, disc, range_m):
    obstacle = memory(pose, {disc: range_m}).in_the_way(pose, AHEAD_M, ROOM_M)
    assert obstacle is not None and obstacle.shape == (5, 2)
    to = BODY.sonars[disc].transform(np.array([[range_m, 0.0]]))[0]
    assert np.hypot(*(obstacle[2] - to)) <= range_m * math.radians(8.1)


@settings(deadline=None)
@given(poses, st.sampled_from([2, 3]), st.floats(0.35, 2.0))
def test_a_wall_far_ahead_does_not(pose, disc, range_m):
    assert memory(pose, {disc: range_m}).in_the_way(pose, AHEAD_M, ROOM_M) is None


@settings(deadline=None)
@given(poses, st.sampled_from([0, 5]), st.floats(0.16, 0.7))
def test_a_parallel_wall_at_a_comfortable_distance_does_not(pose, disc, range_m):
    assert memory(pose, {disc: range_m}).in_the_way(pose, AHEAD_M, ROOM_M) is None


@settings(deadline=None)
@given(poses, st.sampled_from([1, 4]))
def test_an_edge_beside_the_way_does_not_where_a_wall_would(pose, disc):
    wall, edge = (memory(pose, {disc: 0.18}, point) for point in (False, True))
    assert wall.in_the_way(pose, AHEAD_M, ROOM_M) is not None
    assert edge.in_the_way(pose, AHEAD_M, ROOM_M) is None


@pytest.mark.parametrize(("along_m", "aside_m", "bars"), [(0, 0, False), (0.08, 0, True), (0, 0.11, True)])
def test_an_echo_that_a_point_of_the_map_cannot_have_sent_is_a_walls(along_m, aside_m, bars):
    """From near by a disc tells an edge from a wall ten centimetres beside it: a wall there was taken for the edge."""
    here, range_m = Pose(0, 0, 0), 0.18
    point = BODY.sonars[1].transform(np.array([[range_m + along_m, aside_m]]))
    echoes = EchoMemory(BODY, lambda: point)
    ring = np.full(8, BODY.range_max_m)
    ring[1] = range_m
    echoes.note(row(here), ring[None])
    assert (echoes.in_the_way(here, AHEAD_M, ROOM_M) is not None) == bars


@settings(deadline=None)
@given(poses)
def test_an_edge_straight_ahead_does(pose):
    assert memory(pose, {2: 0.1, 3: 0.1}, True).in_the_way(pose, AHEAD_M, ROOM_M) is not None


@settings(deadline=None)
@given(poses)
def test_driving_away_from_a_wall_is_allowed(pose):
    away = pose @ Pose(0.0, 0.0, math.pi)
    assert memory(pose, {2: 0.08, 3: 0.08}).in_the_way(away, AHEAD_M, ROOM_M) is None


def test_a_ring_that_has_heard_nothing_knows_of_nothing():
    assert EchoMemory(BODY, lambda: np.zeros((0, 2))).in_the_way(Pose(0, 0, 0), AHEAD_M, ROOM_M) is None


def test_forget_forgets_and_an_old_echo_is_not_taken_again():
    here = Pose(0, 0, 0)
    echoes = memory(here, {2: 0.1})
    ring = np.full(8, BODY.range_max_m)
    ring[2] = 0.1
    echoes.forget()
    assert echoes.in_the_way(here, AHEAD_M, ROOM_M) is None
    echoes.note(row(here), ring[None])  # the same reading stands: disc 2 has not fired anew
    assert echoes.in_the_way(here, AHEAD_M, ROOM_M) is None


@pytest.mark.parametrize(("far_m", "kept"), [(0.5 * KEPT_M, True), (1.5 * KEPT_M, False)])
def test_what_is_far_behind_is_dropped_when_something_new_is_heard(far_m, kept):
    here, there = Pose(0, 0, 0), Pose(-far_m, 0, 0)
    echoes = memory(here, {2: 0.05, 3: 0.05})
    ring = np.full(8, BODY.range_max_m)
    ring[6] = 0.7
    echoes.note(row(there), ring[None])
    assert (echoes.in_the_way(here, AHEAD_M, ROOM_M) is not None) == kept


@settings(deadline=None)
@given(poses, st.sampled_from([2, 3]), st.floats(0.05, 0.12), st.floats(0.3, 3.0))
def test_a_wall_that_the_next_ping_should_have_heard_bars_nothing_but_its_foot(
    pose, disc, range_m, farther_m
):
    echoes = memory(pose, {disc: range_m})
    assert len(echoes.in_the_way(pose, AHEAD_M, ROOM_M)) == 5
    ring = np.full(8, BODY.range_max_m)
    for again in range(2):  # the first doubts the wall, the second the edge that may be all there is of it
        ring = ring.copy()
        ring[disc] = range_m + farther_m + 0.001 * again
        echoes.note(row(pose), ring[None])
        obstacle = echoes.in_the_way(pose, AHEAD_M, ROOM_M)
        if again == 0 and obstacle is not None:
            assert np.ptp(obstacle, axis=0).max() == pytest.approx(0.0, abs=1e-9)
    left = echoes.in_the_way(pose, AHEAD_M, ROOM_M)
    if left is not None:  # edges off the axis, where an edge may go unheard
        bearing = BODY.sonars[disc].inverse().transform(left[[2]])[0]
        assert abs(math.atan2(bearing[1], bearing[0])) > POINT_HEARD_RAD


@settings(deadline=None)
@given(poses, st.sampled_from([2, 3]), st.floats(0.05, 0.12), st.integers(1, 6))
def test_a_wall_that_goes_on_being_heard_goes_on_barring_the_way(pose, disc, range_m, times):
    echoes = memory(pose, {disc: range_m})
    for again in range(times):
        ring = np.full(8, BODY.range_max_m)
        ring[disc] = range_m + 0.002 * (again % 2)
        echoes.note(row(pose), ring[None])
    assert np.ptp(echoes.in_the_way(pose, AHEAD_M, ROOM_M), axis=0).max() > 0.2


@settings(deadline=None)
@given(poses, st.sampled_from([2, 3]))
def test_a_single_ping_that_heard_nothing_may_have_gone_unheard(pose, disc):
    echoes = memory(pose, {disc: 0.1})
    echoes.note(row(pose), np.full((1, 8), BODY.range_max_m))
    assert np.ptp(echoes.in_the_way(pose, AHEAD_M, ROOM_M), axis=0).max() > 0.2


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(poses, st.lists(st.floats(0.05, 1.2), min_size=8, max_size=8)), min_size=1, max_size=60
    )
)
def test_many_ticks_in_one_call_leave_the_memory_of_single_ones(ticks):
    together, single = (EchoMemory(BODY, lambda: np.zeros((0, 2))) for _ in range(2))
    together.note(np.vstack([row(pose) for pose, _ in ticks]), np.array([ring for _, ring in ticks]))
    for pose, ring in ticks:
        single.note(row(pose), np.array([ring]))
    assert np.array_equal(together._pieces[: together._count], single._pieces[: single._count])
