# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A loop closes where many points of late fall on old ones under one likely move, and stays open otherwise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose
from sonar_explore.slam.motion import MotionSum, RandomWalk
from sonar_explore.slam.smoothing.known_points import FIRST, KIND, LAST
from sonar_explore.slam.smoothing.loop_closing import (
    LoopConfig,
    _best,
    _fallen,
    _gate,
    closed,
    may_close,
    settles,
    visits,
)
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig
from sonar_explore.slam.turn.sighting import Sighting

CONFIG = LoopConfig()
ABOUT = np.array([3.0, 2.0])
WIDE = np.diag([0.5, 0.5, 0.08]) ** 2
"""Of a robot that is lost by half a metre and 5 degrees."""
seeds = st.integers(0, 10_000)


def moved(points, shift, turn):
    c, s = math.cos(turn), math.sin(turn)
    return (points - ABOUT) @ np.array([[c, s], [-s, c]]) + ABOUT + shift


def scattered(rng, n, apart=0.4):
    """Points of which no two are near to one another, about where the robot is."""
    out: list = []
    while len(out) < n:
        point = ABOUT + rng.uniform(-3.0, 3.0, 2)
        if all(np.hypot(*(point - other)) > apart for other in out):
            out.append(point)
    return np.array(out)


def any_may_be(recent, old):
    return np.ones((len(recent), len(old)), dtype=bool)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_points_that_drifted_as_one_are_known_again_and_strangers_among_them_are_not(seed):
    rng = np.random.default_rng(seed)
    both = scattered(rng, 20)
    old, shared = both[:14], 8
    shift, turn = rng.uniform(-0.8, 0.8, 2), rng.uniform(-0.1, 0.1)
    recent = moved(np.vstack([old[:shared], both[14:]]), shift, turn) + rng.normal(0, 0.01, (shared + 6, 2))
    pairs = closed(recent, old, any_may_be(recent, old), ABOUT, WIDE, CONFIG)
    assert pairs == [(k, k) for k in range(shared)]


@pytest.mark.parametrize("seed", range(40))
def test_points_that_are_all_new_close_no_loop(seed):
    rng = np.random.default_rng(seed)
    recent, old = scattered(rng, 12), scattered(rng, 14)
    assert closed(recent, old, any_may_be(recent, old), ABOUT, WIDE, CONFIG) == []


def test_a_gap_that_the_way_makes_unlikely_stays_open():
    old = scattered(np.random.default_rng(1), 10)
    recent = moved(old, (0.8, 0.0), 0.0)
    alike = any_may_be(recent, old)
    assert len(closed(recent, old, alike, ABOUT, WIDE, CONFIG)) == 10
    assert closed(recent, old, alike, ABOUT, np.diag([0.1, 0.1, 0.02]) ** 2, CONFIG) == []


def test_a_row_of_doors_that_fits_as_well_one_door_farther_on_stays_open():
    doors = np.array([[x + edge, 2.0] for x in range(8) for edge in (0.0, 0.45)])
    recent = doors[4:12] + (0.5, 0.0)
    assert closed(recent, doors, any_may_be(recent, doors), ABOUT, WIDE, CONFIG) == []


def test_edges_are_not_taken_for_corners():
    old = scattered(np.random.default_rng(2), 10)
    recent = moved(old, (0.3, 0.2), 0.02)
    alike = any_may_be(recent, old)
    alike[:6] = False
    assert closed(recent, old, alike, ABOUT, WIDE, CONFIG) == []


def test_few_points_prove_nothing():
    old = scattered(np.random.default_rng(3), CONFIG.least - 1)
    assert closed(old, old, any_may_be(old, old), ABOUT, WIDE, CONFIG) == []


def test_old_points_are_taken_visit_by_visit_and_those_out_of_reach_or_of_late_are_not():
    places = np.zeros((40, 2))
    places[35:, 0] = 50.0
    last = np.array([3] * 6 + [5] * 4 + [40] * 8 + [60] * 2 + [95] * 15 + [3] * 5)
    recent, now = np.arange(20, 35), 100
    early, later = visits(places, last, recent, now, CONFIG)
    assert early.tolist() == list(range(10))
    assert later.tolist() == list(range(10, 20))
    assert visits(places, last, recent[:2], now, CONFIG) == []


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_what_a_move_may_have_put_apart_is_near_as_by_mahalanobis_distance(seed):
    rng = np.random.default_rng(seed)
    recent, old = rng.normal(0, 2.0, (6, 2)), rng.normal(0, 2.0, (7, 2))
    root = rng.normal(0, (0.3, 0.3, 0.1), (3, 3))
    prior, near = root @ root.T, rng.random((6, 7)) < 0.7
    plain = near.copy()
    for (i, j), _ in np.ndenumerate(near):
        (x, y), off = recent[i], old[j] - recent[i]
        by_move = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        spread = by_move @ prior @ by_move.T + 0.08**2 * np.eye(2)
        plain[i, j] &= bool(off @ np.linalg.solve(spread, off) <= 9.0 and np.hypot(*off) <= 3.0)
    _gate(recent, old, prior, 0.08**2, 9.0, 3.0, near)
    assert (near == plain).all()


def fallen_plainly(recent, old, alike, c, s, shift, together):
    """Every point asks the nearest that it may be, in the order of the pairs; the nearer one keeps it."""
    owner: dict = {}
    gap: dict = {}
    placed = recent @ np.array([[c, s], [-s, c]]) + shift
    for i, j in zip(*np.nonzero(alike), strict=True):
        off = math.hypot(*(placed[i] - old[j]))
        if off > together or off >= gap.get(i, math.inf):
            continue
        if j in owner and owner[j] != i and gap[owner[j]] <= off:
            continue
        if j in owner:
            gap.pop(owner.pop(j), None)
        owner = {b: a for b, a in owner.items() if a != i}
        owner[j], gap[i] = i, off
    return {i: j for j, i in owner.items()}, sum((off / together) ** 2 for off in gap.values())


def best_plainly(recent, old, alike, information, config):
    """All moves that put two points on two: the points of the best, and how many fall under the best other."""
    tried = []
    rows, columns = np.nonzero(alike)
    for a in range(len(rows)):
        for b in range(a):
            (i, k), (j, m) = (rows[a], rows[b]), (columns[a], columns[b])
            before, after = recent[k] - recent[i], old[m] - old[j]
            long = math.hypot(*before)
            if i == k or j == m or long < config.baseline_m:
                continue
            if abs(long - math.hypot(*after)) > config.apart_m:
                continue
            turn = math.atan2(before[0] * after[1] - before[1] * after[0], before @ after)
            c, s = math.cos(turn), math.sin(turn)
            shift = 0.5 * (old[j] + old[m]) - np.array([[c, -s], [s, c]]) @ (recent[i] + recent[k]) / 2
            move = np.append(shift, turn)
            price = move @ information @ move
            if price <= config.gate:
                owner, misfit = fallen_plainly(recent, old, alike, c, s, shift, config.together_m)
                tried.append((len(owner) - misfit - 0.05 * price, move, owner))
    if not tried:
        return {}, 0
    _, best, owner = max(tried, key=lambda found: found[0])
    others = [
        len(one)
        for _, move, one in tried
        if math.hypot(*(move - best)[:2]) > config.other_m or abs(move[2] - best[2]) > config.other_rad
    ]
    return owner, max(others, default=0)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_the_best_move_is_that_of_the_plain_search(seed):
    rng, config = np.random.default_rng(seed), LoopConfig()
    old = rng.uniform(-1.5, 1.5, (7, 2))
    turn, shift = rng.uniform(-0.1, 0.1), rng.uniform(-0.3, 0.3, 2)
    c, s = math.cos(turn), math.sin(turn)
    recent = np.vstack([old[:4], rng.uniform(-1.5, 1.5, (2, 2))]) @ np.array([[c, s], [-s, c]]) + shift
    recent += rng.normal(0, 0.02, recent.shape)
    alike = rng.random((6, 7)) < 0.7
    information = np.linalg.inv(WIDE)
    limits = np.array(
        [config.together_m, config.apart_m, config.baseline_m, config.gate, config.other_m, config.other_rad]
    )
    pairs = np.empty(len(recent), dtype=np.int64)
    rows, columns = np.nonzero(alike)
    most, second = _best(recent, old, rows, columns, information, limits, pairs)
    owner, expected = best_plainly(recent, old, alike, information, config)
    assert {i: j for i, j in enumerate(pairs.tolist()) if j >= 0} == owner
    assert (most, second) == (len(owner), expected)


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_what_falls_on_what_is_what_the_plain_search_says(seed):
    rng = np.random.default_rng(seed)
    old = rng.uniform(-0.4, 0.4, (6, 2))  # so near to one another that they are in dispute
    recent = old[rng.integers(6, size=8)] + rng.normal(0, 0.1, (8, 2))
    alike, together, (c, s) = rng.random((8, 6)) < 0.8, 0.3, (math.cos(0.05), math.sin(0.05))
    here, taken, gap = np.empty(8, dtype=np.int64), np.empty(6, dtype=np.int64), np.empty(8)
    rows, columns = np.nonzero(alike)
    count, misfit = _fallen(recent, old, rows, columns, c, s, 0.02, -0.01, together, here, taken, gap)
    owner, expected = fallen_plainly(recent, old, alike, c, s, np.array([0.02, -0.01]), together)
    assert {i: j for i, j in enumerate(here.tolist()) if j >= 0} == owner
    assert count == len(owner) and misfit == pytest.approx(expected)


STEP_M = 0.67


def long_way_round(seed, shifted_m=0.0):
    """A drive round a circle of 6 m without walls, solved scan by scan, and where its last scan truly is.

    Six points are heard at the start and, with other numbers and each moved elsewhere by so much, at the end.
    """
    rng, walk, scans = np.random.default_rng(seed), MotionSum(RandomWalk(0.03, 0.015, 0.04)), 60
    true = [Pose(6.0, 0.0, 0.5 * math.pi)]
    turn = math.tau / (scans - 4)
    points = (true[0] @ Pose(1.3, 0.0, 0.0)).transform(rng.uniform(-1.5, 1.5, (6, 2)))
    out, believed = Smoother(true[0], SmoothingConfig(), (0.007, 0.02)), true[0]
    for i in range(scans):
        motion = None
        if i:
            walk.clear(math.tau)
            turned = Pose(0.0, 0.0, math.tau)
            walk.add(
                Pose(0.0, 0.0, 0.0), turned, turned @ Pose(STEP_M, 0.0, 0.0), turned @ Pose(STEP_M, 0.0, turn)
            )
            noise = rng.multivariate_normal(np.zeros(3), walk.total.covariance)
            motion = replace(walk.total, change=walk.total.change + noise)
            true.append(true[-1] @ Pose(STEP_M, 0.0, turn))
            believed = believed @ Pose(*motion.change)
        out.add_scan(believed, motion)
        late = i >= scans - 4
        for k, (x, y) in enumerate(points if i < 4 or late else []):
            x, y = x + late * shifted_m * math.cos(2.4 * k), y + late * shifted_m * math.sin(2.4 * k)
            x, y = true[i].inverse().transform(np.array([x, y]))
            out.add_point(Sighting(i, k + 100 * late, math.atan2(y, x), 0.0, math.hypot(x, y)))
        out.solve()
    return out, true[-1]


@pytest.mark.parametrize("seed", range(8))
def test_a_loop_over_metres_settles_where_its_points_are_the_same_and_only_there(seed):
    out, true = long_way_round(seed)
    worst = out.misfit() + 6 * CONFIG.strain
    for k in range(6):
        out.merge_points(k, k + 100)
    assert settles(out, worst)
    assert Pose(*out.poses[-1]).distance_to(true) < 0.05
    out, _ = long_way_round(seed, shifted_m=0.3)
    worst = out.misfit() + 6 * CONFIG.strain
    for k in range(6):
        out.merge_points(k, k + 100)
    assert not settles(out, worst)


def may_close_plainly(out, config):
    """Visit by visit, step by step."""
    numbers, places = out.points()
    first, last = out.known_points.rows[numbers][:, [FIRST, LAST]].T
    kinds, now = out.known_points.rows[numbers, KIND], len(out.poses) - 1
    recent = np.flatnonzero(first > now - config.recent)
    for old in visits(places, last, recent, now, config):
        near, about = kinds[recent][:, None] == kinds[old][None], out.poses[-1, :2]
        prior = out.drift(int(np.median(last[old])))
        reach = config.together_m**2, config.gate, config.reach_m
        _gate(places[recent] - about, places[old] - about, prior, *reach, near)
        if min(near.any(axis=1).sum(), near.any(axis=0).sum()) >= config.least:
            return True
    return False


def test_what_may_close_is_what_the_steps_one_by_one_would_let_through():
    rng, said = np.random.default_rng(0), []
    for seed in range(3):
        out, _ = long_way_round(seed)
        out.known_points.rows[:, KIND] = rng.integers(0, 2, out.known_points.count)
        out.known_points.rows[:3, LAST] = 2  # two visits, or one, by how long ago is of late
        for _ in range(40):
            config = LoopConfig(
                recent=int(rng.choice([1, 3, 20, 40])),
                least=int(rng.integers(1, 6)),
                together_m=rng.choice([0.01, 0.08, 0.3]),
                reach_m=rng.choice([0.5, 1.5, 3.0, 6.0]),
                gate=rng.choice([0.1, 1.0, 16.0]),
            )
            numbers, places = out.points()
            said.append(may_close(out, numbers, places, config))
            assert said[-1] == may_close_plainly(out, config)
    assert 20 < sum(said) < 100


def test_one_solution_closes_a_loop_over_metres():
    gaps = []
    for seed in (4, 6, 7):
        out, true = long_way_round(seed)
        before, gap = out.misfit(), Pose(*out.poses[-1]).distance_to(true)
        for k in range(6):
            out.merge_points(k, k + 100)
        out.solve()
        assert out.misfit() <= before + 1.0
        gaps.append(gap)
    assert min(gaps) > 2.0
