# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.B: gates, and one association for each feature and chain."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import wall_feature

from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam import ChainMap, Feature, FeatureKind, Link
from sonar_explore.slam.association import AssociationConfig, associate

CONFIG = AssociationConfig()
ORIGIN = Pose(0.0, 0.0, 0.0)


def link(segment, scan=0):
    return Link(segment, scan, 0, wall_feature(0.0, 1.0))


def feature(*ends):
    segment = Segment(*ends)
    x, y = segment.midpoint
    return Feature(FeatureKind.WALL, math.atan2(y, x), math.hypot(x, y), 0.3, segment, ())


def meets(new, old, pose=ORIGIN):
    chains = ChainMap()
    chains.add_root(link(Segment(*old)), 1.0)
    return associate(pose, [feature(*new)], chains, CONFIG)


def test_an_overlapping_wall_within_20_cm_is_associated():
    (found,) = meets((0, 1.19, 1, 1.19), (0.5, 1, 2, 1))
    assert found.line_distance_m == pytest.approx(0.19)
    assert found.end_gap_m == 0.0


def test_a_wall_21_cm_away_is_not():
    assert meets((0, 1.21, 1, 1.21), (0.5, 1, 2, 1)) == ()


def test_a_wall_turned_by_more_than_20_degrees_is_not():
    for degrees, count in ((19.0, 1), (21.0, 0), (-19.0, 1), (-21.0, 0)):
        c, s = 0.2 * math.cos(math.radians(degrees)), 0.2 * math.sin(math.radians(degrees))
        assert len(meets((-c, 1 - s, c, 1 + s), (-1, 1, 1, 1))) == count


def test_a_gap_of_up_to_half_a_metre_may_lie_between():
    assert len(meets((0, 1, 1, 1), (1.49, 1, 2, 1))) == 1
    assert meets((0, 1, 1, 1), (1.51, 1, 2, 1)) == ()


def test_d1_is_the_mean_over_both_ends_and_the_middle():
    (found,) = meets((0, 1.0, 1, 1.12), (0, 1, 1, 1))
    assert found.line_distance_m == pytest.approx((0.0 + 0.06 + 0.12) / 3)


def test_ends_in_either_order_are_one_wall():
    assert meets((1, 1, 0, 1.05), (0.5, 1, 2, 1)) and meets((0, 1.05, 1, 1), (2, 1, 0.5, 1))


def test_the_closest_link_stands_for_its_chain():
    chains = ChainMap()
    chain = chains.add_root(link(Segment(0, 1.1, 1, 1.1)), 1.0)
    chains.add_link(chain, link(Segment(0, 1.02, 1, 1.02), scan=1))
    (found,) = associate(ORIGIN, [feature(0, 1, 1, 1)], chains, CONFIG)
    assert (found.chain, found.link) == (chain, 1)


def test_equal_links_give_way_to_the_older():
    chains = ChainMap()
    chain = chains.add_root(link(Segment(0, 1.1, 1, 1.1)), 1.0)
    chains.add_link(chain, link(Segment(0, 1.1, 1, 1.1), scan=1))
    assert associate(ORIGIN, [feature(0, 1, 1, 1)], chains, CONFIG)[0].link == 0


def test_a_feature_may_meet_two_chains():
    chains = ChainMap()
    chains.add_root(link(Segment(0, 1.1, 1, 1.1)), 1.0)
    chains.add_root(link(Segment(0, 0.9, 1, 0.9)), 1.0)
    found = associate(ORIGIN, [feature(0, 1, 1, 1)], chains, CONFIG)
    assert [a.chain for a in found] == [0, 1]


def test_corners_and_edges_are_not_associated():
    point = Feature(FeatureKind.CORNER, 0.0, 1.0, 0.3, Segment(1, 0, 1, 0), ())
    chains = ChainMap()
    chains.add_root(link(Segment(1, -1, 1, 1)), 1.0)
    assert associate(ORIGIN, [point], chains, CONFIG) == ()


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.floats(-20, 20), st.floats(-20, 20), st.integers(0, 10_000))
def test_where_the_map_frame_lies_does_not_matter(heading, x, y, seed):
    rng = np.random.default_rng(seed)
    lines = rng.uniform(-1.5, 1.5, (12, 4))
    seen = [wall_feature(float(b), float(r)) for b, r in rng.uniform((-3, 0.3), (3, 2), (6, 2))]
    answers = []
    for frame in (ORIGIN, Pose(x, y, heading)):
        chains = ChainMap()
        for i, line in enumerate(lines):
            placed = link(Segment(*line).transformed(frame), i)
            if i < 6:
                chains.add_root(placed, 1.0)
            else:
                chains.add_link(i - 6, placed)
        answers.append([(a.feature, a.chain, a.link) for a in associate(frame, seen, chains, CONFIG)])
    assert answers[0] == answers[1]


@pytest.mark.parametrize("facing", [False, True])
def test_the_other_side_of_a_thin_wall_is_the_same_wall_to_the_letter_and_another_one_beyond_it(facing):
    chains = ChainMap()
    this_side = wall_feature(0.0, 1.0)
    chains.add_root(Link(this_side.segment, 0, 0, this_side), 0.9)
    beyond = Pose(2.15, 0.0, math.pi)  # the wall is 15 cm thick
    config = AssociationConfig(facing=facing)
    assert len(associate(beyond, [this_side], chains, config)) == (0 if facing else 1)
    assert len(associate(Pose(0.1, 0.2, 0.05), [this_side], chains, config)) == 1
