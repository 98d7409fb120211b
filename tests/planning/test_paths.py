# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A path never touches what is not known to be free, and keeps its room."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from sonar_explore.errors import SonarExploreError
from sonar_explore.mapping.grid import FREE, OCCUPIED, UNKNOWN, GridFrame
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.planning.paths import (
    PlanningConfig,
    SafePaths,
    clearance,
    path_length,
    sampled,
    straightened,
)

BODY_M, CONFIG = 0.18, PlanningConfig()
LEAST_M = BODY_M + CONFIG.margin_m
FRAME = GridFrame(-1.0, 0.5, 0.05, (70, 80))
seeds = st.integers(0, 10_000)


def cluttered(seed):
    """A closed room with boxes and unknown patches, and a roomy place to start from."""
    rng = np.random.default_rng(seed)
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    for kind in rng.choice([OCCUPIED, UNKNOWN], 7):
        row, column = rng.integers(0, 60, 2)
        height, width = rng.integers(1, 25, 2) if rng.random() < 0.5 else (1, 30)
        states[row : row + height, column : column + width] = kind
    states[[0, -1]] = OCCUPIED
    states[:, [0, -1]] = OCCUPIED
    grid = OccupancyGrid(FRAME, states)
    room = clearance(grid, CONFIG)
    roomy = np.argwhere(room >= BODY_M + 0.3)
    assume(len(roomy) > 0)
    x, y = FRAME.centres(roomy[[rng.integers(len(roomy))]])[0]
    return grid, x, y, rng


def some_paths(paths, rng, count=6):
    cells = np.argwhere(paths.within)
    for x, y in FRAME.centres(cells[rng.integers(len(cells), size=count)]):
        path = paths.to(x, y)
        assert path is not None and path[-1] == pytest.approx((x, y))
        yield path


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_a_path_keeps_its_clearance_at_every_cell(seed):
    grid, x, y, rng = cluttered(seed)
    paths = SafePaths(grid, x, y, BODY_M, CONFIG)
    for path in some_paths(paths, rng):
        cells = FRAME.cells(path)
        assert (paths.room_m[cells[:, 0], cells[:, 1]] >= LEAST_M).all()
        assert (grid.states[cells[:, 0], cells[:, 1]] != OCCUPIED).all()
        assert np.abs(np.diff(cells, axis=0)).max(initial=0) <= 1


@settings(max_examples=40, deadline=None)
@given(seeds)
@example(7813)
def test_straightening_keeps_the_least_room_and_the_ends_and_lengthens_nothing(seed):
    grid, x, y, rng = cluttered(seed)
    paths = SafePaths(grid, x, y, BODY_M, CONFIG)
    for path in some_paths(paths, rng):
        straight = straightened(path, paths.room_m, FRAME)
        assert (straight[[0, -1]] == path[[0, -1]]).all()
        assert path_length(straight) <= path_length(path) + 1e-9
        cells = FRAME.cells(sampled(straight, FRAME.resolution_m))
        assert paths.room_m[cells[:, 0], cells[:, 1]].min() >= LEAST_M


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_just_the_roomy_cells_joined_to_the_start_are_within(seed):
    grid, x, y, _ = cluttered(seed)
    paths = SafePaths(grid, x, y, BODY_M, CONFIG)
    regions, _ = ndimage.label(paths.room_m >= LEAST_M)
    joined = regions == regions[FRAME.cell(x, y)]
    assert (paths.within & joined).sum() == joined.sum()
    assert (np.isfinite(paths.cost_m) | ~paths.within).all()


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_the_daring_reach_no_less(seed):
    grid, x, y, _ = cluttered(seed)
    careful, daring = (SafePaths(grid, x, y, BODY_M, CONFIG, daring=d) for d in (False, True))
    assert (daring.within | ~careful.within).all()
    cells = np.argwhere(daring.within)
    assert (grid.to_walls_m[cells[:, 0], cells[:, 1]] >= BODY_M + CONFIG.daring_margin_m).all()


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_a_start_without_room_is_left_by_the_sides_of_cells_that_are_no_walls(seed):
    """Until it has room a path stays near the start, enters no wall, and passes none at a corner."""
    grid, x, y, rng = cluttered(seed)
    tight = np.argwhere((clearance(grid, CONFIG) < LEAST_M) & (grid.states != OCCUPIED))
    start = tight[rng.integers(len(tight))]
    x, y = FRAME.centres(start[None])[0]
    paths = SafePaths(grid, x, y, BODY_M, CONFIG)
    assume(paths.within.any())
    for path in some_paths(paths, rng):
        cells = FRAME.cells(path)
        assert (cells[0] == start).all() and (grid.states[cells[:, 0], cells[:, 1]] != OCCUPIED).all()
        cramped = cells[paths.room_m[cells[:, 0], cells[:, 1]] < LEAST_M]
        assert np.hypot(*(cramped - start).T).max() * FRAME.resolution_m <= CONFIG.escape_m + 1e-9
        for (row, column), (next_row, next_column) in pairwise(cells):
            assert OCCUPIED not in (grid.states[row, next_column], grid.states[next_row, column])


def test_no_start_leads_through_a_wall_that_is_whole_at_its_corners_alone():
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    for row in range(1, 69):  # a slanting wall, its cells touch at their corners
        states[row, row + 5] = OCCUPIED
    states[[0, -1]] = OCCUPIED
    grid = OccupancyGrid(FRAME, states)
    for column in range(36, 42):
        x, y = FRAME.centres(np.array([[35, column]]))[0]
        if states[35, column] == OCCUPIED:
            continue
        within = SafePaths(grid, x, y, BODY_M, CONFIG, daring=True).within
        rows, columns = np.nonzero(within)
        assert (np.sign(columns - rows - 5) == np.sign(column - 40)).all()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_a_start_with_room_is_left_with_room(seed):
    grid, x, y, _ = cluttered(seed)
    paths = SafePaths(grid, x, y, BODY_M, CONFIG)
    assert (paths.room_m[np.isfinite(paths.cost_m)] >= LEAST_M).all()


@pytest.mark.parametrize(("gap_m", "open_"), [(0.3, False), (0.4, False), (0.6, True), (0.9, True)])
def test_a_wall_is_passed_by_a_door_wide_enough_or_not_at_all(gap_m, open_):
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    states[:, 40] = OCCUPIED
    half = round(0.5 * gap_m / FRAME.resolution_m)
    states[35 - half : 35 + half, 40] = FREE
    path = SafePaths(OccupancyGrid(FRAME, states), 0.0, 2.2, BODY_M, CONFIG).to(2.5, 2.2)
    assert (path is not None) == open_


def test_a_path_keeps_to_the_middle_of_a_corridor():
    states = np.full(FRAME.shape, OCCUPIED, dtype=np.uint8)
    states[20:40] = FREE
    path = SafePaths(OccupancyGrid(FRAME, states), -0.6, 1.75, BODY_M, CONFIG).to(2.4, 1.75)
    assert path is not None
    middle = path[np.abs(path[:, 0] - 0.9) < 1.0, 1]
    assert np.abs(middle - 2.0).max() <= 0.1  # begun a quarter of a metre off it


@pytest.mark.parametrize(("weight", "within_hearing"), [(CONFIG.blind_weight, True), (1e-6, False)])
def test_a_way_across_a_hall_keeps_within_hearing_of_a_wall_where_that_is_little_longer(
    weight, within_hearing
):
    frame = GridFrame(0.0, 0.0, 0.05, (160, 240))
    states = np.full(frame.shape, FREE, dtype=np.uint8)
    states[[0, -1]] = states[:, [0, -1]] = OCCUPIED
    config = replace(CONFIG, blind_weight=weight)
    path = SafePaths(OccupancyGrid(frame, states), 1.0, 2.3, BODY_M, config).to(11.0, 2.3)
    assert path is not None
    on_the_way = path[np.abs(path[:, 0] - 6.0) < 3.0, 1]
    assert (on_the_way.max() <= CONFIG.blind_m + 0.1) == within_hearing


def test_specks_of_unknown_do_not_shut_free_space_but_walls_of_one_cell_do():
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    states[30:33, 30:33] = UNKNOWN
    assert clearance(OccupancyGrid(FRAME, states), CONFIG).min() > 0.0
    states[31, 31] = OCCUPIED
    assert clearance(OccupancyGrid(FRAME, states), CONFIG)[31, 31] < 0.0


def test_nothing_leads_off_the_map():
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    paths = SafePaths(OccupancyGrid(FRAME, states), 0.0, 2.0, BODY_M, CONFIG)
    assert paths.to(90.0, 2.0) is None


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=2, max_size=6), st.floats(0.02, 0.5))
def test_samples_lie_a_step_apart_on_the_way_and_include_its_corners(corners, step):
    path = np.array(corners)
    points = sampled(path, step)
    assert max(np.hypot(*(b - a)) for a, b in pairwise(points)) <= step + 1e-9
    assert path_length(points) == pytest.approx(path_length(path))
    assert all(np.abs(points - corner).sum(axis=1).min() < 1e-9 for corner in path)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_clearance_that_goes_on_from_map_to_map_is_what_one_map_alone_gives(seed):
    rng = np.random.default_rng(seed)
    states, kept = (
        rng.choice([UNKNOWN, FREE, FREE, FREE, FREE], FRAME.shape).astype(np.uint8),
        dict[str, object](),
    )
    for _ in range(5):
        expected = clearance(OccupancyGrid(FRAME, states), CONFIG)
        assert (clearance(OccupancyGrid(FRAME, states, kept), CONFIG) == expected).all()
        states = states.copy()
        row, column = rng.integers(0, states.shape)
        states[row : row + rng.integers(1, 12), column : column + rng.integers(1, 12)] = rng.integers(3)


@settings(max_examples=40, deadline=None)
@given(seeds, st.booleans())
def test_paths_that_are_looked_for_near_by_alone_are_those_of_all_paths(seed, daring):
    grid, x, y, rng = cluttered(seed)
    within_m = rng.uniform(0.5, 6.0)
    all_, near = (SafePaths(grid, x, y, BODY_M, CONFIG, daring, limit) for limit in (np.inf, within_m))
    close = all_.cost_m <= within_m
    assert (near.cost_m == np.where(close, all_.cost_m, np.inf)).all()
    assert (near.within == (all_.within & close)).all()
    for row, column in rng.permutation(np.argwhere(all_.within))[:5]:
        place = FRAME.centres(np.array([[row, column]]))[0]
        path, expected = near.to(*place), all_.to(*place) if close[row, column] else None
        assert (path is None) == (expected is None)
        assert path is None or expected is None or np.array_equal(path, expected)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_in_each_square_of_the_lattice_the_roomiest_place_to_drive_to_is_chosen(seed):
    grid, x, y, rng = cluttered(seed)
    paths, spacing = SafePaths(grid, x, y, BODY_M, CONFIG), rng.uniform(0.1, 0.6)
    usable = np.argwhere(paths.within & (grid.to_walls_m >= 0.38))
    squares = np.floor(FRAME.centres(usable)[:, ::-1] / spacing).astype(int).tolist()
    expected: dict = {}
    for (row, column), square in zip(usable.tolist(), squares, strict=True):
        room = round(paths.room_m[row, column] * 1e6)
        if room > expected.get(tuple(square), (-1,))[0]:
            expected[tuple(square)] = room, row, column
    found = paths.roomiest(grid.to_walls_m, 0.38, spacing).tolist()
    assert found == [list(expected[square][1:]) for square in sorted(expected)]


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_paths_on_one_map_after_another_are_those_of_each_map_alone(seed):
    rng = np.random.default_rng(seed)
    states, kept = np.zeros((40, 45), dtype=np.uint8), dict[str, object]()
    states[3:37, 3:40] = FREE
    for step in range(6):
        if step == 3:  # the map has grown
            states = np.pad(states, ((20, 0), (0, 20)))
        frame = GridFrame(0.0, 0.0, 0.05, states.shape)
        row, column = rng.integers(0, np.array(states.shape) - 12)
        states[row : row + rng.integers(1, 12), column : column + rng.integers(1, 12)] = rng.integers(3)
        x, y = frame.centres(rng.permutation(np.argwhere(states == FREE))[:1])[0]
        for _ in range(3):
            daring, within_m = bool(rng.integers(2)), rng.choice([np.inf, rng.uniform(0.5, 3.0)])
            going_on, alone = (
                SafePaths(OccupancyGrid(frame, states, known), x, y, BODY_M, CONFIG, daring, within_m)
                for known in (kept, dict[str, object]())
            )
            assert (going_on.cost_m == alone.cost_m).all()
            assert (going_on.within == alone.within).all()
            assert going_on.within_m == alone.within_m
        states = states.copy()


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_where_the_body_has_been_leads_through_what_is_drawn_there_and_nothing_else_does(seed):
    rng = np.random.default_rng(seed)
    states = np.full(FRAME.shape, FREE, dtype=np.uint8)
    states[:, 28:32] = rng.choice([OCCUPIED, UNKNOWN])
    grid = OccupancyGrid(FRAME, states)
    (x, ax), (y, ay) = (FRAME.x0 + rng.uniform((0.6, 2.3), (0.7, 2.4))), (FRAME.y0 + rng.uniform(0.6, 2.2, 2))
    been = np.array([[x, y], [FRAME.x0 + 1.5, rng.uniform(y - 0.3, y + 0.3)], [ax, ay]])
    for daring in (False, True):
        assert SafePaths(grid, x, y, BODY_M, CONFIG, daring).to(ax, ay) is None
        path = SafePaths(grid, x, y, BODY_M, CONFIG, daring, been=been).to(ax, ay)
        assert path is not None
        shut = path[states[tuple(FRAME.cells(path).T)] != FREE]
        way = sampled(been, 0.01)
        assert (
            len(shut) and max(np.hypot(*(way - place).T).min() for place in shut) <= 1.5 * FRAME.resolution_m
        )


def test_walls_cannot_be_taken_to_be_heard_from_farther_off_than_they_are_looked_for():
    with pytest.raises(SonarExploreError, match=r"blind_m is 2\.5; at most 2"):
        PlanningConfig(blind_m=2.5)
