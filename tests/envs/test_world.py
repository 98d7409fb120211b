"""The world: shipped worlds, the native format, and errors that say what is possible."""

import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from sonar_explore.envs.load import load_world, shipped_worlds
from sonar_explore.envs.validation import nearest_free_place, validate
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

ROOM = """
title = "A room"
[start]
x = 1.0
y = 1.0
heading_deg = 90.0
[[wall]]
closed = true
points = [[0, 0], [3, 0], [3, 3], [0, 3]]
"""


def room(size: float = 3.0, start: Pose | None = None) -> World:
    ends = np.array([[0, 0], [size, 0], [size, size], [0, size], [0, 0]], dtype=float)
    return World(
        name="room",
        title="A room",
        walls=np.hstack([ends[:-1], ends[1:]]),
        roughness=np.zeros(4),
        cylinders=np.empty((0, 3)),
        start=start or Pose(1.0, 1.0, 0.0),
        has_loop=False,
    )


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(text)
    return path


def error_of(path: str | Path) -> str:
    with warnings.catch_warnings(), pytest.raises(SonarExploreError) as caught:
        warnings.simplefilter("error")
        load_world(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_the_five_worlds_of_the_paper_are_shipped() -> None:
    assert shipped_worlds() == (
        "paper/bend",
        "paper/corridor",
        "paper/loop",
        "paper/open-loop",
        "paper/rooms",
    )
    assert [load_world(name).has_loop for name in shipped_worlds()] == [False, False, True, True, False]


@pytest.mark.parametrize("name", shipped_worlds())
def test_a_shipped_world_is_closed_and_its_start_is_free(name: str) -> None:
    world = load_world(name)
    assert world.name == name
    faces = shapely.get_parts(shapely.polygonize(list(shapely.linestrings(world.walls.reshape(-1, 2, 2)))))
    start = shapely.Point(world.start.x, world.start.y)
    assert sum(face.contains(start) for face in faces) == 1
    assert world.clearance(np.array([[world.start.x, world.start.y]]))[0] >= 0.5


@pytest.mark.parametrize("name", shipped_worlds())
def test_every_passage_of_a_shipped_world_leaves_15_cm_on_each_side_of_the_robot(name: str) -> None:
    world = load_world(name)
    x_min, y_min, x_max, y_max = world.bounds
    xs, ys = np.meshgrid(np.arange(x_min, x_max, 0.04), np.arange(y_min, y_max, 0.04))
    clearance = world.clearance(np.column_stack([xs.ravel(), ys.ravel()])).reshape(xs.shape)
    tight, _ = ndimage.label(clearance >= 0.18)
    row, col = int((world.start.y - y_min) / 0.04), int((world.start.x - x_min) / 0.04)
    _, regions = ndimage.label((tight == tight[row, col]) & (clearance >= 0.33))
    assert regions == 1


@pytest.mark.parametrize("name", shipped_worlds())
def test_the_walls_of_a_shipped_world_meet_only_at_their_ends(name: str) -> None:
    walls = shapely.linestrings(load_world(name).walls.reshape(-1, 2, 2))
    first, second = shapely.STRtree(walls).query(walls, predicate="crosses")
    for one, other in zip(walls[first], walls[second], strict=True):
        ends = shapely.points(np.concatenate([shapely.get_coordinates(one), shapely.get_coordinates(other)]))
        meeting = shapely.intersection(one, other)
        assert shapely.distance(ends, meeting).min() < 1e-9, (one.wkt, other.wkt)


def test_the_bend_is_not_at_right_angles() -> None:
    corner = np.array([5.442, -0.850])
    walls = load_world("paper/bend").walls
    before = next(w for w in walls if np.allclose(w[2:], corner))
    after = next(w for w in walls if np.allclose(w[:2], corner))
    turn = math.atan2(after[3] - after[1], after[2] - after[0]) - math.atan2(
        before[3] - before[1], before[2] - before[0]
    )
    assert math.degrees(turn) == pytest.approx(55.0, abs=0.1)


def test_a_file_gives_walls_in_metres_and_a_start_in_radians(tmp_path: Path) -> None:
    world = load_world(written(tmp_path, ROOM))
    assert world.name == "my"
    assert world.walls.tolist() == [[0, 0, 3, 0], [3, 0, 3, 3], [3, 3, 0, 3], [0, 3, 0, 0]]
    assert world.start == Pose(1.0, 1.0, math.pi / 2)
    assert world.cylinders.shape == (0, 3)


def test_a_door_is_a_leaf_from_its_hinge_and_a_polygon_closes(tmp_path: Path) -> None:
    more = """
[[door]]
hinge = [3, 2]
width = 0.8
angle_deg = 180
[[polygon]]
points = [[2, 0], [2.3, 0], [2.15, 0.3]]
roughness = 0.5
[[cylinder]]
x = 0.3
y = 2.5
radius = 0.1
"""
    world = load_world(written(tmp_path, ROOM + more))
    assert world.walls[-1] == pytest.approx([3.0, 2.0, 2.2, 2.0])
    assert world.walls[6].tolist() == [2.15, 0.3, 2, 0]
    assert world.roughness.tolist() == [0, 0, 0, 0, 0.5, 0.5, 0.5, 0]
    assert world.cylinders.tolist() == [[0.3, 2.5, 0.1]]


def test_walls_of_no_length_are_dropped(tmp_path: Path) -> None:
    text = ROOM.replace("[3, 3],", "[3, 3], [3, 3],")
    assert len(load_world(written(tmp_path, text)).walls) == 4


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("title", "titel", "unknown field `titel`"),
        ('"A room"', "3", "Expected `str`, got `int` - at `$.title`"),
        ("x = 1.0", "x = ", "my.toml: no TOML: "),
        ("x = 1.0", "x = nan", "is no place in metres"),
        ("[0, 3]", "[0, inf]", "walls[2] is no place in metres"),
        ("[0, 3]", "[0, 1e300]", "walls[2] is no place in metres"),
        ("[0, 3]", "[0, 3000]", "3e+03 m across; at most 1000 m"),
        (
            "x = 1.0",
            "x = 0.1",
            "is 0.10 m from a wall or cylinder; the robot needs 0.18 m; free: (0.25, 1.00)",
        ),
        ("x = 1.0", "x = 40.0", "lies outside the walls"),
        ("[[0, 0], [3, 0], [3, 3], [0, 3]]", "[[0, 0]]", "length >= 2 - at `$.wall[0].points`"),
        ("closed = true", "roughness = 2.0", "<= 1.0 - at `$.wall[0].roughness`"),
        ("[[0, 0], [3, 0], [3, 3], [0, 3]]", "[[0, 0], [0, 0]]", "no walls"),
    ],
)
def test_a_broken_file_is_one_line_that_says_what_is_wrong(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    assert expected in error_of(written(tmp_path, ROOM.replace(old, new, 1)))


def test_a_start_inside_a_solid_block_is_refused(tmp_path: Path) -> None:
    block = "[[polygon]]\npoints = [[0.4, 0.4], [2, 0.4], [2, 2], [0.4, 2]]\n"
    assert "inside the solid polygon[0]" in error_of(written(tmp_path, ROOM + block))


def test_a_start_that_is_shut_in_is_refused_and_a_free_place_offered(tmp_path: Path) -> None:
    box = "[[wall]]\nclosed = true\npoints = [[0.75, 0.75], [1.25, 0.75], [1.25, 1.25], [0.75, 1.25]]\n"
    message = error_of(written(tmp_path, ROOM + box))
    assert "the robot is shut in; free: (" in message


def test_a_start_inside_a_column_is_refused(tmp_path: Path) -> None:
    column = "[[cylinder]]\nx = 1\ny = 1\nradius = 0.3\n"
    assert "is inside a cylinder" in error_of(written(tmp_path, ROOM + column))


def test_an_unknown_name_lists_the_known_ones() -> None:
    assert error_of("foor") == (
        "unknown world 'foor'; known: paper/bend, paper/corridor, paper/loop, paper/open-loop, paper/rooms, "
        "generated/..., or a file that ends in .toml, .json, .yaml, .yml, .map, .svg, .png, .pgm"
    )


def test_files_that_are_missing_empty_foreign_or_no_text_are_refused(tmp_path: Path) -> None:
    assert "no world file" in error_of(tmp_path / "missing.toml")
    assert "the world file is empty" in error_of(written(tmp_path, "\n"))
    (tmp_path / "plan.dwg").write_bytes(b"AC1015")
    assert "no reader for files that end in '.dwg'" in error_of(tmp_path / "plan.dwg")
    assert "is a folder; give a file in it" in error_of(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\x01")
    assert "binary.toml: no TOML, for it is no text in UTF-8" in error_of(tmp_path / "binary.toml")
    (tmp_path / "folder.toml").mkdir()
    assert "cannot read" in error_of(tmp_path / "folder.toml")


def test_too_many_walls_are_refused() -> None:
    world = room()
    many = replace(world, walls=np.tile(world.walls, (6000, 1)), roughness=np.zeros(24_000))
    with pytest.raises(SonarExploreError, match="24000 walls; at most 20000"):
        validate(many)


def test_a_start_that_walls_do_not_enclose_is_fine() -> None:
    world = room()
    assert len(validate(replace(world, walls=world.walls[:3], roughness=np.zeros(3))).walls) == 3


@given(
    x=st.floats(-1.0, 4.0),
    y=st.floats(-1.0, 4.0),
)
def test_clearance_is_the_distance_to_the_nearest_wall(x: float, y: float) -> None:
    expected = shapely.box(0, 0, 3, 3).exterior.distance(shapely.Point(x, y))
    assert room().clearance(np.array([[x, y]]))[0] == pytest.approx(expected, abs=1e-9)


@given(x=st.floats(0.0, 3.0), y=st.floats(0.0, 3.0))
def test_the_place_that_is_offered_is_a_valid_start(x: float, y: float) -> None:
    place = nearest_free_place(room(start=Pose(x, y, 0.0)))
    assert place is not None
    validate(room(start=Pose(*place, 0.0)))
