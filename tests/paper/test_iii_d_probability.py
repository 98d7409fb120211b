# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.D: how sure an association is, equations (1) and (2)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.slam.association import Association
from sonar_explore.slam.probability import (
    ProbabilityConfig,
    association_probabilities,
    clusters,
    p_angle,
    p_distance,
)

CONFIG = ProbabilityConfig()
FIVE = math.radians(5.0)


def probabilities(adr_deg, gaps=None):
    gaps = gaps or [0.0] * len(adr_deg)
    kept = [Association(i, i, 0, 0.0, gap, 0.0) for i, gap in enumerate(gaps)]
    return association_probabilities(kept, np.radians(adr_deg), CONFIG)


def test_the_largest_cluster_comes_first():
    assert clusters(np.radians([1.0, 8.0, 7.0, 9.0]), FIVE) == ((2, 1, 3), (0,))


def test_of_two_clusters_of_one_size_the_closer_comes_first():
    assert clusters(np.radians([0.0, 3.0, 20.0, 21.0]), FIVE)[0] == (2, 3)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-30, 30), max_size=9))
def test_clusters_share_out_all_and_stay_within_5_degrees_of_their_means(adr_deg):
    adr = np.radians(adr_deg)
    groups = clusters(adr, FIVE)
    assert sorted(i for group in groups for i in group) == list(range(len(adr)))
    for group in groups:
        members = adr[list(group)]
        assert np.abs(members - members.mean()).max() <= FIVE + 1e-9


def test_figure_10a_is_one_to_half_a_door_and_nothing_at_50_cm():
    assert [p_distance(d, CONFIG) for d in (0.0, 0.4, 0.45, 0.5, 0.6)] == pytest.approx([1, 1, 0.5, 0, 0])


def test_figure_10b_is_a_triangle_of_5_degrees():
    angles = [math.radians(a) for a in (0.0, 2.5, -2.5, 5.0, 7.0)]
    assert [p_angle(a, CONFIG) for a in angles] == pytest.approx([1, 0.5, 0.5, 0, 0])


def test_equation_2_is_the_union_of_the_three():
    # Two of three share a cluster with mean 1: P(cluster) 2/3; gap 0.45: P(dist) 1/2; 1 off: P(ang) 4/5.
    (first, _, _) = probabilities([0.0, 2.0, 12.0], gaps=[0.45, 0.0, 0.0])
    assert first == pytest.approx(1 - (1 / 3) * (1 / 2) * (1 / 5))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(-30, 30), st.floats(0, 0.5)), min_size=1, max_size=8))
def test_a_probability_is_at_least_the_share_of_its_cluster(drawn):
    adr, gaps = map(list, zip(*drawn, strict=True))
    found = probabilities(adr, gaps)
    shares = {i: len(g) / len(adr) for g in clusters(np.radians(adr), FIVE) for i in g}
    assert all(shares[i] - 1e-9 <= p <= 1.0 for i, p in enumerate(found))
