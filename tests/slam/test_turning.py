# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The foot of a wall's normal walks with the robot; the foot on an edge stays behind."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import wall_feature

from sonar_explore.geometry import Pose
from sonar_explore.slam.association import Association
from sonar_explore.slam.chains import ChainMap, Link
from sonar_explore.slam.turning import TurningConfig, follows_the_wall

ON = TurningConfig(enabled=True)
turns = st.floats(-3.0, 3.0)
ways = st.floats(-0.6, 0.6).filter(lambda way: abs(abs(way) - ON.moved_m) > 1e-6)  # no ties


def verdict(poses, features, config=ON):
    """Whether what two poses heard passes for one wall, the first one being the chain's link."""
    first, second = poses
    chains = ChainMap()
    chains.add_root(Link(features[0].segment.transformed(first), 0, 0, features[0]), 1.0)
    (out,) = follows_the_wall(
        second, [features[1]], [Association(0, 0, 0, 0.0, 0.0, 0.0)], chains, lambda _: first, config
    )
    return out


def poses(turn, way, spin):
    """Two poses at (0, 0) and `way` along the x axis, in a map that is turned."""
    whole = Pose(0.7, -0.4, turn)
    return whole @ Pose(0.0, 0.0, 0.0), whole @ Pose(way, 0.0, spin)


@settings(deadline=None)
@given(turns, ways, turns, st.floats(0.3, 1.8))
def test_a_wall_beside_the_way_is_one_wall_from_both_places(turn, way, spin, range_m):
    features = wall_feature(math.pi / 2, range_m), wall_feature(math.pi / 2 - spin, range_m)
    assert verdict(poses(turn, way, spin), features)


@settings(deadline=None)
@given(turns, ways, turns, st.floats(0.3, 1.8))
def test_an_edge_beside_the_way_is_none_once_the_robot_has_moved(turn, way, spin, range_m):
    to_edge = math.atan2(range_m, -way)
    features = wall_feature(math.pi / 2, range_m), wall_feature(to_edge - spin, math.hypot(range_m, way))
    assert verdict(poses(turn, way, spin), features) == (abs(way) < ON.moved_m)


def test_the_paper_believes_every_association():
    features = wall_feature(math.pi / 2, 1.0), wall_feature(math.atan2(1.0, -0.5), math.hypot(1.0, 0.5))
    assert verdict(poses(0.0, 0.5, 0.0), features, TurningConfig())
    assert not verdict(poses(0.0, 0.5, 0.0), features)


def test_nothing_associated_nothing_judged():
    out = follows_the_wall(Pose(0, 0, 0), [], [], ChainMap(), lambda _: Pose(0, 0, 0), ON)
    assert out.shape == (0,) and out.dtype == np.bool_
