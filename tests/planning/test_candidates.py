# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Candidates can be got to, have room for a scan and something new to see."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose, Segment
from sonar_explore.mapping.grid import FREE, OCCUPIED, UNKNOWN, GridFrame
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.planning.candidates import CandidateConfig, CandidateFinder, _apart, _certainty
from sonar_explore.planning.expected import ChainSpans, expected_chains
from sonar_explore.planning.paths import PlanningConfig, SafePaths
from sonar_explore.slam import Chain, Feature, FeatureKind, Link

FRAME = GridFrame(0.0, 0.0, 0.05, (90, 100))
NOWHERE = np.zeros((0, 2))
seeds = st.integers(0, 10_000)
X, Y = np.moveaxis(FRAME.centres(np.argwhere(np.ones(FRAME.shape))).reshape(*FRAME.shape, 2), -1, 0)


def half_known(seed):
    """A free blob in the unknown with some walls, and where the robot stands."""
    rng = np.random.default_rng(seed)
    states = np.full(FRAME.shape, UNKNOWN, dtype=np.uint8)
    here = rng.uniform(1.2, 3.2, 2)
    for _ in range(4):
        x, y = here + rng.uniform(-0.7, 0.7, 2)
        states[np.hypot(X - x, Y - y) < rng.uniform(0.6, 1.2)] = FREE
    for _ in range(3):
        row, column = rng.integers(5, 60, 2)
        states[row : row + 30, column] = OCCUPIED
    states[np.hypot(X - here[0], Y - here[1]) < 0.5] = FREE
    return OccupancyGrid(FRAME, states), here, rng


def find(grid, here, scanned=NOWHERE, put_aside=NOWHERE, config=None, chains=()):
    config = config or CandidateConfig()
    paths = SafePaths(grid, here[0], here[1], 0.18, PlanningConfig())
    return CandidateFinder(config, 0.18, 0.2, 2.0).find(grid, paths, chains, scanned, put_aside, {}), paths


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_candidates_are_reachable_roomy_new_and_no_more_than_asked(seed):
    grid, here, rng = half_known(seed)
    scanned, aside = np.vstack([here, rng.uniform(1, 4, (3, 2))]), rng.uniform(1, 4, (2, 2))
    config = CandidateConfig(most=int(rng.integers(1, 12)))
    found, paths = find(grid, here, scanned, aside, config)
    assert len(found) <= config.most
    for c in found:
        cell = FRAME.cell(c.x, c.y)
        assert paths.within[cell] and grid.states[cell] == FREE
        assert grid.to_walls_m[cell] >= config.least_room_m
        least = config.least_area_m2 + config.area_per_m * c.path_length_m
        assert c.new_area_m2 >= min(least, config.enough_m2)
        assert c.path_length_m == pytest.approx(paths.cost_m[cell])
        taken = np.vstack([scanned, aside])
        assert np.hypot(*(taken - (c.x, c.y)).T).min() >= config.apart_m
        assert c.chains == c.missing_links == () and c.certainty == 0.0


def test_there_are_candidates_where_there_is_something_to_see():
    counts = [len(find(*half_known(seed)[:2])[0]) for seed in range(10)]
    assert min(counts) > 0


def test_in_a_door_narrower_than_a_scan_likes_a_place_is_offered_where_less_room_is_asked_for():
    states = np.full(FRAME.shape, UNKNOWN, dtype=np.uint8)
    states[5:40, 10:70], states[6:39, 11:69] = OCCUPIED, FREE
    states[39, 34:46] = FREE  # 0.6 m of the upper wall, unknown behind
    grid = OccupancyGrid(FRAME, states)
    usual = CandidateConfig()
    narrow = replace(usual, least_room_m=usual.least_room_narrow_m)
    paths = SafePaths(grid, 2.0, 1.0, 0.18, PlanningConfig(), daring=True)
    finder = CandidateFinder(usual, 0.18, 0.2, 2.0)
    for worth in (None, usual, narrow):
        found = finder.find(grid, paths, (), NOWHERE, NOWHERE, {}, worth)
        nearest = max((c.y for c in found if abs(c.x - 2.0) < 0.2), default=0.0)
        assert (nearest > 2.0 - usual.least_room_m) == (worth is narrow)


def test_a_room_is_worth_any_way_and_a_crumb_is_not():
    config = CandidateConfig(area_per_m=100.0)
    maps = [half_known(seed)[:2] for seed in range(10)]
    found = [c for grid, here in maps for c in find(grid, here, config=config)[0]]
    assert min(c.new_area_m2 for c in found if c.path_length_m > 0.1) >= config.enough_m2


def test_in_a_closed_mapped_room_nothing_is_worth_a_scan():
    states = np.full(FRAME.shape, UNKNOWN, dtype=np.uint8)
    states[10:70, 10:70], states[11:69, 11:69] = OCCUPIED, FREE
    assert find(OccupancyGrid(FRAME, states), (2.0, 2.0))[0] == ()


def chain(wall, root_probability=1.0):
    feature = Feature(FeatureKind.WALL, 0.0, 1.0, 0.3, wall, ())
    return Chain(7, (Link(wall, 0, 0, feature),), 0, root_probability, False)


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_a_chain_answers_just_where_the_foot_of_the_normal_falls_on_it_in_reach(seed):
    rng = np.random.default_rng(seed)
    pose = Pose(rng.uniform(1.5, 3.0), rng.uniform(1.5, 3.0), rng.uniform(-3, 3))
    wall = Segment(-0.7, 0.0, 0.7, 0.0).transformed(pose)
    places = rng.uniform(0.0, 5.0, (60, 2))
    along, across = pose.inverse().transform(places).T
    expected = (np.abs(along) <= 0.7) & (np.abs(across) >= 0.2) & (np.abs(across) <= 2.0)
    clear = OccupancyGrid(FRAME, np.full(FRAME.shape, FREE, dtype=np.uint8))
    assert (
        expected_chains(places, ChainSpans().of([chain(wall)]).spans, clear, 0.2, 2.0)[:, 0] == expected
    ).all()


def test_the_span_of_a_chain_is_that_of_its_links_now():
    first, longer = Segment(0, 1, 1, 1), Segment(2, 1, 3, 1)
    spans, short = ChainSpans(), chain(first)
    assert spans.of([short]).spans[0] == pytest.approx((1.0, 0.0, 1.0, 0.0, 1.0))
    grown = replace(short, placed=(*short.links, *chain(longer).links))
    assert spans.of([grown]).spans[0] == pytest.approx((1.0, 0.0, 1.0, 0.0, 3.0))


def test_a_chain_behind_a_wall_does_not_answer():
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    states[:, 50] = OCCUPIED
    wall, places = Segment(3.2, 1.0, 3.2, 3.0), np.array([[1.5, 2.0], [2.8, 2.0]])
    grid = OccupancyGrid(FRAME, states)
    assert expected_chains(places, ChainSpans().of([chain(wall)]).spans, grid, 0.2, 2.0)[:, 0].tolist() == [
        False,
        True,
    ]


def test_certainty_is_two_where_two_sure_walls_cross_and_one_where_they_are_parallel():
    grid = OccupancyGrid(FRAME, np.full(FRAME.shape, UNKNOWN, dtype=np.uint8))
    grid.states[(X > 1.0) & (X < 2.5) & (Y > 1.0) & (Y < 2.5)] = FREE
    north, south, east = Segment(0, 3, 5, 3), Segment(0, 0.5, 5, 0.5), Segment(3, 0, 3, 5)
    for walls, certainty in (((north, east), 2.0), ((north, south), 1.0), ((north,), 1.0)):
        found, _ = find(grid, (1.7, 1.7), chains=[chain(w) for w in walls])
        assert max(c.certainty for c in found) == pytest.approx(certainty)


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_the_best_places_are_taken_that_lie_apart_and_then_others_by_rank(seed):
    rng = np.random.default_rng(seed)
    places = 0.05 * rng.integers(0, 40, (rng.integers(1, 60), 2))
    alone = np.ones(len(places), dtype=bool)
    for i, place in enumerate(places):
        off = places[:i][alone[:i]] - place
        alone[i] = all(math.hypot(*by) >= 0.5 for by in off)
    expected = [*np.flatnonzero(alone), *np.flatnonzero(~alone)]
    chosen = np.empty(min(int(rng.integers(1, 40)), len(places)), dtype=np.int64)
    _apart(places, 0.5, chosen)
    assert chosen.tolist() == expected[: len(chosen)]


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_certainty_is_that_of_the_surest_chain_and_of_what_crosses_it(seed):
    rng = np.random.default_rng(seed)
    answers = rng.random((rng.integers(1, 12), rng.integers(1, 12))) < rng.choice([0.0, 0.2, 0.8])
    certain, directions = (
        rng.choice([0.0, 0.4, 0.9, 1.0], answers.shape[1]),
        rng.uniform(-2, 2, answers.shape[1]),
    )
    surest = np.argmax(np.where(answers, certain, -1.0), axis=1)
    crossing = np.abs(np.sin(directions - directions[surest, None])) * certain
    sure = certain[surest] + np.where(answers, crossing, 0.0).max(axis=1)
    place, answering = np.nonzero(answers)
    found = _certainty(certain, directions, place, answering, len(answers))
    assert (found == np.where(answers.any(axis=1), sure, 0.0)).all()
