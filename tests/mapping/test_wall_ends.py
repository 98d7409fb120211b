"""Walls go on to what ends them, and no farther."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose
from sonar_explore.mapping.wall_ends import ACROSS, ALIKE, continued

NONE = np.zeros((0, 2))
ON_LINE, REACH = 0.12, 1.5
seeds = st.integers(0, 10_000)


def pieces(walls, points=NONE):
    return continued(np.array(walls, dtype=float), np.array(points, dtype=float), ON_LINE, REACH)


def some_walls(seed, walls=12, points=6, side_m=4.0):
    """Walls up to a metre long and points in a square room about the origin."""
    rng = np.random.default_rng(seed)
    at, angle = side_m * rng.uniform(-0.5, 0.5, (walls, 2)), 0.5 * math.pi * rng.integers(0, 4, walls)
    angle += rng.normal(0.0, 0.1, walls)
    half = 0.5 * rng.uniform(0.1, 1.0, walls)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.hstack([at - half, at + half]), side_m * rng.uniform(-0.5, 0.5, (points, 2))


def by_end(found):
    return sorted(map(tuple, found.round(9).tolist()))


def plain(walls, points):
    """The same by sets of vectors, one end after the other."""
    ends = []
    for i, (ax, ay, bx, by) in enumerate(walls.tolist()):
        ends += [(i, np.array([ax, ay]), np.array([bx, by])), (i, np.array([bx, by]), np.array([ax, ay]))]
    free = {k: _free_m(i, end, other, walls, points) for k, (i, end, other) in enumerate(ends)}
    found = []
    for k, (i, end, other) in enumerate(ends):
        ahead, nearest = (end - other) / math.dist(end, other), free[k]
        if nearest is None:
            continue
        for j in {j for j, *_ in ends} - {i}:
            a, b = walls[j, :2], walls[j, 2:]
            along = (b - a) / math.dist(a, b)
            sine = ahead[0] * along[1] - ahead[1] * along[0]
            middle = 0.5 * (a + b) - end
            if abs(sine) <= ALIKE:
                if abs(middle @ [-ahead[1], ahead[0]]) <= ON_LINE:
                    gap = middle @ ahead - 0.5 * math.dist(a, b)
                    nearest = min(nearest, gap) if gap > 0.0 else nearest
            elif abs(sine) >= ACROSS:
                at, on = np.linalg.solve(np.column_stack([ahead, -along]), middle)
                grown = free[2 * j + 1 if on > 0.0 else 2 * j]
                if 0.0 < at < nearest and abs(on) <= 0.5 * math.dist(a, b) + min(REACH, grown or 0.0):
                    nearest = at
        if nearest <= REACH:
            found.append([*end, *(end + nearest * ahead)])
    return np.array(found).reshape(-1, 4)


def _free_m(i, end, other, walls, points):
    """How far an end may go on before a point; None where it ends already."""
    ahead = (end - other) / math.dist(end, other)
    aside = np.array([-ahead[1], ahead[0]])
    at = [(p - end) @ ahead for p in points if abs((p - end) @ aside) <= ON_LINE]
    at = [t for t in at if t >= -ON_LINE and t > -0.5 * math.dist(end, other)]
    if at and min(at) <= ON_LINE:
        return None
    for j, wall in enumerate(walls):
        a, b = wall[:2], wall[2:]
        along = (b - a) / math.dist(a, b)
        if j == i or abs(ahead[0] * along[1] - ahead[1] * along[0]) > ALIKE:
            continue
        off = end - 0.5 * (a + b)
        beyond = off @ along + 0.5 * ON_LINE * (ahead @ along)
        if abs(off @ [-along[1], along[0]]) <= ON_LINE and abs(beyond) <= 0.5 * math.dist(a, b):
            return None
    return min([2.0 * REACH, *at])


@settings(deadline=None)
@given(seeds)
def test_the_kernels_find_what_plain_vectors_find(seed):
    walls, points = some_walls(seed)
    found, expected = by_end(pieces(walls, points)), by_end(plain(walls, points))
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-6)


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_in_a_hall_of_many_strips_they_find_the_same(seed):
    walls, points = some_walls(seed, walls=60, points=30, side_m=16.0)
    found, expected = by_end(pieces(walls, points)), by_end(plain(walls, points))
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-6)


@settings(deadline=None)
@given(st.floats(40.0, 140.0), st.floats(0.1, 1.4), st.floats(0.1, 1.4), seeds)
def test_two_walls_that_head_for_each_other_meet_where_their_lines_cross(angle_deg, first_m, second_m, seed):
    x, y = np.random.default_rng(seed).uniform(-3.0, 3.0, 2)
    corner, angle = Pose(x, y, 0.1 * seed), math.radians(angle_deg)
    away = np.array([math.cos(angle), math.sin(angle)])
    walls = np.array([[first_m, 0.0, first_m + 1.0, 0.0], [*(second_m * away), *((second_m + 1.0) * away)]])
    found = pieces(corner.transform(walls.reshape(-1, 2)).reshape(-1, 4))
    assert len(found) == 2
    assert found[:, 2:] == pytest.approx(np.array([[x, y], [x, y]]), abs=1e-6)


@pytest.mark.parametrize("gap_m", [0.4, 0.9, 1.4])
def test_a_gap_in_a_wall_is_shut_where_no_jamb_was_heard_and_open_between_two(gap_m):
    walls = [[0.0, 0.0, 1.0, 0.0], [1.0 + gap_m, 0.0, 2.0 + gap_m, 0.0]]
    assert len(pieces(walls)) == 2
    assert not len(pieces(walls, [[1.0, 0.03], [1.0 + gap_m, -0.03]]))


def test_a_wall_goes_on_to_the_nearest_edge_on_its_line_and_not_through_it():
    walls = [[0.0, 0.0, 1.0, 0.0], [2.0, 0.5, 2.0, 1.5]]
    found = pieces(walls, [[1.3, 0.05], [2.0, 0.0]])
    assert by_end(found[np.isclose(found[:, 0], 1.0)]) == [(1.0, 0.0, 1.3, 0.0)]


def test_a_wall_that_nothing_ends_goes_nowhere():
    assert not len(pieces([[0.0, 0.0, 1.0, 0.0], [1.0 + 1.1 * REACH, -0.5, 1.0 + 1.1 * REACH, 0.5]]))
    assert not len(pieces([[0.0, 0.0, 1.0, 0.0]], [[1.5, 3.0]]))


@settings(deadline=None)
@given(seeds)
def test_the_order_of_walls_and_points_says_nothing(seed):
    walls, points = some_walls(seed)
    assert by_end(pieces(walls, points)) == by_end(pieces(walls[::-1], points[::-1]))
