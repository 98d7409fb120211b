# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Frontiers are where the body could go on, and nowhere else."""

import numpy as np
import pytest
from scipy import ndimage
from skimage.measure import label, regionprops

from sonar_explore.mapping.frontiers import find_frontiers, passable
from sonar_explore.mapping.grid import FREE, OCCUPIED, UNKNOWN, GridFrame
from sonar_explore.mapping.occupancy import OccupancyGrid

FRAME = GridFrame(-1.0, -2.0, 0.05, (80, 120))
BODY_M = 0.18
X, Y = np.moveaxis(FRAME.centres(np.argwhere(np.ones(FRAME.shape))).reshape(*FRAME.shape, 2), -1, 0)


def corridor(half_m, seen_to_m, open_end=True):
    """A corridor from x = 0 to 3, known as far as it was seen."""
    states = np.full(FRAME.shape, UNKNOWN, dtype=np.uint8)
    known = (seen_to_m > X) & (X > -0.05) & (np.abs(Y) < half_m + 0.05)
    states[known] = OCCUPIED
    states[known & (X > 0.0) & (np.abs(Y) < half_m)] = FREE
    if not open_end:
        states[(np.abs(X - seen_to_m) < 0.04) & (np.abs(Y) < half_m + 0.05)] = OCCUPIED
    return OccupancyGrid(FRAME, states)


@pytest.mark.parametrize("half_m", [0.4, 0.8, 1.2])
@pytest.mark.parametrize("seen_to_m", [1.0, 2.5])
def test_the_open_end_of_a_corridor_is_the_only_frontier(half_m, seen_to_m):
    (frontier,) = find_frontiers(corridor(half_m, seen_to_m), BODY_M, 0.15)
    assert frontier.centroid == pytest.approx((seen_to_m, 0.0), abs=0.06)
    assert frontier.length_m(FRAME.resolution_m) == pytest.approx(2.0 * (half_m - BODY_M), abs=0.15)


@pytest.mark.parametrize("half_m", [0.4, 0.8, 1.2])
def test_a_closed_mapped_room_has_none(half_m):
    assert find_frontiers(corridor(half_m, 2.0, open_end=False), BODY_M, 0.15) == ()


def test_a_gap_that_the_body_cannot_pass_is_no_frontier():
    grid = corridor(0.8, 2.0, open_end=False)
    for gap, count in ((0.30, 0), (0.70, 1)):
        states = grid.states.copy()
        end = (np.abs(X - 2.0) < 0.04) & (np.abs(Y) < 0.5 * gap)
        states[end] = FREE
        assert len(find_frontiers(OccupancyGrid(FRAME, states), BODY_M, 0.15)) == count


def test_every_frontier_cell_is_free_passable_and_beside_the_unknown():
    grid = corridor(1.0, 2.0)
    way = passable(grid, BODY_M)
    for frontier in find_frontiers(grid, BODY_M, 0.15):
        for row, column in frontier.cells:
            assert grid.states[row, column] == FREE and way[row, column]
            assert (grid.states[row - 1 : row + 2, column - 1 : column + 2] == UNKNOWN).any()


@pytest.mark.parametrize("seed", range(8))
def test_frontiers_are_the_regions_that_dilating_the_unknown_gives(seed):
    rng = np.random.default_rng(seed)
    states = ndimage.zoom(rng.choice([UNKNOWN, FREE, FREE, OCCUPIED], (8, 12)), 10, order=0).astype(np.uint8)
    grid = OccupancyGrid(FRAME, states)
    way = passable(grid, BODY_M)
    beside = ndimage.binary_dilation((states == UNKNOWN) & way, np.ones((3, 3)))
    regions = regionprops(label((states == FREE) & way & beside, connectivity=2))
    expected = {r.coords.tobytes() for r in regions if len(r.coords) * FRAME.resolution_m >= 0.15}
    assert {f.cells.tobytes() for f in find_frontiers(grid, BODY_M, 0.15)} == expected


@pytest.mark.parametrize("seed", range(12))
def test_frontiers_of_one_map_after_another_are_those_of_each_map_alone(seed):
    rng, kept = np.random.default_rng(seed), dict[str, object]()
    states = ndimage.zoom(rng.choice([UNKNOWN, FREE, FREE, OCCUPIED], (5, 6)), 9, order=0).astype(np.uint8)
    frame = GridFrame(0.0, 0.0, 0.05, states.shape)
    grids: list[OccupancyGrid] = []
    for _ in range(5):
        grids.append(OccupancyGrid(frame, states.copy(), kept))
        for grid in (grids[-1], *rng.permutation(np.array(grids, dtype=object))[:1]):  # an older one, too
            alone = find_frontiers(OccupancyGrid(grid.frame, grid.states), BODY_M, 0.15)
            going_on = find_frontiers(grid, BODY_M, 0.15)
            assert [f.cells.tolist() for f in going_on] == [f.cells.tolist() for f in alone]
        more = rng.integers(0, 4, (2, 2)) * rng.integers(0, 2, (2, 2))  # the map grows
        states = np.pad(states, more)
        frame = GridFrame(
            frame.x0 - 0.05 * more[1, 0],
            frame.y0 - 0.05 * more[0, 0],
            0.05,
            (states.shape[0], states.shape[1]),
        )
        row, column = rng.integers(0, states.shape)
        states[row : row + 9, column : column + 9] = rng.integers(3)
