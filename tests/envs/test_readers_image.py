"""The image reader: drawings become few, long walls, close to the drawing."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import skimage.io
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage
from skimage.draw import disk, polygon
from skimage.measure import find_contours

from sonar_explore.envs.load import load_world
from sonar_explore.envs.readers.bitmap import straighten
from sonar_explore.envs.readers.image import brightness, load_image_world
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

Image = NDArray[np.uint8]


def drawing(rows: int = 80, cols: int = 100) -> Image:
    """A room of 4.0 x 3.0 m (80 x 60 pixels) whose lower left corner is at (0.5, 0.5) m."""
    image = np.zeros((rows, cols), dtype=np.uint8)
    image[10:70, 10:90] = 255
    return image


def saved(tmp_path: Path, image: Image, name: str = "plan.png") -> Path:
    skimage.io.imsave(tmp_path / name, image, check_contrast=False)
    return tmp_path / name


def deviation_px(
    world: World, image: NDArray[Any], resolution_m: float = 0.05, threshold: float = 210
) -> float:
    """Farthest that any pixel edge of the start's free space lies from the nearest wall or column."""
    labels, _ = ndimage.label(image > 210)
    free = labels == labels[int(len(image) - world.start.y / resolution_m), int(world.start.x / resolution_m)]
    free = np.pad(free, 1)
    rows, cols = np.nonzero(free[1:] != free[:-1])
    across = np.column_stack([cols - 0.5, len(image) - rows])
    rows, cols = np.nonzero(free[:, 1:] != free[:, :-1])
    along = np.column_stack([cols, len(image) - rows + 0.5])
    edges = np.concatenate([across, along]) * resolution_m
    shapes = [*shapely.linestrings(world.walls.reshape(-1, 2, 2))]
    shapes += [shapely.Point(x, y).buffer(r).exterior for x, y, r in world.cylinders]
    _, distance = shapely.STRtree(shapes).query_nearest(
        shapely.points(edges), all_matches=False, return_distance=True
    )
    return float(distance.max() / resolution_m)


@pytest.mark.parametrize("name", ["plan.png", "plan.pgm"])
def test_a_drawn_room_has_four_walls_exactly_where_they_are_drawn(tmp_path: Path, name: str) -> None:
    world = load_world(saved(tmp_path, drawing(), name))
    assert len(world.walls) == 4
    assert world.bounds == pytest.approx((0.5, 0.5, 4.5, 3.5))
    assert world.start.x == pytest.approx(2.5, abs=0.06) and world.start.y == pytest.approx(2.0, abs=0.06)
    assert not world.has_loop and world.name == "plan"


def test_row_0_is_on_top(tmp_path: Path) -> None:
    image = drawing()
    image[10:20, 10:50] = 0
    world = load_image_world(saved(tmp_path, image))
    assert world.clearance(np.array([[1.5, 3.0]]))[0] == pytest.approx(0.0, abs=1e-9)


def test_resolution_scales_the_world(tmp_path: Path) -> None:
    world = load_image_world(saved(tmp_path, drawing()), resolution_m=0.1)
    assert world.bounds == pytest.approx((1.0, 1.0, 9.0, 7.0))


@pytest.mark.parametrize("slope", [0.05, 0.1, 0.3, 0.7, 1.0])
def test_an_oblique_wall_is_one_wall(tmp_path: Path, slope: float) -> None:
    image = np.zeros((160, 160), dtype=np.uint8)
    rows, cols = polygon([10, 150, 150, 10], [10, 10, 40 + 100 * slope, 40], image.shape)
    image[rows, cols] = 255
    world = load_image_world(saved(tmp_path, image))
    assert len(world.walls) == 4
    longest_oblique = max(world.walls, key=lambda w: abs(w[2] - w[0]) * abs(w[3] - w[1]))
    dx, dy = longest_oblique[2:] - longest_oblique[:2]
    assert abs(dx / dy) == pytest.approx(100 * slope / 140, abs=0.01)
    assert deviation_px(world, image) <= 1.0


def test_a_block_in_the_room_makes_a_loop_and_a_speck_makes_a_column(tmp_path: Path) -> None:
    image = drawing()
    image[30:50, 35:65] = 0
    image[20:22, 20:22] = 0
    world = load_image_world(saved(tmp_path, image))
    assert world.has_loop and len(world.walls) == 8
    assert world.cylinders == pytest.approx(np.array([[1.05, 2.95, 0.0564]]), abs=1e-3)


def test_a_thin_wall_keeps_both_sides_and_its_end(tmp_path: Path) -> None:
    image = drawing()
    image[10:50, 50] = 0
    world = load_image_world(saved(tmp_path, image))
    assert deviation_px(world, image) <= 1.0


def test_a_round_table_follows_its_edge_within_a_pixel(tmp_path: Path) -> None:
    image = drawing()
    image[disk((40, 50), 12)] = 0
    world = load_image_world(saved(tmp_path, image))
    assert 8 <= len(world.walls) - 4 <= 16
    assert deviation_px(world, image) <= 1.0


def test_only_the_space_the_start_is_in_becomes_a_world(tmp_path: Path) -> None:
    image = np.full((80, 120), 255, dtype=np.uint8)
    image[10:70, 10:110] = 0
    image[15:65, 15:60] = 255
    image[15:65, 65:105] = 255
    path = saved(tmp_path, image)
    assert load_image_world(path).bounds == pytest.approx((0.75, 0.75, 3.0, 3.25))
    right = load_image_world(path, start=Pose(4.0, 2.0, 0.0))
    assert right.bounds == pytest.approx((3.25, 0.75, 5.25, 3.25))


def test_threshold_says_what_is_free(tmp_path: Path) -> None:
    image = drawing()
    image[10:70, 60:90] = 205
    path = saved(tmp_path, image)
    assert load_image_world(path).bounds[2] == pytest.approx(3.0)
    assert load_image_world(path, threshold=200).bounds[2] == pytest.approx(4.5)


def test_colour_and_transparency_read_asbrightness(tmp_path: Path) -> None:
    grey = drawing()
    colour = np.dstack([grey, grey, grey, np.full_like(grey, 255)])
    colour[10:70, 60:90] = (0, 0, 0, 0)
    assert load_image_world(saved(tmp_path, colour)).bounds == pytest.approx((0.5, 0.5, 4.5, 3.5))


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "empty"),
        (b"not an image", "not a PNG or PGM"),
        (b"\x89PNG\r\n\x1a\n" + bytes(40), "damaged or cut short"),
    ],
)
def test_a_broken_image_is_one_line(tmp_path: Path, content: bytes, expected: str) -> None:
    (tmp_path / "plan.png").write_bytes(content)
    with pytest.raises(SonarExploreError, match=expected) as caught:
        load_world(tmp_path / "plan.png")
    assert "\n" not in str(caught.value)


def test_a_truncated_image_is_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = saved(tmp_path, rng.integers(0, 255, (80, 80), dtype=np.uint8))
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(SonarExploreError, match="damaged or cut short"):
        load_world(path)


def test_images_without_a_place_for_the_robot_are_refused(tmp_path: Path) -> None:
    white, black = np.full((50, 50), 255, dtype=np.uint8), np.zeros((50, 50), dtype=np.uint8)
    with pytest.raises(SonarExploreError, match="no pixel is as dark or darker"):
        load_world(saved(tmp_path, white))
    with pytest.raises(SonarExploreError, match="no pixel is brighter"):
        load_world(saved(tmp_path, black))
    black[10:40, 10:13] = 255
    with pytest.raises(SonarExploreError, match="no free space wide enough for the robot"):
        load_world(saved(tmp_path, black))
    with pytest.raises(SonarExploreError, match=r"is inside a wall; free: \(2\.\d\d, [12]\.\d\d\)"):
        load_image_world(saved(tmp_path, drawing()), start=Pose(0.1, 0.1, 0.0))
    with pytest.raises(SonarExploreError, match=r"is outside the image, which spans 5\.00 x 4\.00 m"):
        load_image_world(saved(tmp_path, drawing()), start=Pose(9.0, 0.1, 0.0))


@given(
    angle=st.floats(0.0, 3.14),
    length=st.floats(20.0, 60.0),
    width=st.floats(8.0, 20.0),
)
def test_straighten_finds_the_sides_of_a_turned_rectangle(angle: float, length: float, width: float) -> None:
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length / 2, width / 2)
    c, s = np.cos(angle), np.sin(angle)
    corners = box @ np.array([[c, s], [-s, c]]) + 50.0
    image = np.zeros((100, 100))
    image[polygon(corners[:, 0], corners[:, 1], image.shape)] = 1.0
    (contour,) = find_contours(image, 0.5)
    found = straighten(contour[:-1])
    assert len(found) <= 8
    drawn = shapely.LinearRing(corners)
    assert shapely.hausdorff_distance(drawn, shapely.LinearRing(found)) <= 1.6
    assert shapely.distance(drawn, shapely.points(contour)).max() <= 1.5


DATA = os.environ.get("SONAR_EXPLORE_DATA", "")


@pytest.mark.skipif(not DATA, reason="SONAR_EXPLORE_DATA is not set: no real floor plans to read")
@pytest.mark.parametrize(
    "plan",
    [
        *("ipa/lab_ipa", "ipa/lab_ipa_furnitures", "ipa/office_e", "ipa/Freiburg79_scan_furnitures"),
        *("stage/cave", "stage/autolab"),
    ],
)
def test_a_real_plan_reads_within_two_pixels_everywhere(plan: str) -> None:
    path = Path(DATA) / "plans" / f"{plan}.png"
    world = load_world(path)
    assert deviation_px(world, brightness(path)) <= 2.0
    assert len(world.walls) <= 800
