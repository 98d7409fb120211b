# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The cheapest ways are those of SciPy's Dijkstra, to the last bit, and cut no corner."""

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from sonar_explore.planning.cheapest import Search, cheapest_costs, cheapest_way, most_entries

seeds = st.integers(0, 10_000)


def ground(seed):
    rng = np.random.default_rng(seed)
    cost = 1.0 + rng.choice([0.0, 3.0, 12.0]) * rng.random((rng.integers(1, 30), rng.integers(1, 40)))
    cost[rng.random(cost.shape) < rng.choice([0.0, 0.2, 0.5])] = np.inf
    start = tuple(int(rng.integers(0, n)) for n in cost.shape)
    cost[start] = 1.0
    return cost, start, rng


def search_of(cost, start):
    """From there on such ground, without the rim, and what it finds, with it."""
    found = np.full(np.add(cost.shape, 2), np.inf)
    entries = np.zeros((most_entries(cost.size), 2), dtype=np.int32)
    dearest = float(cost[np.isfinite(cost)].max())
    rimmed = np.pad(cost, 1, constant_values=np.inf)
    return Search(rimmed, (start[0] + 1, start[1] + 1), dearest, found, entries), found


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
def test_ways_lead_to_the_region_of_the_start_and_nowhere_else(seed):
    cost, start, _ = ground(seed)
    reached = np.isfinite(cheapest_costs(cost, start))
    search, _ = search_of(cost, start)
    low_row, end_row, low_column, end_column = search.region_window
    assert (search.region[1:-1, 1:-1] == reached).all()
    assert search.region[low_row:end_row, low_column:end_column].sum() == reached.sum()
    for part in (search.region[low_row], search.region[end_row - 1]):
        assert part[low_column:end_column].any()
    for part in (search.region[:, low_column], search.region[:, end_column - 1]):
        assert part[low_row:end_row].any()
    for row, column in np.ndindex(cost.shape):
        assert search.reach_cell(row + 1, column + 1) == reached[row, column]


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_what_some_cells_cost_is_what_one_search_finds(seed):
    cost, start, rng = ground(seed)
    expected, (search, _) = cheapest_costs(cost, start), search_of(cost, start)
    reached = np.argwhere(np.isfinite(expected))
    for _ in range(3):
        some = reached[rng.integers(0, len(reached), rng.integers(1, 5))]
        most = rng.choice([0.0, 3.0, 10.0, np.inf], len(some))
        costs, theirs = search.costs_to(some + 1, most), expected[some[:, 0], some[:, 1]]
        assert ((costs == theirs) | ((costs == np.inf) & (theirs > most))).all()


@settings(max_examples=80, deadline=None)
@given(seeds, st.floats(0.0, 20.0))
def test_what_costs_more_than_anybody_asks_for_is_not_looked_for(seed, most):
    cost, start, _ = ground(seed)
    expected, (search, found) = cheapest_costs(cost, start), search_of(cost, start)
    reached = np.argwhere(np.isfinite(expected))
    search.costs_to(reached + 1, np.full(len(reached), most))
    a_step = np.sqrt(2.0) * cost[np.isfinite(cost)].max()
    assert (found[1:-1, 1:-1][expected > most + 2.0 * a_step] == np.inf).all()


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_a_search_that_goes_on_finds_what_one_search_finds_and_tells_whether_there_is_more(seed):
    cost, start, rng = ground(seed)
    expected, (search, found) = cheapest_costs(cost, start), search_of(cost, start)
    for _ in range(4):
        row, column = (int(rng.integers(0, n)) for n in cost.shape)
        if rng.integers(2):
            search.reach_cell(row + 1, column + 1)
            assert found[row + 1, column + 1] == expected[row, column]
            continue
        most = rng.uniform(0.0, 40.0)
        assert search.reach(most) == bool((expected[np.isfinite(expected)] > most).any())
        near = expected <= most
        assert (found[1:-1, 1:-1][near] == expected[near]).all() and (found[1:-1, 1:-1][~near] > most).all()
        first_row, end_row, first_column, end_column = search.window
        inside = np.zeros(found.shape, dtype=bool)
        inside[first_row:end_row, first_column:end_column] = True
        assert inside[1:-1, 1:-1][near].all()
        inside[first_row - 1 : end_row + 1, first_column - 1 : end_column + 1] = True
        assert (found[~inside] == np.inf).all()


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
