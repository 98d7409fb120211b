"""Generated worlds: always the same, closed, and wide enough for the robot with 15 cm to spare."""

import subprocess
import sys

import numpy as np
import pytest
import shapely

from sonar_explore.envs.generator import KINDS, generate, layouts
from sonar_explore.envs.load import draw_world, is_generator, load_world
from sonar_explore.envs.room import loops, room_for
from sonar_explore.envs.validation import validate
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError

SEEDS = range(25)
CASES = [(kind, difficulty) for kind in KINDS for difficulty in (0.0, 0.5, 1.0)]


def free_space(world: World) -> shapely.Polygon:
    rings = shapely.get_parts(shapely.polygonize(list(shapely.linestrings(world.walls.reshape(-1, 2, 2)))))
    start = shapely.Point(world.start.x, world.start.y)
    (face,) = [ring for ring in rings if ring.contains(start)]
    columns = [shapely.Point(x, y).buffer(r, quad_segs=32) for x, y, r in world.cylinders.tolist()]
    return face.difference(shapely.union_all(columns))


@pytest.mark.parametrize(("kind", "difficulty"), CASES)
def test_every_world_is_sound(kind: str, difficulty: float) -> None:
    for seed in SEEDS:
        world = validate(generate(kind, seed, difficulty))
        free = free_space(world)  # closed: its outline is a ring with the start inside
        body = shapely.buffer(free, -0.33, quad_segs=32)
        assert isinstance(body, shapely.Polygon), (
            world.name,
            "a robot with 15 cm to spare is shut out somewhere",
        )
        assert body.contains(shapely.Point(world.start.x, world.start.y)), world.name
        ends = np.round(np.concatenate([world.walls[:, :2], world.walls[:, 2:]]), 6)
        _, count = np.unique(ends, axis=0, return_counts=True)
        assert (count % 2 == 0).all(), (world.name, "walls meet at their ends")
        assert np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T).min() > 0.001, world.name


@pytest.mark.parametrize(("kind", "difficulty"), CASES)
def test_doors_are_wide_enough_and_join_all_rooms(kind: str, difficulty: float) -> None:
    for seed in SEEDS:
        layout = KINDS[kind](np.random.default_rng(seed), difficulty)
        assert all(door.width_m >= 0.8 for door in layout.doors)
        joined = {0}
        for _ in layout.rooms:
            joined |= {room for door in layout.doors if set(door.rooms) & joined for room in door.rooms}
        assert joined == set(range(len(layout.rooms)))
        area = shapely.union_all([room.shape for room in layout.rooms]).area
        assert area == pytest.approx(sum(room.shape.area for room in layout.rooms))  # no two overlap


@pytest.mark.parametrize("kind", KINDS)
def test_has_loop_agrees_with_the_lattice(kind: str) -> None:
    agree = []
    for seed in range(20):
        world = generate(kind, seed)
        room = room_for(world.walls, world.cylinders)
        reachable = room.reachable(world.start.x, world.start.y, 0.18)
        agree.append((loops(reachable, room.cell_m) > 0) == world.has_loop)
    assert np.mean(agree) >= 0.9  # blocks of very nearly 1 m2 may differ


def test_the_same_name_is_the_same_world_in_another_process_too() -> None:
    program = (
        "from sonar_explore.envs.load import load_world; import hashlib; "
        "w = load_world('generated/office-17'); print(hashlib.sha256(w.walls.tobytes()).hexdigest(), w.start)"
    )
    runs = {
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout for _ in "ab"
    }
    assert len(runs) == 1 and runs.pop().strip()
    one, other = load_world("generated/office-17"), generate("office", 17)
    assert one.walls.tobytes() == other.walls.tobytes() and one.start == other.start
    assert one.walls.tobytes() != generate("office", 18).walls.tobytes()


def test_a_world_whose_edges_nearly_meet_is_made_like_any_other() -> None:
    world = load_world("generated/home-100?difficulty=1")
    room = room_for(world.walls, world.cylinders)
    assert room.reachable(world.start.x, world.start.y, 0.18).any()


def test_global_random_state_is_left_alone() -> None:
    np.random.seed(3)  # noqa: NPY002
    before = np.random.get_state()[1].tolist()  # type: ignore[index] # noqa: NPY002
    generate("home", 5)
    assert np.random.get_state()[1].tolist() == before  # type: ignore[index] # noqa: NPY002


def test_a_generator_draws_ever_new_worlds_that_their_names_bring_back() -> None:
    assert is_generator("generated/office") and is_generator("generated/office?difficulty=0.2")
    assert not is_generator("generated/office-17") and not is_generator("paper/rooms")
    rng = np.random.default_rng(1)
    drawn = [draw_world("generated/maze?difficulty=0.2", rng) for _ in range(5)]
    assert len({world.name for world in drawn}) == 5
    for world in drawn:
        assert load_world(world.name).walls.tobytes() == world.walls.tobytes()
    again = draw_world("generated/maze?difficulty=0.2", np.random.default_rng(1))
    assert again.name == drawn[0].name


def test_names_say_kind_seed_and_difficulty() -> None:
    assert load_world("generated/home").name == "generated/home-0"
    assert load_world("generated/home?seed=4&difficulty=0.9").name == "generated/home-4?difficulty=0.9"
    assert load_world("generated/home-4?difficulty=0.9").name == "generated/home-4?difficulty=0.9"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("generated/castle", "known: generated/hall, generated/home, generated/maze, generated/office"),
        ("generated/office-x", "unknown world"),
        ("generated/office?difficulty=2", "0 to 1"),
        ("generated/office?difficulty=nan", "0 to 1"),
        ("generated/office?seed=-1", "seed -1"),
        ("generated/office?seed=x", "no number"),
        ("generated/office?colour=red", "unknown option 'colour'"),
        ("generated/office-99999999999999999999", "unknown world"),
    ],
)
def test_a_bad_name_is_one_line(name: str, expected: str) -> None:
    with pytest.raises(SonarExploreError) as caught:
        load_world(name)
    assert expected in str(caught.value) and "\n" not in str(caught.value)


def test_a_harder_world_is_larger_and_fuller() -> None:
    def mean(difficulty: float) -> float:
        return float(np.mean([len(generate("office", seed, difficulty).walls) for seed in range(15)]))

    assert mean(0.0) < mean(0.5) < mean(1.0)


def test_a_door_cuts_a_hole_of_its_width() -> None:
    door = layouts.Door((0, 1), (1.0, 2.0), (0.0, 1.0), 0.85)
    assert door.hole().bounds == pytest.approx((0.92, 1.575, 1.08, 2.425))
