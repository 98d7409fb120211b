"""Scores, in worlds small enough to know the answer by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sonar_explore.envs.load import load_world
from sonar_explore.envs.world import World
from sonar_explore.episodes.scoring import FREE, OCCUPIED, Scorer, cast_rays, clearance_on
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

RES = 0.05
States = NDArray[np.uint8]


def box(x1: float, y1: float, x2: float, y2: float) -> list[list[float]]:
    return [[x1, y1, x2, y1], [x2, y1, x2, y2], [x2, y2, x1, y2], [x1, y2, x1, y1]]


def world(
    walls: list[list[float]],
    start: tuple[float, float] = (1.0, 1.0),
    cylinders: list[list[float]] | None = None,
) -> World:
    return World(
        name="test",
        title="Test",
        walls=np.array(walls, dtype=float),
        roughness=np.zeros(len(walls)),
        cylinders=np.array(cylinders or [], dtype=float).reshape(-1, 3),
        start=Pose(*start, 0.0),
        has_loop=False,
    )


def drawn_room(shift: tuple[float, float] = (0.0, 0.0)) -> tuple[States, tuple[float, float]]:
    """A map of the 2 x 2 m room: free inside, a ring of occupied cells whose middles lie on its walls."""
    states = np.full((41, 41), OCCUPIED, dtype=np.uint8)
    states[1:-1, 1:-1] = FREE
    return states, (-RES / 2 + shift[0], -RES / 2 + shift[1])


ROOM = world(box(0, 0, 2, 2))


def test_the_robot_can_reach_a_room_less_its_own_radius_along_the_walls() -> None:
    assert Scorer(ROOM, resolution_m=0.01).reachable_area_m2 == pytest.approx((2 - 2 * 0.18) ** 2, abs=0.05)


def test_a_room_behind_a_door_too_narrow_cannot_be_reached() -> None:
    for door, reached in ((0.30, False), (0.50, True)):
        wall = [[2, 0, 2, 1 - door / 2], [2, 1 + door / 2, 2, 2]]
        area = Scorer(world(box(0, 0, 4, 2) + wall)).reachable_area_m2
        assert (area > 4.0) == reached


def test_an_empty_room_seen_from_its_middle_is_wholly_explored() -> None:
    assert Scorer(ROOM).explored_fraction(np.array([[1.0, 1.0]])) == 1.0


def test_nothing_is_explored_without_a_scan() -> None:
    assert Scorer(ROOM).explored_fraction(np.empty((0, 2))) == 0.0


def test_a_scan_explores_no_farther_than_2_m() -> None:
    scorer = Scorer(world(box(0, 0, 10, 1), start=(0.5, 0.5)))
    mask = scorer.explored_mask_from(0.5, 0.5)
    seen = scorer.lattice.middles(mask)
    assert seen[:, 0].max() == pytest.approx(2.5, abs=RES)
    assert scorer.explored_fraction(np.array([[0.5, 0.5]])) == pytest.approx(2.3 / 9.64, abs=0.02)


def test_a_wall_hides_what_is_behind_it() -> None:
    scorer = Scorer(world([*box(0, 0, 2, 2), [1.0, 0.0, 1.0, 1.3]], start=(0.4, 0.4)))
    seen = scorer.lattice.middles(scorer.explored_mask_from(0.4, 0.4))
    # The line of sight over the end of the wall rises by 0.9 m in 0.6 m.
    behind = seen[seen[:, 0] > 1.0]
    assert (behind[:, 1] > 0.4 + 1.5 * (behind[:, 0] - 0.4) - 0.05).all()
    assert scorer.explored_fraction(np.array([[0.4, 0.4]])) < 0.75


def plain_ranges(x: float, y: float, walls: Array) -> Array:
    """All rays and all walls at once."""
    angle = np.arange(720) * (2 * np.pi / 720)
    ux, uy = np.cos(angle), np.sin(angle)
    (ax, ay), (bx, by) = (
        walls[:, end : end + 2].T[:, :, None] - np.array([x, y])[:, None, None] for end in (0, 2)
    )
    side_a, side_b = ux * ay - uy * ax, ux * by - uy * bx
    crosses = (side_a * side_b <= 0.0) & (side_a != side_b)
    share = np.divide(side_a, side_a - side_b, out=np.zeros_like(side_a), where=crosses)
    along = ux * (ax + share * (bx - ax)) + uy * (ay + share * (by - ay))
    met: Array = np.where(crosses & (along >= 0.0), along, np.inf).min(axis=0, initial=2.0)
    return met


@pytest.mark.parametrize("seed", range(20))
def test_rays_end_at_the_nearest_wall(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1.0, 1.0, 2)
    walls = rng.uniform(-3.0, 3.0, (rng.integers(0, 12), 4)).round(rng.integers(0, 3))
    walls = np.vstack([walls, [x, y, x + 1.0, y], [x - 1.0, y, x + 1.0, y], [2.0, 2.0, 2.0, 2.0]])
    walls = walls[: rng.integers(0, len(walls) + 1)]
    assert (cast_rays(x, y, walls, np.zeros((0, 3))) == plain_ranges(x, y, walls)).all()


def test_a_column_casts_a_shadow() -> None:
    ranges = cast_rays(0.0, 0.0, np.empty((0, 4)), np.array([[1.0, 0.0, 0.2]]))
    assert ranges[0] == pytest.approx(0.8)
    assert ranges[180] == 2.0 and ranges[360] == 2.0


def test_scans_add_up_to_the_fraction_of_all_of_them() -> None:
    scorer = Scorer(load_world("paper/bend"))
    places = np.array([[0.9, 0.0], [3.0, 0.0], [4.5, 0.1]])
    fractions = [scorer.add_scan(x, y) for x, y in places.tolist()]
    assert fractions == sorted(fractions)
    assert fractions[-1] == scorer.explored_fraction(places)
    scorer.reset()
    assert scorer.explored.sum() == 0


def test_a_right_map_of_the_room_recalls_every_wall_without_error() -> None:
    states, origin = drawn_room()
    scorer = Scorer(ROOM)
    assert scorer.wall_recall(states, origin, RES) == 1.0
    assert scorer.wall_error(states, origin, RES) == pytest.approx(0.0, abs=1e-9)
    assert scorer.false_free_fraction(states, origin, RES) == 0.0


def test_a_map_shifted_by_7_cm_has_a_wall_error_of_7_cm_where_the_walls_lie_across() -> None:
    states = np.zeros((41, 41), dtype=np.uint8)
    states[10:30, [0, -1]] = OCCUPIED
    scorer = Scorer(ROOM)
    assert scorer.wall_error(states, (-RES / 2 + 0.07, -RES / 2), RES) == pytest.approx(0.07, abs=1e-6)


def test_a_map_shifted_into_a_wall_calls_cells_free_that_are_not() -> None:
    states, origin = drawn_room(shift=(0.20, 0.0))
    # Of 39 free columns the last four reach to or beyond the wall.
    expected = 4 / 39
    assert Scorer(ROOM).false_free_fraction(states, origin, RES) == pytest.approx(expected, abs=0.01)


def test_one_drawn_wall_of_four_recalls_a_quarter() -> None:
    states, origin = drawn_room()
    states[1:] = 0
    recall = Scorer(ROOM).wall_recall(states, origin, RES)
    assert recall == pytest.approx((2.0 + 2 * 0.10) / 8.0, abs=0.02)


def test_a_map_without_walls_recalls_none_and_has_no_error() -> None:
    empty = np.zeros((10, 10), dtype=np.uint8)
    scorer = Scorer(ROOM)
    assert scorer.wall_recall(empty, (0.0, 0.0), RES) == 0.0
    assert scorer.wall_error(empty, (0.0, 0.0), RES) is None
    assert scorer.false_free_fraction(empty, (0.0, 0.0), RES) == 0.0


def test_walls_that_cannot_be_reached_do_not_count_for_recall() -> None:
    # The wall across the room is seen from one side only; the room beyond it is shut off.
    scorer = Scorer(world(box(0, 0, 4, 2) + [[2, 0, 2, 2]]))
    _, lengths = scorer._reachable_wall
    assert lengths.sum() == pytest.approx(8.0, abs=0.1)


def test_a_thin_wall_counts_once_though_both_sides_can_be_reached() -> None:
    scorer = Scorer(world([*box(0, 0, 3, 3), [1.5, 0.0, 1.5, 1.5]]))
    _, lengths = scorer._reachable_wall
    assert lengths.sum() == pytest.approx(12.0 + 1.5, abs=0.1)


def test_a_wall_drawn_twice_counts_once() -> None:
    walls = box(0, 0, 2, 2)
    once, twice = Scorer(world(walls)), Scorer(world(walls + [[0.5, 0, 1.5, 0]]))
    assert twice._reachable_wall[1].sum() == pytest.approx(once._reachable_wall[1].sum())


def test_the_far_side_of_a_solid_block_is_reached_but_not_its_inside() -> None:
    scorer = Scorer(world(box(0, 0, 4, 4) + box(1.5, 1.5, 2.5, 2.5)))
    assert scorer._reachable_wall[1].sum() == pytest.approx(16.0 + 4.0, abs=0.1)
    states = np.full((80, 80), FREE, dtype=np.uint8)
    expected = (20 * 20) / 6400
    assert scorer.false_free_fraction(states, (0.0, 0.0), RES) == pytest.approx(expected)


def test_free_cells_outside_the_building_are_false() -> None:
    states = np.full((20, 20), FREE, dtype=np.uint8)
    assert Scorer(ROOM).false_free_fraction(states, (5.0, 5.0), RES) == 1.0


@pytest.mark.parametrize("radius", [0.1, 0.3])
def test_cells_inside_a_column_are_not_free(radius: float) -> None:
    scorer = Scorer(world(box(0, 0, 2, 2), start=(0.4, 0.4), cylinders=[[1.2, 1.2, radius]]))
    states = np.full((40, 40), FREE, dtype=np.uint8)
    false_area = scorer.false_free_fraction(states, (0.0, 0.0), RES) * 4.0
    assert np.pi * radius**2 < false_area < np.pi * (radius + 2 * RES) ** 2


def test_occupied_cells_on_a_column_have_no_error() -> None:
    scorer = Scorer(world(box(0, 0, 4, 4), cylinders=[[2.0, 2.0, 0.5]]))
    states = np.zeros((1, 1), dtype=np.uint8) + OCCUPIED
    error = scorer.wall_error(states.astype(np.uint8), (2.5 - RES / 2, 2.0 - RES / 2), RES)
    assert error == pytest.approx(0.0, abs=1e-9)


def test_a_grid_or_resolution_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(SonarExploreError, match="shape"):
        Scorer(ROOM).wall_error(np.zeros(4, dtype=np.uint8), (0.0, 0.0), RES)
    with pytest.raises(SonarExploreError, match="scoring at 0"):
        Scorer(ROOM, resolution_m=0.0)


@settings(deadline=None, max_examples=40)
@given(shift_x=st.floats(-0.05, 0.05), shift_y=st.floats(-0.05, 0.05))
def test_where_the_map_s_cells_lie_does_not_matter(shift_x: float, shift_y: float) -> None:
    """A map that calls free just what lies inside the walls is right, wherever its lattice lies."""
    origin = (-0.3 + shift_x, -0.3 + shift_y)
    x = origin[0] + (np.arange(54) + 0.5) * RES
    y = origin[1] + (np.arange(54) + 0.5) * RES
    inside = (np.minimum(y, 2 - y) > RES / 2)[:, None] & (np.minimum(x, 2 - x) > RES / 2)[None, :]
    states = np.where(inside, FREE, 0).astype(np.uint8)
    assert Scorer(ROOM).false_free_fraction(states, origin, RES) == 0.0


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_clearance_on_the_lattice_is_exact_up_to_its_cap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls: Array = rng.uniform(0.0, 4.0, (6, 4))
    random_world = world(walls.tolist(), cylinders=[[*rng.uniform(0.0, 4.0, 2), 0.2]])
    lattice = Scorer(ROOM).lattice
    every = np.ones(lattice.shape, dtype=bool)
    expected = np.minimum(random_world.clearance(lattice.middles(every)), 0.3)
    assert clearance_on(random_world, lattice, 0.3).ravel() == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=25)
@given(x=st.floats(0.3, 8.7), y=st.floats(0.3, 1.3))
def test_what_is_seen_is_reachable_and_within_range(x: float, y: float) -> None:
    scorer = Scorer(load_world("paper/rooms"))
    mask = scorer.explored_mask_from(x, y)
    assert not (mask & ~scorer.reachable).any()
    assert (np.hypot(*(scorer.lattice.middles(mask) - (x, y)).T) <= 2.0 + 1e-5).all()
