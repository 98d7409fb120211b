"""HouseExpo, ROS and MobileSim: the building that is drawn, or one line."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from world_files import MAP, YAML, error_of, map_image, written

from sonar_explore.envs.load import load_world
from sonar_explore.geometry import Pose

# HouseExpo


def test_houseexpo_jogs_are_drawn_straight(tmp_path: Path) -> None:
    verts = [[0.11, 0.1], [0.1, 0.11], [0.1, 3], [2, 3], [2, 1.5], [2.1, 1.5], [2.1, 3], [5, 3], [5, 0.1]]
    world = load_world(written(tmp_path, "home.json", json.dumps({"verts": verts, "id": "x", "room_num": 2})))
    assert len(world.walls) == 8
    assert world.bounds == pytest.approx((0.1, 0.1, 5.0, 3.0), abs=0.02)
    assert shapely.Polygon(world.walls[:, :2]).contains(shapely.Point(world.start.x, world.start.y))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{", "truncated"),
        ('{"verts": 3}', "Expected `array`"),
        ('{"verts": [[0, 0], [1, 1]]}', "2 corners"),
        ('{"verts": [[0, 0], [1e99, 0], [1, 1]]}', "no place in metres"),
        ('{"verts": [[0, 0], [1, 0], [2, 0]]}', "no room"),
        ('{"verts": [[0, 0], [0.2, 0], [0.2, 0.2], [0, 0.2]]}', "is the scale right"),
    ],
)
def test_a_broken_houseexpo_file_is_one_line(tmp_path: Path, text: str, expected: str) -> None:
    assert expected in error_of(written(tmp_path, "home.json", text))


# ROS


def test_a_ros_map_lies_where_its_origin_says(tmp_path: Path) -> None:
    map_image(tmp_path)
    world = load_world(written(tmp_path, "map.yaml", YAML))
    assert world.bounds == pytest.approx((-0.5, -1.5, 3.5, 0.5))
    turned = load_world(written(tmp_path, "turned.yaml", YAML.replace("-2.0, 0.0", f"-2.0, {math.pi / 2}")))
    assert turned.bounds == pytest.approx((-3.5, -1.5, -1.5, 2.5))


def test_places_in_errors_are_in_the_frame_of_the_map(tmp_path: Path) -> None:
    map_image(tmp_path)
    path = written(tmp_path, "map.yaml", YAML)
    assert "start (-0.90, -1.90) is inside a wall; free: (1.4" in error_of(f"{path}?start=-0.9,-1.9")
    assert "start (9.00, 9.00) is outside the image" in error_of(f"{path}?start=9,9")


def test_negate_turns_black_and_white_round(tmp_path: Path) -> None:
    map_image(tmp_path, free=1, wall=255, unknown=50)
    text = YAML.replace("negate: 0", "negate: 1")
    assert len(load_world(written(tmp_path, "map.yaml", text)).walls) == 4


def test_unknown_is_not_free(tmp_path: Path) -> None:
    map_image(tmp_path, unknown=205, wall=205)  # (255 - 205) / 255 = 0.196078 > 0.196
    assert load_world(written(tmp_path, "map.yaml", YAML)).bounds == pytest.approx((-0.5, -1.5, 3.5, 0.5))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("map.pgm", "/etc/passwd", "same folder"),
        ("map.pgm", "../map.pgm", "same folder"),
        ("map.pgm", "none.pgm", "map.yaml: there is no image 'none.pgm'"),
        ("resolution: 0.05", "resolution: -1", "> 0"),
        ("resolution: 0.05", "", "resolution"),
        ("[-1.0, -2.0, 0.0]", "[.nan, 0, 0]", "no place in metres"),
        ("[-1.0, -2.0, 0.0]", "[" * 200, "nested too deeply"),
        ("free_thresh: 0.196", "free_thresh: 0", "is free"),
        ("negate: 0", "negate: 2020-13-45", "map.yaml"),
        ("negate: 0", "negate: !!python/object/apply:os.system [ls]", "map.yaml"),
    ],
)
def test_a_broken_ros_map_is_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    map_image(tmp_path)
    assert expected in error_of(written(tmp_path, "map.yaml", YAML.replace(old, new)))


# MobileSim


def test_a_mobilesim_map_has_its_lines_home_and_clutter(tmp_path: Path) -> None:
    world = load_world(written(tmp_path, "lab.map", MAP))
    assert len(world.walls) == 4
    assert world.start == Pose(1.0, 1.5, math.pi / 2)
    assert world.cylinders == pytest.approx(np.array([[3.005, 2.005, 0.03]]))  # the wall explains the others


def test_boxes_forbidden_lines_and_sections_of_one_sensor_are_read(tmp_path: Path) -> None:
    more = (
        'Cairn: ForbiddenLine 1 2 0 "" ICON "" 2000 3000 3000 3000\n'
        'Cairn: Sim.BoxObstacle 0 0 90 "" ICON "" 1000 -5000 2000 -4500\nLINES\n'
    )
    text = MAP.replace("LINES\n", more, 1) + "Sick_LINES\n4000 1000 4000 2000\n"
    world = load_world(written(tmp_path, "lab.map", text))
    assert len(world.walls) == 4 + 1 + 4 + 1
    assert world.walls[1:5].reshape(-1, 2).max(axis=0) == pytest.approx([5.0, 2.0])


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("2D-Map", "3D-Map", "not '2D-Map'"),
        ("6000 0 6000 4000", "6000 0 6000", "line 7: expected 4 numbers"),
        ("6000 0 6000 4000", "6000 0 6000 1e999", "line 7: expected 4 numbers"),
        ("LINES", "LANES", "no LINES section"),
        ("RobotHome 1000", "RobotHome 90000", "lies outside the walls"),
    ],
)
def test_a_broken_mobilesim_map_is_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert expected in error_of(written(tmp_path, "lab.map", MAP.replace(old, new)))
