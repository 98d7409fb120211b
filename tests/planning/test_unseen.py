# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What a scan would show: never more than there is, and the same whether it was looked at before or not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.mapping.frontiers import find_frontiers
from sonar_explore.mapping.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, window
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.planning.candidates import _away_from
from sonar_explore.planning.unseen import RAYS, new_area

FRAME = GridFrame(0.0, 0.0, 0.05, (90, 100))
BODY_M, VIEW_M = 0.18, 0.8
seeds = st.integers(0, 10_000)


def plainly_seen(grid, cell):
    """Ray by ray, cell by cell."""
    total, res = 0, grid.frame.resolution_m
    for ray in range(RAYS):
        angle = (ray + 0.5) * 2.0 * math.pi / RAYS
        for k in range(1, int(VIEW_M / res) + 1):
            row = cell[0] + int(np.round(k * math.sin(angle)))
            column = cell[1] + int(np.round(k * math.cos(angle)))
            if not (0 <= row < grid.frame.shape[0] and 0 <= column < grid.frame.shape[1]):
                break
            if grid.to_walls_m[row, column] <= BODY_M:
                break
            total += k * (grid.states[row, column] == UNKNOWN)
    return 2.0 * math.pi * res**2 / RAYS * total


def maps(rng, count=5):
    """One map after another: blocks change, and the frame grows now and then."""
    frame, states = FRAME, rng.choice([UNKNOWN, FREE], FRAME.shape).astype(np.uint8)
    states[:, rng.integers(20, 80)] = OCCUPIED
    kept: dict = {}
    for _ in range(count):
        yield OccupancyGrid(frame, states, kept)
        if rng.random() < 0.3:
            grown = frame.covering((-rng.uniform(0, 1), -rng.uniform(0, 1)), (5.0, 4.5 + rng.uniform(0, 1)))
            frame, states = grown, window(frame, states, grown)
        states = states.copy()
        row, column = rng.integers(0, states.shape)
        states[row : row + rng.integers(1, 9), column : column + rng.integers(1, 9)] = rng.integers(3)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_new_area_counts_the_unknown_disc_and_never_more(seed):
    rng = np.random.default_rng(seed)
    cells = np.array([[45, 50]])
    disc = math.pi * VIEW_M**2
    unknown = OccupancyGrid(FRAME, np.full(FRAME.shape, UNKNOWN, dtype=np.uint8))
    assert new_area(unknown, cells, BODY_M, VIEW_M)[0] == pytest.approx(disc, rel=0.15)
    unseen = rng.random(FRAME.shape) < rng.random()
    states = np.where(unseen, UNKNOWN, FREE).astype(np.uint8)
    part = new_area(OccupancyGrid(FRAME, states), cells, BODY_M, VIEW_M)[0]
    assert part == pytest.approx(disc * unseen.mean(), abs=0.2 * disc)
    shut = states.copy()
    shut[:, 56] = OCCUPIED
    assert new_area(OccupancyGrid(FRAME, shut), cells, BODY_M, VIEW_M)[0] <= part


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_new_area_is_that_of_the_plain_form_on_every_map_of_a_row(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 4.5, (6, 2))
    for grid in maps(rng):
        cells = grid.frame.cells(places)  # the same places on every map, and a new one
        cells[-1] = rng.integers(0, grid.frame.shape)
        expected = [plainly_seen(grid, cell) for cell in cells.tolist()]
        assert new_area(grid, cells, BODY_M, VIEW_M).tolist() == expected


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_what_goes_on_from_map_to_map_is_what_one_map_alone_gives(seed):
    for grid in maps(np.random.default_rng(seed)):
        alone = OccupancyGrid(grid.frame, grid.states)
        assert (grid.to_walls_m == alone.to_walls_m).all()
        found, expected = (find_frontiers(g, BODY_M, 0.1) for g in (grid, alone))
        assert [f.centroid for f in found] == [f.centroid for f in expected]
        assert all((f.cells == e.cells).all() for f, e in zip(found, expected, strict=True))


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_places_are_away_from_those_taken_by_distance(seed):
    rng = np.random.default_rng(seed)
    places, taken = (np.round(rng.uniform(0, 2, (n, 2)), 1) for n in rng.integers(0, 30, 2))
    far = np.hypot(*(places[:, None] - taken).transpose(2, 0, 1)).min(axis=1, initial=np.inf) >= 0.3
    assert (_away_from(places, taken, 0.3) == far).all()
