"""The compiled pings equal the plain ones to the last bit, in every kind of world."""

import math

import numpy as np
import pytest
from plain_pings import plain_echoes

from sonar_explore.amigobot import AmigoBot
from sonar_explore.beam import Beam
from sonar_explore.envs.acoustics import SonarPhysics, echoes
from sonar_explore.envs.load import load_world, shipped_worlds
from sonar_explore.envs.scene import Scene
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose

MOUNT = AmigoBot().sonars[2]


def scan_discs(rng, x, y):
    """A smeared turn on the spot, either way round."""
    step = rng.choice((-1.0, 1.0)) * math.radians(4.0)
    headings = rng.uniform(-9, 9) + np.cumsum(step * 1.004 + 0.001 * rng.standard_normal(90))
    discs = [Pose(x, y, float(h)) @ MOUNT for h in headings]
    return np.array([(d.x, d.y, d.heading) for d in discs])


def assert_same(scene, discs, physics):
    ranges, kinds = echoes(scene, discs, physics)
    plain_ranges, plain_kinds = plain_echoes(scene, discs, physics)
    assert np.array_equal(kinds, plain_kinds)
    assert np.array_equal(ranges, plain_ranges)
    return kinds


def random_world(rng):
    """Walls at any angle and square ones that meet, columns, some walls rough, some very near one another."""
    size = rng.uniform(2.0, 12.0)
    n = int(rng.integers(1, 40))
    a = rng.uniform(0, size, (n, 2))
    angle = np.where(rng.random(n) < 0.6, rng.integers(0, 4, n) * math.pi / 2, rng.uniform(0, math.tau, n))
    b = a + rng.uniform(0.05, 5.0, (n, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])
    if rng.random() < 0.5:
        a, b = np.round(a, 0 if rng.random() < 0.3 else 1), np.round(b, 1)
    walls = np.hstack([a, b])[np.hypot(*(b - a).T) > 0.02]
    room = np.array(
        [(0, 0, size, 0), (size, 0, size, size), (size, size, 0, size), (0, size, 0, 0)], dtype=float
    )
    walls = np.vstack([walls, room]) if rng.random() < 0.7 or not len(walls) else walls
    rough = np.where(rng.random(len(walls)) < 0.2, 0.3, 0.0) * (rng.random() < 0.3)
    columns = np.column_stack([rng.uniform(0, size, (5, 2)), rng.uniform(0.02, 0.3, 5)])[: rng.integers(0, 6)]
    return World("random", "random", walls, rough, columns, Pose(0.0, 0.0, 0.0), False), size


@pytest.mark.parametrize("seed", range(8))
def test_scans_of_random_worlds_are_those_of_single_pings(seed):
    rng = np.random.default_rng(seed)
    heard = set()
    for _ in range(12):
        world, size = random_world(rng)
        scene = Scene.of(world, 5.0)
        physics = SonarPhysics(
            ghost_order=int(rng.integers(1, 4)), bounce_loss=float(rng.choice((0.8, 0.95)))
        )
        for x, y in rng.uniform(-0.5, size + 0.5, (12, 2)):
            heard.update(assert_same(scene, scan_discs(rng, x, y), physics).tolist())
    assert len(heard) >= 6


def crowded_world(rng):
    """Walls, each with others that touch its line: just behind it, at a small angle from its end, as a T, going on."""
    walls = []
    for _ in range(int(rng.integers(1, 4))):
        bearing = rng.choice((0.0, math.pi / 2, rng.uniform(0, math.tau)))
        along = np.array([math.cos(bearing), math.sin(bearing)])
        across = rng.choice((-1.0, 1.0)) * np.array([-along[1], along[0]])
        a = np.round(rng.uniform(0, 4, 2), 2)
        b = a + rng.uniform(0.5, 4.0) * along
        walls.append((*a, *b))
        for kind in rng.integers(0, 4, int(rng.integers(1, 6))):
            end, step, length = (
                (a, b)[rng.integers(2)],
                rng.choice((0.0, 0.001, 0.01, 0.5)),
                rng.uniform(0.02, 3),
            )
            if kind == 0:
                begin = (
                    a + rng.uniform(-0.5, 1.5) * (b - a) + rng.choice((0.001, 0.002, 0.005, 0.05)) * across
                )
                walls.append((*begin, *(begin + length * along)))
            elif kind == 1:
                turn = (
                    bearing + rng.choice((0.0, math.pi)) + rng.choice((0.001, -0.01, 0.1, 1.0, math.pi / 2))
                )
                walls.append((*end, *(end + length * np.array([math.cos(turn), math.sin(turn)]))))
            elif kind == 2:
                begin = a + rng.uniform() * (b - a)
                walls.append((*begin, *(begin + length * across + 0.3 * rng.standard_normal() * along)))
            else:
                walls.append((*(b + step * along), *(b + (step + length) * along)))
    columns = np.column_stack([rng.uniform(0, 4, (2, 2)), rng.uniform(0.02, 0.2, 2)])[: rng.integers(0, 3)]
    lines = np.array(walls)
    return World("crowded", "crowded", lines, np.zeros(len(lines)), columns, Pose(0.0, 0.0, 0.0), False)


@pytest.mark.parametrize("seed", range(2))
def test_walls_that_touch_the_line_of_another_change_nothing_about_what_is_heard_by_way_of_it(seed):
    rng = np.random.default_rng(seed)
    for _ in range(40):
        scene = Scene.of(crowded_world(rng), 5.0)
        for x, y in rng.uniform(-0.5, 4.5, (12, 2)):
            assert_same(scene, scan_discs(rng, x, y), SonarPhysics())


@pytest.mark.parametrize("name", shipped_worlds())
def test_scans_of_shipped_worlds_are_those_of_single_pings(name):
    rng = np.random.default_rng(7)
    world = load_world(name)
    scene = Scene.of(world, 5.0)
    low, high = world.walls.reshape(-1, 2).min(axis=0), world.walls.reshape(-1, 2).max(axis=0)
    for x, y in rng.uniform(low, high, (150, 2)):
        assert_same(scene, scan_discs(rng, x, y), SonarPhysics())


@pytest.mark.parametrize("s_deg, heard_deg", [(3.0, 6.0), (24.7, 26.1), (35.0, 40.0), (80.0, 80.0)])
def test_whatever_the_beam_a_scan_is_that_of_single_pings(s_deg, heard_deg):
    rng = np.random.default_rng(11)
    physics = SonarPhysics(beam=Beam(math.radians(s_deg), math.exp(-((heard_deg / s_deg) ** 2))))
    for _ in range(15):
        world, size = random_world(rng)
        scene = Scene.of(world, 5.0)
        discs = scan_discs(rng, *rng.uniform(0.0, size, 2))
        ranges, kinds = echoes(scene, discs, physics)
        alone = [echoes(scene, disc[None, :], physics) for disc in discs]
        assert [(r[0], k[0]) for r, k in alone] == list(zip(ranges, kinds, strict=True))


def test_pings_from_anywhere_in_any_order_are_those_of_single_pings():
    rng = np.random.default_rng(3)
    for _ in range(20):
        world, size = random_world(rng)
        scene = Scene.of(world, 5.0)
        discs = rng.uniform((-7, -7, -20), (size + 7, size + 7, 20), (200, 3))
        discs[::3, :2] = discs[0, :2]  # some from one place, but not one after the other
        assert_same(scene, discs, SonarPhysics())
        for disc in discs[:20]:
            assert_same(scene, disc[None, :], SonarPhysics())
