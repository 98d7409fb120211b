# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The cheapest ways are those of scikit-image's Dijkstra, to the last bit, and pass no corner of a wall."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.graph import MCP_Geometric

from sonar_explore.planning.cheapest import cheapest_costs, cheapest_way

seeds = st.integers(0, 10_000)


def ground(seed):
    rng = np.random.default_rng(seed)
    cost = 1.0 + rng.choice([0.0, 3.0, 12.0]) * rng.random((rng.integers(1, 30), rng.integers(1, 40)))
    cost[rng.random(cost.shape) < rng.choice([0.0, 0.2, 0.5])] = np.inf
    start = tuple(int(rng.integers(0, n)) for n in cost.shape)
    cost[start] = 1.0
    return cost, start, rng


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_where_no_wall_is_near_the_costs_are_those_of_scikit_image(seed):
    cost, start, _ = ground(seed)
    theirs, _ = MCP_Geometric(cost, fully_connected=True).find_costs([start])
    theirs[np.isinf(cost)] = np.inf
    assert (cheapest_costs(cost, np.zeros(cost.shape, dtype=bool), start) == theirs).all()


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_a_way_costs_what_is_said_and_brushes_past_no_wall(seed):
    cost, start, rng = ground(seed)
    occupied = rng.random(cost.shape) < 0.3
    costs = cheapest_costs(cost, occupied, start)
    ends = np.argwhere(np.isfinite(costs))
    for end in ends[rng.integers(len(ends), size=5)]:
        way = cheapest_way(cost, occupied, costs, tuple(end))
        assert tuple(way[0]) == start and (way[-1] == end).all()
        total = 0.0
        for (row, column), (r, c) in pairwise(way):
            assert max(abs(r - row), abs(c - column)) == 1
            if r != row and c != column:
                assert not occupied[row, c] and not occupied[r, column]
            total += 0.5 * (cost[row, column] + cost[r, c]) * np.hypot(r - row, c - column)
        assert total == pytest.approx(costs[tuple(end)])


def test_two_walls_that_touch_at_a_corner_leave_no_way_between_them():
    cost, occupied = np.ones((2, 2)), np.array([[False, True], [True, False]])
    cost[occupied] = np.inf
    assert np.isinf(cheapest_costs(cost, occupied, (0, 0))[1, 1])
