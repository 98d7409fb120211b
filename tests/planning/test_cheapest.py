# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The cheapest ways are those of SciPy's Dijkstra, to the last bit, and cut no corner."""

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from sonar_explore.planning.cheapest import cheapest_costs, cheapest_way

seeds = st.integers(0, 10_000)


def ground(seed):
    rng = np.random.default_rng(seed)
    cost = 1.0 + rng.choice([0.0, 3.0, 12.0]) * rng.random((rng.integers(1, 30), rng.integers(1, 40)))
    cost[rng.random(cost.shape) < rng.choice([0.0, 0.2, 0.5])] = np.inf
    start = tuple(int(rng.integers(0, n)) for n in cost.shape)
    cost[start] = 1.0
    return cost, start, rng


def edges(cost):
    """What a step costs, for all that may be made, as (from, to, cost)."""
    rows, columns = cost.shape
    for row, column in np.ndindex(rows, columns):
        for dr, dc in product((-1, 0, 1), repeat=2):
            r, c = row + dr, column + dc
            if (dr, dc) == (0, 0) or not (0 <= r < rows and 0 <= c < columns):
                continue
            if np.isfinite([cost[row, column], cost[r, c], cost[row, c], cost[r, column]]).all():
                length = np.sqrt(2.0) if dr and dc else 1.0
                yield row * columns + column, r * columns + c, 0.5 * (cost[row, column] + cost[r, c]) * length


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_the_costs_are_those_of_scipy(seed):
    cost, start, _ = ground(seed)
    steps = list(edges(cost))
    first, second, weight = np.array(steps).reshape(-1, 3).T
    graph = coo_array((weight, (first.astype(int), second.astype(int))), shape=(cost.size, cost.size))
    theirs = dijkstra(graph.tocsr(), indices=int(np.ravel_multi_index(start, cost.shape)))
    assert (cheapest_costs(cost, start).ravel() == theirs).all()


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_a_way_costs_what_is_said_and_cuts_no_corner(seed):
    cost, start, rng = ground(seed)
    costs = cheapest_costs(cost, start)
    step = {(a, b): weight for a, b, weight in edges(cost)}
    ends = np.argwhere(np.isfinite(costs))
    for end in ends[rng.integers(len(ends), size=5)]:
        way = cheapest_way(cost, costs, tuple(end))
        assert tuple(way[0]) == start and (way[-1] == end).all()
        cells = np.ravel_multi_index(tuple(way.T), cost.shape)
        assert sum(step[pair] for pair in pairwise(cells.tolist())) == pytest.approx(costs[tuple(end)])


@pytest.mark.parametrize("walls", [[(0, 1)], [(1, 0)], [(0, 1), (1, 0)]])
def test_no_way_leads_past_the_corner_of_a_wall(walls):
    cost = np.ones((2, 2))
    cost[tuple(np.transpose(walls))] = np.inf
    assert cheapest_costs(cost, (0, 0))[1, 1] == (np.inf if len(walls) == 2 else 2.0)
