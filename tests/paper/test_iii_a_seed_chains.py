# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.A: the first scan seeds the chains."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import rectangle, scan_room, wall_feature

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose
from sonar_explore.slam import ChainMap, FeatureKind, Link, SlamConfig, make_slam

ROOM, CORNERS = rectangle(2.6, 2.2)
START = Pose(1.2, 0.9, 0.3)


def link(x=0.0, scan=0):
    feature = wall_feature(0.2, 1.0)
    return Link(feature.segment.transformed(Pose(x, 0.0, 0.0)), scan, 0, feature)


def test_every_wall_of_the_first_scan_roots_a_chain_of_certainty_one():
    slam = make_slam("chain", START, SlamConfig())
    update = slam.update(scan_room(START, ROOM, CORNERS))
    walls = [f for f in update.features if f.kind is FeatureKind.WALL]
    assert len(walls) == len(slam.chains) == len(update.new_chains) == 4
    assert all(c.root_probability == 1.0 and not c.dangling for c in slam.chains.chains)
    assert [c.root.feature for c in slam.chains.chains] == walls


def test_corners_and_edges_root_no_chain():
    slam = make_slam("chain", START, SlamConfig())
    update = slam.update(scan_room(START, ROOM, CORNERS))
    assert any(f.kind is FeatureKind.CORNER for f in update.features)
    assert all(c.root.feature.kind is FeatureKind.WALL for c in slam.chains.chains)


def test_a_scan_of_the_same_room_lengthens_every_chain():
    slam = make_slam("chain", START, SlamConfig())
    for _ in range(3):
        slam.update(scan_room(START, ROOM, CORNERS))
    assert [len(c.links) for c in slam.chains.chains] == [3, 3, 3, 3]
    assert [link.scan for link in slam.chains.chains[0].links] == [0, 1, 2]


def test_a_first_scan_that_hears_nothing_leaves_the_next_one_first():
    slam = make_slam("chain", START, SlamConfig())
    assert slam.update(scan_room(START, [])).features == ()
    slam.update(scan_room(START, ROOM))
    assert {c.root_probability for c in slam.chains.chains} == {1.0}


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.sampled_from("rlmpc"), st.integers(0, 50), st.integers(0, 50)), max_size=60))
def test_the_stack_and_the_chains_say_the_same_and_ids_are_never_used_again(actions):
    chains, seen, ids, poses = ChainMap(), set(), list[int](), dict[int, Pose]()
    for step, (action, i, j) in enumerate(actions):
        if action == "r" or not ids:
            new = chains.add_root(link(scan=step), 0.5)
            assert new not in seen
            seen.add(new)
            ids.append(new)
        elif action == "l":
            chains.add_link(ids[i % len(ids)], link(scan=step))
        elif action == "p":  # a scan, and the one after it, move
            moved = Pose(0.1 * j, -0.3, 0.05 * j)
            poses |= {i: moved, i + 1: moved}
            chains.place(np.array([i, i + 1]), np.array([moved.as_row()] * 2))
        elif action == "c":  # somebody looks
            assert chains[ids[i % len(ids)]].links
        elif ids[i % len(ids)] != ids[j % len(ids)]:
            chains.merge(ids[i % len(ids)], ids[j % len(ids)])
            del ids[j % len(ids)]
        poses.pop(step, None)  # what comes after its scan was placed is where it is said to be
    assert [chain.id for chain in chains.chains] == ids
    rows = zip(chains.segments, *chains.owners.T, strict=True)
    for k, (segment, chain_id, index, scan) in enumerate(rows):
        found = chains[int(chain_id)].links[index]
        assert (found.scan, chains.row(int(chain_id), index)) == (scan, k)
        placed = found.feature.segment.transformed(poses.get(scan, Pose(0.0, 0.0, 0.0)))
        assert found.segment.as_row() == pytest.approx(tuple(segment))
        assert found.segment.as_row() == pytest.approx(placed.as_row())
    for chain in chains.chains:
        assert chain.ends.tolist() == [[*each.segment.as_row()] for each in chain.links]
        assert chain.root == chain.links[chain.root_index]
    assert len(chains.segments) == sum(len(c.links) for c in chains.chains)


def test_links_can_be_placed_again_with_their_scans():
    chains = ChainMap()
    chain = chains.add_root(link(scan=0), 1.0)
    chains.add_link(chain, link(scan=1))
    moved = Pose(0.3, -0.1, math.pi / 3)
    chains.place(np.array([1]), np.array([moved.as_row()]))
    expected = link().feature.segment.transformed(moved).as_row()
    assert chains[chain].links[1].segment.as_row() == pytest.approx(expected)
    assert chains.segments[1] == pytest.approx(np.array(expected))
    assert chains[chain].links[0] == link(scan=0)


def test_an_unknown_chain_is_named_in_the_error():
    with pytest.raises(SonarExploreError, match="no chain 7"):
        ChainMap()[7]
