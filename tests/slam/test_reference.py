# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A line through all links of a chain lies nearer the wall than the root that one scan saw."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import wall_feature

from sonar_explore.geometry import Pose, Segment, wrap_undirected
from sonar_explore.slam.chains import Chain, Link
from sonar_explore.slam.reference import ReferenceConfig, reference_line

REFINED = ReferenceConfig(refined=True)


def chain_on(wall, along, foot_sigma_m, direction_sigma_rad, rng):
    """A chain whose links were seen at these places along a wall (direction, distance from the origin)."""
    direction, distance = wall
    c, s = math.cos(direction), math.sin(direction)
    links = []
    for i, at in enumerate(along):
        across, turn = distance + rng.normal(0, foot_sigma_m), direction + rng.normal(0, direction_sigma_rad)
        x, y, dx, dy = at * c - across * s, at * s + across * c, 0.2 * math.cos(turn), 0.2 * math.sin(turn)
        links.append(Link(Segment(x - dx, y - dy, x + dx, y + dy), i, 0, wall_feature(0.0, 1.0)))
    return Chain(0, tuple(links), 0, 1.0, False)


def errors(line, wall):
    direction, distance = wall
    x, y = line.midpoint
    off = -x * math.sin(direction) + y * math.cos(direction) - distance
    return abs(wrap_undirected(line.direction - direction)), abs(off)


walls = st.tuples(st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))


@settings(deadline=None)
@given(walls, st.integers(1, 8))
def test_links_that_agree_leave_the_line_on_the_wall(wall, count):
    chain = chain_on(wall, np.linspace(0.0, 3.0, count), 0.0, 0.0, np.random.default_rng(0))
    turn, off = errors(reference_line(chain, REFINED), wall)
    assert turn < 1e-9 and off < 1e-9


def test_on_average_the_refined_line_is_far_nearer_the_wall_than_the_root():
    rng, root, refined = np.random.default_rng(1), [], []
    for _ in range(200):
        wall = rng.uniform(-1.5, 1.5), rng.uniform(-3, 3)
        chain = chain_on(wall, rng.uniform(0, 3, 6), 0.015, math.radians(2.0), rng)
        root.append(errors(reference_line(chain, ReferenceConfig()), wall))
        refined.append(errors(reference_line(chain, REFINED), wall))
    assert (np.mean(refined, axis=0) < (0.35, 0.75) * np.mean(root, axis=0)).all()


def test_one_link_far_off_hardly_moves_the_line():
    rng, wall = np.random.default_rng(2), (0.4, 1.0)
    good = chain_on(wall, np.linspace(0, 3, 8), 0.01, math.radians(1.0), rng)
    bad = chain_on((0.4, 1.3), [1.4], 0.0, 0.0, rng).links
    line = reference_line(Chain(0, good.links + bad, 0, 1.0, False), REFINED)
    turn, off = errors(line, wall)
    assert turn < math.radians(2.0) and off < 0.03


@settings(deadline=None)
@given(walls, st.integers(0, 1000), st.floats(-3, 3), st.floats(-2, 2))
def test_the_line_turns_and_shifts_with_the_map(wall, seed, turn, shift):
    chain = chain_on(wall, np.linspace(0, 2, 4), 0.02, math.radians(2.0), np.random.default_rng(seed))
    pose = Pose(shift, -shift, turn)
    there = tuple(Link(k.segment.transformed(pose), k.scan, 0, k.feature) for k in chain.links)
    moved = reference_line(Chain(0, there, 0, 1.0, False), REFINED)
    expected = reference_line(chain, REFINED).transformed(pose)
    assert moved.midpoint == pytest.approx(expected.midpoint, abs=1e-6)
    assert wrap_undirected(moved.direction - expected.direction) == pytest.approx(0.0, abs=1e-6)


def test_the_paper_and_a_chain_of_one_link_refer_to_the_root():
    chain = chain_on((0.3, 1.0), [0.0, 1.0, 2.0], 0.02, 0.03, np.random.default_rng(3))
    assert reference_line(chain, ReferenceConfig()) == chain.root.segment
    assert reference_line(Chain(0, chain.links[:1], 0, 1.0, False), REFINED) == chain.root.segment
