"""What a ping hears (READING section 2)."""

import math

import numpy as np
import pytest

from sonar_explore.beam import Beam
from sonar_explore.envs import acoustics
from sonar_explore.envs.acoustics import SonarPhysics, echoes
from sonar_explore.envs.pings import CORNER, CYLINDER, EDGE, GHOST, NOTHING, PLANE, ROUGH
from sonar_explore.envs.scene import Scene
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose


def scene_of(walls, cylinders=(), roughness=0.0):
    walls = np.array(walls, dtype=float).reshape(-1, 4)
    world = World(
        name="test",
        title="test",
        walls=walls,
        roughness=np.full(len(walls), roughness),
        cylinders=np.array(cylinders, dtype=float).reshape(-1, 3),
        start=Pose(0.0, 0.0, 0.0),
        has_loop=False,
    )
    return Scene.of(world, 5.0)


def widest_heard_deg(scene, x, y, bearing_rad, kind):
    """Largest angle off a source's bearing at which the first echo is still of its kind, [deg]."""
    angles = np.arange(0.0, 25.0, 0.01)
    discs = np.column_stack(
        [np.full_like(angles, x), np.full_like(angles, y), bearing_rad + np.radians(angles)]
    )
    kinds = echoes(scene, discs, SonarPhysics(ghost_order=1))[1]
    heard = np.flatnonzero(kinds == kind)
    return angles[heard[-1]] if len(heard) else 0.0


@pytest.mark.parametrize(
    ("distance_m", "half_angle_deg"), [(0.5, 13.6), (1.0, 12.5), (2.0, 11.3), (5.0, 9.5)]
)
def test_a_plane_is_heard_within_the_half_angle_of_its_distance(distance_m, half_angle_deg):
    scene = scene_of([(distance_m - 0.01, -9, distance_m - 0.01, 9)])
    assert widest_heard_deg(scene, 0.0, 0.0, 0.0, PLANE) == pytest.approx(half_angle_deg, abs=0.06)


@pytest.mark.parametrize(("distance_m", "half_angle_deg"), [(0.5, 10.2), (1.0, 7.9), (2.0, 4.4), (3.0, 0.0)])
def test_an_edge_is_heard_within_the_half_angle_of_its_distance(distance_m, half_angle_deg):
    scene = scene_of([(distance_m, 0.0, distance_m + 2.0, 0.0)])
    assert widest_heard_deg(scene, 0.0, 0.0, 0.0, EDGE) == pytest.approx(half_angle_deg, abs=0.06)
    assert math.degrees(Beam().edge_half_angle_rad(distance_m)) == pytest.approx(half_angle_deg, abs=0.06)


def test_a_wall_answers_with_its_perpendicular_distance_whatever_the_heading():
    scene = scene_of([(1.0, -3, 1.0, 3)])
    discs = np.array([(0.0, 0.0, math.radians(a)) for a in range(-12, 13)])
    ranges, _ = echoes(scene, discs, SonarPhysics())
    assert np.ptp(ranges) == pytest.approx(0.0, abs=1e-12)


def test_a_wall_whose_foot_lies_beyond_its_end_is_silent_but_its_end_answers():
    scene = scene_of([(1.0, 0.05, 1.0, 3)])
    ranges, kinds = echoes(scene, np.array([(0.0, 0.0, 0.0)]), SonarPhysics())
    assert kinds[0] == EDGE
    assert ranges[0] == pytest.approx(math.hypot(1.0, 0.05))


def test_a_concave_right_corner_answers_like_a_plane_at_the_corners_distance():
    scene = scene_of([(0, 0, 3, 0), (0, 0, 0, 3)])
    x = y = 2.0 / math.sqrt(2.0)
    assert widest_heard_deg(scene, x, y, math.radians(225), CORNER) == pytest.approx(11.3, abs=0.06)


def test_a_concave_corner_that_is_not_right_is_silent():
    scene = scene_of([(0, 0, 3, 0), (0, 0, 3 * math.cos(math.radians(120)), 3 * math.sin(math.radians(120)))])
    bearing = math.radians(60)
    discs = np.array([(1.5 * math.cos(bearing), 1.5 * math.sin(bearing), bearing + math.pi)])
    assert echoes(scene, discs, SonarPhysics(ghost_order=1))[1][0] == NOTHING


def test_the_same_corner_seen_from_outside_is_a_weak_edge():
    scene = scene_of([(0, 0, 3, 0), (0, 0, 0, 3)])
    d = 1.0 / math.sqrt(2.0)
    assert widest_heard_deg(scene, -d, -d, math.radians(45), EDGE) == pytest.approx(7.9, abs=0.06)


def test_a_ping_never_passes_a_wall():
    rng = np.random.default_rng(1)
    behind = [(*rng.uniform(-3, 3, 2), *rng.uniform(-3, 3, 2)) for _ in range(10)]
    room = [(-1, -1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1), (-1, 1, -1, -1)]
    outside = [w for w in behind if min(max(abs(w[0]), abs(w[1])), max(abs(w[2]), abs(w[3]))) > 1.6]
    discs = np.column_stack([rng.uniform(-0.9, 0.9, (500, 2)), rng.uniform(-math.pi, math.pi, 500)])
    alone, _ = echoes(scene_of(room), discs, SonarPhysics())
    # walls beyond a closed room change nothing, unless they cut it
    clear = [w for w in outside if not crosses_box(w)]
    assert clear
    among, _ = echoes(scene_of(room + clear), discs, SonarPhysics())
    np.testing.assert_allclose(among, alone, atol=2e-3)


def crosses_box(wall):
    t = np.linspace(0, 1, 400)
    x = wall[0] + t * (wall[2] - wall[0])
    y = wall[1] + t * (wall[3] - wall[1])
    return bool(np.any((np.abs(x) < 1.05) & (np.abs(y) < 1.05)))


def test_an_oblique_wall_alone_is_not_heard():
    scene = scene_of([(0, 1, 9, 1)])
    kinds = echoes(scene, np.array([(0.5, 0.0, math.radians(45))]), SonarPhysics())[1]
    assert kinds[0] == NOTHING


def test_an_oblique_mirror_gives_a_ghost_longer_than_the_wall_it_looks_at():
    # the beam meets the mirror at 45 degrees, turns by 90, and finds a wall square to it
    mirror = (1.0, -1.0, 3.0, 1.0)
    target = (1.0, 2.0, 3.0, 2.0)
    scene = scene_of([mirror, target])
    disc = np.array([(0.0, 0.0, 0.0)])
    ranges, kinds = echoes(scene, disc, SonarPhysics(ghost_order=2))
    assert kinds[0] == PLANE + GHOST
    assert ranges[0] == pytest.approx(2.0 + 2.0, abs=2e-3)
    assert echoes(scene, disc, SonarPhysics(ghost_order=1))[1][0] == NOTHING


def test_a_thin_column_is_heard_at_its_surface():
    scene = scene_of([(9, 9, 9, 8)], [(1.0, 0.0, 0.1)])
    ranges, kinds = echoes(scene, np.array([(0.0, 0.0, 0.0)]), SonarPhysics())
    assert kinds[0] == CYLINDER
    assert ranges[0] == pytest.approx(0.9)


def test_a_rough_wall_answers_obliquely():
    wall = [(0, 1, 9, 1)]
    disc = np.array([(0.5, 0.0, math.radians(45))])
    assert echoes(scene_of(wall), disc, SonarPhysics())[1][0] == NOTHING
    ranges, kinds = echoes(scene_of(wall, roughness=0.2), disc, SonarPhysics())
    assert kinds[0] == ROUGH
    assert ranges[0] == pytest.approx(math.sqrt(2.0))


def test_noise_has_the_stated_size_and_quantum():
    rng = np.random.default_rng(0)
    measured = acoustics.measured(np.full(40000, 2.0), 1.0, SonarPhysics(dropout=0.0), rng)
    assert measured.std() == pytest.approx(0.013, rel=0.03)
    np.testing.assert_allclose(measured * 1000, np.round(measured * 1000), atol=1e-6)


def test_dropouts_report_the_maximum_range_at_their_rate():
    rng = np.random.default_rng(0)
    measured = acoustics.measured(np.full(40000, 1.0), 1.0, SonarPhysics(dropout=0.01), rng)
    assert np.mean(measured == 5.0) == pytest.approx(0.01, abs=0.002)


def test_cutting_a_wall_in_two_changes_no_ping():
    whole = scene_of([(-2, 1, 2, 1), (-2, -1, 2, -1)])
    cut = scene_of([(-2, 1, 0.123, 1), (0.123, 1, 2, 1), (-2, -1, 2, -1)])
    rng = np.random.default_rng(3)
    discs = np.column_stack(
        [rng.uniform(-1, 1, (300, 1)), rng.uniform(-0.9, 0.9, (300, 1)), rng.uniform(-3, 3, (300, 1))]
    )
    np.testing.assert_allclose(
        echoes(whole, discs, SonarPhysics())[0], echoes(cut, discs, SonarPhysics())[0], atol=1e-9
    )
