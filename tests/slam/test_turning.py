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
    same = [Association(0, 0, 0, 0.0, 0.0, 0.0)]
    (out,) = follows_the_wall(
        second, [features[1]], same, chains, lambda _: np.array([first.as_row()]), config
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


def follows_plainly(pose, feature, link, link_pose):
    along = np.array([math.cos(link.direction), math.sin(link.direction)])
    robot = np.array([pose.x - link_pose.x, pose.y - link_pose.y]) @ along
    foot = (pose @ Pose(0.0, 0.0, feature.bearing_rad)).transform(np.array([[feature.range_m, 0.0]]))[0]
    return abs(robot) < ON.moved_m or (foot - link.midpoint) @ along / robot >= ON.share


def test_many_associations_are_judged_as_one_by_one():
    rng, chains = np.random.default_rng(0), ChainMap()
    believed = [Pose(*row) for row in rng.normal(size=(30, 3)).tolist()]
    features = [wall_feature(*row) for row in rng.uniform((-3.0, 0.3), (3.0, 1.8), (30, 2))]
    for scan, (pose, feature) in enumerate(zip(believed, features, strict=True)):
        chains.add_root(Link(feature.segment.transformed(pose), scan, 0, feature), 1.0)
    here, rows = Pose(0.2, -0.1, 0.4), np.array([pose.as_row() for pose in believed])
    links = [chains[k].root.segment for k in range(30)]
    asked = [Association(int(f), k, 0, 0.0, 0.0, 0.0) for k, f in enumerate(rng.permutation(30))]
    found = follows_the_wall(here, features, asked, chains, lambda scans: rows[scans], ON)
    plain = [follows_plainly(here, features[a.feature], links[a.chain], believed[a.chain]) for a in asked]
    assert found.tolist() == plain and 5 < sum(plain) < 25


def test_the_paper_believes_every_association():
    features = wall_feature(math.pi / 2, 1.0), wall_feature(math.atan2(1.0, -0.5), math.hypot(1.0, 0.5))
    assert verdict(poses(0.0, 0.5, 0.0), features, TurningConfig())
    assert not verdict(poses(0.0, 0.5, 0.0), features)


def test_nothing_associated_nothing_judged():
    out = follows_the_wall(Pose(0, 0, 0), [], [], ChainMap(), lambda scans: np.zeros((len(scans), 3)), ON)
    assert out.shape == (0,) and out.dtype == np.bool_
