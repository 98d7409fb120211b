# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A loop closes where many points of late fall on old ones under one likely move, and stays open otherwise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.slam.loop_closing import LoopConfig, closed, visits

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
