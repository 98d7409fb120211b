"""What holds for every format: the start, what is refused, and that bad files become one line in little time."""

import json
import math
import os
from pathlib import Path

import msgspec
import numpy as np
import pytest
import skimage.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from world_files import MAP, ROOM, SVG, TOML, YAML, error_of, map_image, written

from sonar_explore.envs import world as worlds
from sonar_explore.envs.load import load_world
from sonar_explore.envs.readers.toml_world import world_schema
from sonar_explore.envs.survey import as_text, survey
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose


def test_a_start_may_be_said_in_the_call_or_in_the_name(tmp_path: Path) -> None:
    path = written(tmp_path, "home.json", json.dumps({"verts": [[0, 0], [4, 0], [4, 3], [0, 3]]}))
    assert load_world(path).start.x == pytest.approx(2.0, abs=0.06)
    assert load_world(path, start=Pose(0.5, 0.6, 0.7)).start == Pose(0.5, 0.6, 0.7)
    assert load_world(f"{path}?start=0.5,0.6,90").start == Pose(0.5, 0.6, math.pi / 2)
    assert "takes no resolution" in error_of(f"{path}?resolution=2")
    assert "unknown option 'scale'" in error_of(f"{path}?scale=2")


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


def test_a_room_without_a_door_is_named_and_the_outside_is_not(tmp_path: Path) -> None:
    box = "[[wall]]\nclosed = true\npoints = [[0, 0], [5, 0], [5, 4], [0, 4]]\n"
    start = "title = 'room'\n[start]\nx = 1.0\ny = 1.0\n"
    one = load_world(written(tmp_path, "one.toml", start + box))
    two = load_world(written(tmp_path, "two.toml", start + box + "[[wall]]\npoints = [[3, 0], [3, 4]]\n"))
    assert survey(one).closed_off_m2 == ()
    room_m2 = (2.0 - 2 * 0.18) * (4.0 - 2 * 0.18)  # where the middle of the body has room
    assert survey(two).closed_off_m2 == pytest.approx((room_m2,), rel=0.1)
    assert "a room without a door?" in as_text(two, survey(two))
