# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""How widely a point is heard tells an edge from a column and from a corner, and how thick the column is."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sonar_explore.beam import Beam
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose
from sonar_explore.slam import SlamConfig
from sonar_explore.slam.turn.agreement import extract
from sonar_explore.slam.turn.columns import ColumnConfig, PointKind, told_by_width

CONFIG = SlamConfig.robust()
BOX = [[-4, -4, 4, -4], [4, -4, 4, 4], [4, 4, -4, 4], [-4, 4, -4, -4]]


def heard(x, y, seed, walls=BOX, columns=()):
    world = World(
        "hall",
        "",
        np.array(walls, float),
        np.zeros(len(walls)),
        np.array(columns, float).reshape(-1, 3),
        Pose(x, y, 0.3 + seed),
        False,
    )
    robot = Simulator(world, SimulatorConfig(noise=noise_preset("ideal")), np.random.default_rng(seed))
    return robot.true_pose, extract(robot.scan(1), CONFIG.features, CONFIG.agreement).points


def nearest(pose, points, x, y):
    found = [(math.hypot(*(np.array(p.seen_from(pose)) - (x, y))), k) for k, p in enumerate(points)]
    assume(found and min(found)[0] < 0.3)  # now and then a ping is lost, and the point with it
    off, k = min(found)
    return points[k], off


@pytest.mark.parametrize("radius", [0.07, 0.1, 0.15])
def test_a_column_is_heard_as_one_with_its_middle_where_it_is(radius):
    rng, found = np.random.default_rng(0), []
    for seed in range(30):
        depth, side = rng.uniform(0.8, 1.6) + radius, rng.uniform(0, math.tau)
        pose, points = heard(depth * math.cos(side), depth * math.sin(side), seed, columns=[[0, 0, radius]])
        found += [p for p in points if math.hypot(*p.seen_from(pose)) < 0.3]
    assert len(found) >= 25
    columns = [p.radius_m for p in found if p.kind is PointKind.COLUMN]
    assert len(columns) >= 0.9 * len(found)
    assert np.median(columns) == pytest.approx(radius, rel=0.3)
    assert np.percentile(np.abs(np.array(columns) / radius - 1.0), 68) < 0.5


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 500), st.floats(0.7, 1.6))
def test_the_end_of_a_wall_is_thin(seed, away):
    pose, points = heard(-away, 0.2, seed, walls=[*BOX, [0, 0, 2, 0]])
    point, off = nearest(pose, points, 0.0, 0.0)
    assert point.kind is PointKind.EDGE and point.radius_m == 0.0
    assert off < 0.05


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 500), st.floats(0.6, 1.4), st.floats(0.6, 1.4))
def test_a_concave_corner_is_no_column(seed, dx, dy):
    pose, points = heard(4 - dx, 4 - dy, seed)
    point, off = nearest(pose, points, 4.0, 4.0)
    assert off < 0.05
    assert point.kind is PointKind.CORNER and point.radius_m == 0.0


@pytest.mark.parametrize("echo", [0.5, 1.0, 2.0])
def test_the_wider_a_point_is_heard_the_thicker_until_it_is_a_corner_and_then_no_point_at_all(echo):
    found = [
        told_by_width(math.radians(w), echo + 0.13, echo, Beam(), ColumnConfig())
        for w in np.arange(7.0, 40.0, 0.5)
    ]
    assert found[0] == (PointKind.EDGE, 0.0) and found[-1] is None
    known = [f for f in found if f is not None]
    assert found[len(known) :] == [None] * (len(found) - len(known))
    kinds = [kind for kind, _ in known]
    assert kinds == sorted(kinds) and set(kinds) == set(PointKind)
    radii = [radius for kind, radius in known if kind is PointKind.COLUMN]
    assert radii == sorted(radii)
