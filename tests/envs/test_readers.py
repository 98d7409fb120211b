"""Foreign formats: each becomes the building that is drawn, and bad files become one line in little time."""

import json
import math
import os
from pathlib import Path

import msgspec
import numpy as np
import pytest
import shapely
import skimage.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sonar_explore.envs import world as worlds
from sonar_explore.envs.readers.svg_path import flatten, parse_path
from sonar_explore.envs.readers.svg_transform import parse_transform
from sonar_explore.envs.readers.toml_world import world_schema
from sonar_explore.envs.survey import survey
from sonar_explore.envs.world import World, load_world
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="6m" height="4m" viewBox="0 0 600 400">{}</svg>'
ROOM = '<rect x="10" y="10" width="580" height="380"/>'
MAP = """2D-Map
LineMinPos: 0 0
NumLines: 7
Cairn: RobotHome 1000 1500 90 "" ICON "Home"
LINES
0 0 6000 0
6000 0 6000 4000
6000 4000 0 4000
0 4000 0 0
DATA
3000 2000
3010 2010
5990 1000
5990 1010
"""
YAML = """image: map.pgm
resolution: 0.05
origin: [-1.0, -2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
TOML = (
    'title = "t"\n[start]\nx = 1\ny = 1\n[[wall]]\npoints = [[0, 0], [3, 0], [3, 3], [0, 3]]\nclosed = true\n'
)


def written(tmp_path: Path, name: str, text: str | bytes) -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def map_image(tmp_path: Path, free: int = 254, wall: int = 0, unknown: int = 205) -> Path:
    image = np.full((60, 100), unknown, dtype=np.uint8)
    image[9:51, 9:91] = wall
    image[10:50, 10:90] = free
    skimage.io.imsave(tmp_path / "map.pgm", image, check_contrast=False)
    return tmp_path / "map.pgm"


def svg(tmp_path: Path, inside: str) -> World:
    return load_world(written(tmp_path, "plan.svg", SVG.format(inside)))


def error_of(path: str | Path) -> str:
    with pytest.raises(SonarExploreError) as caught:
        load_world(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


# HouseExpo


def test_houseexpo_jogs_are_drawn_straight(tmp_path: Path) -> None:
    verts = [[0.11, 0.1], [0.1, 0.11], [0.1, 3], [2, 3], [2, 1.5], [2.1, 1.5], [2.1, 3], [5, 3], [5, 0.1]]
    world = load_world(written(tmp_path, "home.json", json.dumps({"verts": verts, "id": "x", "room_num": 2})))
    assert len(world.walls) == 8
    assert world.bounds == pytest.approx((0.1, 0.1, 5.0, 3.0), abs=0.02)
    assert shapely.Polygon(world.walls[:, :2]).contains(shapely.Point(world.start.x, world.start.y))


def test_a_start_may_be_said_in_the_call_or_in_the_name(tmp_path: Path) -> None:
    path = written(tmp_path, "home.json", json.dumps({"verts": [[0, 0], [4, 0], [4, 3], [0, 3]]}))
    assert load_world(path).start.x == pytest.approx(2.0, abs=0.06)
    assert load_world(path, start=Pose(0.5, 0.6, 0.7)).start == Pose(0.5, 0.6, 0.7)
    assert load_world(f"{path}?start=0.5,0.6,90").start == Pose(0.5, 0.6, math.pi / 2)
    assert "takes no resolution" in error_of(f"{path}?resolution=2")
    assert "unknown option 'scale'" in error_of(f"{path}?scale=2")


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
        ("map.pgm", "none.pgm", "no world file"),
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


# SVG


def test_an_svg_is_in_metres_with_y_up(tmp_path: Path) -> None:
    inside = ROOM + '<circle cx="300" cy="100" r="20"/><line id="start" x1="100" y1="300" x2="100" y2="200"/>'
    world = svg(tmp_path, inside)
    assert world.bounds == pytest.approx((0.1, 0.1, 5.9, 3.9))
    assert world.cylinders == pytest.approx(np.array([[3.0, 3.0, 0.2]]))
    assert (world.start.x, world.start.y, world.start.heading) == pytest.approx((1.0, 1.0, math.pi / 2))


@pytest.mark.parametrize(
    "shape",
    [
        '<polygon points="200,100 300,100 300,200 200,200"/>',
        '<polyline points="200 100 300 100 300 200 200 200 200 100"/>',
        '<path d="M200,100h100v100H200z"/>',
        '<path d="m 200 100 100 0 0 100 -100 0 Z"/>',
        '<path d="M200 100L300 100 300 200 200 200V100"/>',
        '<g transform="translate(200 100)"><g transform="scale(2)"><rect width="50" height="50"/></g></g>',
        '<rect x="-300" y="100" width="100" height="100" transform="matrix(-1 0 0 1 0 0)"/>',
        '<rect x="100" y="-300" width="100" height="100" transform="rotate(90)"/>',
        '<defs><rect id="r" width="100" height="100"/></defs><use href="#r" x="200" y="100"/>',
        '<rect x="200" y="100" width="100" height="100"/><rect width="9" height="9" style="display: none"/>',
    ],
)
def test_a_square_is_a_square_however_it_is_drawn(tmp_path: Path, shape: str) -> None:
    walls = svg(tmp_path, ROOM + shape).walls[4:]
    faces = shapely.get_parts(shapely.polygonize(list(shapely.linestrings(walls.reshape(-1, 2, 2)))))
    assert len(faces) == 1
    assert faces[0].equals(shapely.box(2.0, 2.0, 3.0, 3.0)) or faces[0].symmetric_difference(
        shapely.box(2.0, 2.0, 3.0, 3.0)
    ).area == pytest.approx(0.0, abs=1e-9)


def test_the_scale_may_be_an_attribute_a_width_or_an_option(tmp_path: Path) -> None:
    room = '<rect x="0" y="0" width="500" height="400"/></svg>'
    said = written(tmp_path, "a.svg", f'<svg data-metres-per-unit="0.02" viewBox="0 0 500 400">{room}')
    assert load_world(said).bounds == pytest.approx((0, 0, 10, 8))
    wide = written(tmp_path, "b.svg", f'<svg width="5000mm" height="4000mm" viewBox="0 0 500 400">{room}')
    assert load_world(wide).bounds == pytest.approx((0, 0, 5, 4))
    none = written(tmp_path, "c.svg", f'<svg width="500" height="400">{room}')
    assert "no scale" in error_of(none)
    assert load_world(none, resolution_m=0.01).bounds == pytest.approx((0, 0, 5, 4))


@pytest.mark.parametrize("flags", ["0 0", "0 1", "1 0", "1 1"])
def test_an_arc_stays_on_its_circle(flags: str) -> None:
    ((*curves,),) = parse_path(f"M 0 0 A 2 2 0 {flags} 2 2")
    chain = np.vstack([[(0.0, 0.0)], *(flatten(np.array(curve)) for curve in curves)])
    large, sweep = flags.split()
    centre = (2.0, 0.0) if large == sweep else (0.0, 2.0)
    radii = np.hypot(*(chain - centre).T)
    assert radii == pytest.approx(np.full(len(chain), 2.0), abs=1e-3)
    length = np.hypot(*np.diff(chain, axis=0).T).sum()
    assert length == pytest.approx((3 if large == "1" else 1) * math.pi, rel=0.01)


def test_a_curve_is_few_straight_pieces_within_a_centimetre() -> None:
    ((curve,),) = parse_path("M0 0C0 1 1 2 2 2")
    chain = shapely.LineString(np.vstack([[(0.0, 0.0)], flatten(np.array(curve))]))
    t = np.linspace(0, 1, 200)[:, None]
    p = np.array(curve)
    exact = (1 - t) ** 3 * p[0] + 3 * t * (1 - t) ** 2 * p[1] + 3 * t**2 * (1 - t) * p[2] + t**3 * p[3]
    assert shapely.distance(chain, shapely.points(exact)).max() <= 0.01
    assert len(chain.coords) <= 14


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-180, 180))
def test_transforms_apply_from_right_to_left(x: float, y: float, angle: float) -> None:
    both = parse_transform(f"translate({x},{y}) rotate({angle})")
    assert both == pytest.approx(parse_transform(f"translate({x} {y})") @ parse_transform(f"rotate({angle})"))


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ("", "no lines"),
        ("<rect", "plan.svg"),
        ('<path d="M0 0 X"/>', "unknown path command 'X'"),
        ('<path d="L 1 1"/>', "begins with M"),
        ('<path d="M 0 1e99"/>', "too large"),
        ('<path d="M 0 0 A 1 1 0 2 0 1 1"/>', "flag of an arc"),
        ('<rect width="9%" height="1"/>', "no length"),
        ('<g transform="spin(3)"/>', "no transform"),
        ('<polyline points="1,a 2,3"/>', "could not convert"),
        ('<g id="a"><use href="#a"/></g>', "clones counted"),
        ("<g>" * 100 + "</g>" * 100, "nested deeper"),
        ("<g/>" * 30_000, "more than"),
        (ROOM + '<circle id="start" cx="10" cy="10" r="5"/>', "free: ("),
    ],
)
def test_a_broken_svg_is_one_line(tmp_path: Path, inside: str, expected: str) -> None:
    assert expected in error_of(written(tmp_path, "plan.svg", SVG.format(inside)))


def test_entities_that_could_grow_are_refused(tmp_path: Path) -> None:
    bomb = '<!DOCTYPE svg [<!ENTITY a "xx"><!ENTITY b "&a;&a;">]>' + SVG.format("&b;")
    assert "entity 'b' is refused" in error_of(written(tmp_path, "plan.svg", bomb))
    outside = '<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]>' + SVG.format("&a;")
    assert "refused" in error_of(written(tmp_path, "plan.svg", outside))
    short = '<!DOCTYPE svg [<!ENTITY ns "http://ns">]>' + SVG.format(ROOM + '<g a="&ns;"/>')
    assert len(load_world(written(tmp_path, "plan.svg", short)).walls) == 4


# All formats


def test_the_schema_for_editors_is_up_to_date() -> None:
    file = Path(worlds.__file__).parent / "readers" / "world.schema.json"
    assert file.read_bytes() == world_schema()
    assert set(msgspec.json.decode(world_schema())["$defs"]) >= {"WorldFile", "Wall", "Door", "Cylinder"}


def test_files_that_are_too_large_are_refused(tmp_path: Path) -> None:
    assert "larger than 2 MiB" in error_of(written(tmp_path, "big.toml", b"#" * (2**21 + 1)))


def test_a_photograph_is_no_drawing(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    image = (rng.random((1200, 1200)) < 0.8).astype(np.uint8) * 255
    image[200:400, 400:800] = 255
    skimage.io.imsave(tmp_path / "noise.png", image, check_contrast=False)
    assert "no drawing of walls" in error_of(tmp_path / "noise.png")


SAMPLES: dict[str, bytes] = {
    "f.json": b'{"verts": [[0, 0], [5, 0], [5, 3], [0, 3]]}',
    "f.yaml": YAML.encode(),
    "f.map": MAP.encode(),
    "f.toml": TOML.encode(),
    "f.svg": SVG.format(ROOM + '<g transform="scale(.5)"><path d="M9 9c1 2 30 4 50 60z"/></g>').encode(),
}


def read_or_refused(path: Path) -> None:
    """Either a world or one line."""
    try:
        assert isinstance(load_world(path), World)
    except SonarExploreError as error:
        assert str(error) and "\n" not in str(error)


fuzz = settings(
    max_examples=80,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.mark.parametrize("name", [*SAMPLES, "f.png", "f.pgm"])
@fuzz
@given(data=st.data())
def test_whatever_is_in_a_file_it_is_a_world_or_one_line(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    image = map_image(tmp_path)
    if name not in SAMPLES:
        skimage.io.imsave(tmp_path / name, skimage.io.imread(image), check_contrast=False)
    sample = SAMPLES.get(name) or (tmp_path / name).read_bytes()
    content = data.draw(st.one_of(st.binary(max_size=200), mutations(sample)))
    read_or_refused(written(tmp_path, name, content))


@st.composite
def mutations(draw: st.DrawFn, sample: bytes) -> bytes:
    """A real file cut short, with bytes changed, or with pieces put where they do not belong."""
    content = bytearray(sample[: draw(st.integers(0, len(sample)))] if draw(st.booleans()) else sample)
    words = [
        b"1e308",
        b"-1",
        b"nan",
        b"0",
        b"[[",
        b"<g>",
        b"\x00",
        b"99999999999999999999",
        b" ",
        b"\xff\xfe",
        b"-",
    ]
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(content)))
        content[at : at + draw(st.integers(0, 3))] = draw(
            st.one_of(st.binary(max_size=4), st.sampled_from(words))
        )
    return bytes(content)


DATA = os.environ.get("SONAR_EXPLORE_DATA", "")
PLANS = (
    *("houseexpo/0a1b29dba355df2ab02630133187bfab.json", "houseexpo/1f99717550c31ae321ca2313edceedcc.json"),
    *("mobilesim/AMROffice.map", "mobilesim/office.map", "mobilesim/triangle.map"),
    *("ros/aws_small_house.yaml", "ros/ipa_apartment.yaml", "ros/lse_arena.yaml"),
    *("ipa/lab_ipa.png", "ipa/office_e.png", "stage/cave.png?resolution=0.032"),
)


@pytest.mark.skipif(not DATA, reason="SONAR_EXPLORE_DATA is not set: no real floor plans to read")
@pytest.mark.parametrize("plan", PLANS)
def test_a_robot_reaches_nearly_all_of_a_real_plan(plan: str) -> None:
    found = survey(load_world(f"{DATA}/plans/{plan}"))
    assert found.reached_share >= 0.98
    assert found.closed and not found.warnings


@pytest.mark.skipif(not DATA, reason="SONAR_EXPLORE_DATA is not set: no real floor plans to cut short")
@pytest.mark.parametrize("plan", ["mobilesim/office.map", "houseexpo/1f99717550c31ae321ca2313edceedcc.json"])
def test_real_plans_cut_short_are_worlds_or_one_line(tmp_path: Path, plan: str) -> None:
    data = (Path(DATA) / "plans" / plan).read_bytes()
    for end in range(0, len(data), max(1, len(data) // 40)):
        read_or_refused(written(tmp_path, "cut" + Path(plan).suffix, data[:end]))
