# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.G: a feature that two chains claim makes them one."""

from synthetic import scan_room, wall_feature

from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam import ChainMap, Link, SlamConfig, make_slam
from sonar_explore.slam.association import Association
from sonar_explore.slam.dual import Merge, merge_dual_associations, surviving


def chain_map(*roots):
    """Chains from (P(root), dangling)."""
    chains = ChainMap()
    for i, (probability, dangling) in enumerate(roots):
        seen = wall_feature(0.1 * i, 1.0)
        chains.add_root(Link(seen.segment, i, 0, seen), probability, dangling=dangling)
    return chains


def edge(feature, chain):
    return Association(feature, chain, 0, 0.0, 0.0, 0.0)


def test_the_more_certain_root_survives():
    chains = chain_map((0.4, False), (0.9, False))
    assert merge_dual_associations(chains, [edge(0, 0), edge(0, 1)]) == (Merge(1, 0),)
    (chain,) = chains.chains
    assert chain.id == 1 and chain.root.scan == 1 and {link.scan for link in chain.links} == {0, 1}


def test_equal_roots_leave_the_older():
    chains = chain_map((0.5, False), (0.5, False))
    assert merge_dual_associations(chains, [edge(0, 0), edge(0, 1)]) == (Merge(0, 1),)


def test_a_merge_leaves_no_dangling_tag():
    chains = chain_map((1.0, False), (0.5, True))
    merge_dual_associations(chains, [edge(3, 0), edge(3, 1)])
    assert chains.dangling == ()


def test_two_features_on_two_chains_merge_nothing():
    chains = chain_map((1.0, False), (0.5, True))
    assert merge_dual_associations(chains, [edge(0, 0), edge(1, 1)]) == ()
    assert chains.dangling == (1,)


def test_merges_follow_one_another():
    chains = chain_map((0.2, False), (0.5, False), (0.9, False))
    merges = merge_dual_associations(chains, [edge(0, 0), edge(0, 1), edge(1, 1), edge(1, 2)])
    assert [c.id for c in chains.chains] == [2] and len(chains[2].links) == 3
    assert [surviving(i, merges) for i in (0, 1, 2)] == [2, 2, 2]


def test_a_wall_held_by_two_chains_becomes_one_and_its_feature_one_link():
    wall = [Segment(-3, 1, 3, 1)]
    slam = make_slam("chain", Pose(-1.2, 0, 0), SlamConfig())
    slam.update(scan_room(Pose(-1.2, 0, 0), wall))
    assert slam.update(scan_room(Pose(0, 0, 0), wall)).dangling == (1,)
    update = slam.update(scan_room(Pose(-0.6, 0, 0), wall))
    assert update.merges == (Merge(0, 1),) and update.dangling == ()
    assert [link.scan for link in slam.chains[0].links] == [0, 1, 2]
    assert 1 not in slam.chains
