# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The kernels that associate say what arrays of all pairs say, to the last bit."""

import math

import numpy as np
import pytest
from synthetic import wall_feature

from sonar_explore.geometry import Pose, Segment, wrap_undirected
from sonar_explore.slam import ChainMap, Link
from sonar_explore.slam.association import Association, AssociationConfig, associate

CONFIGS = [AssociationConfig(), AssociationConfig(end_gap_max_m=1.2, facing=True)]


def gaps_of(features, links):
    """d1, d2, a1, and whether both were heard from one side: of segments (m, 4) and (n, 4), shape (m, n) each."""
    feature_angles = np.arctan2(features[:, 3] - features[:, 1], features[:, 2] - features[:, 0])
    link_angles = np.arctan2(links[:, 3] - links[:, 1], links[:, 2] - links[:, 0])
    c, s = np.cos(link_angles), np.sin(link_angles)
    (dx1, dy1), (dx2, dy2) = (
        (features[:, None, k] - links[None, :, 0], features[:, None, k + 1] - links[None, :, 1])
        for k in (0, 2)
    )
    across1, across2 = dy1 * c - dx1 * s, dy2 * c - dx2 * s
    at1, at2 = dx1 * c + dy1 * s, dx2 * c + dy2 * s
    lengths = np.hypot(links[:, 2] - links[:, 0], links[:, 3] - links[:, 1])
    overlap = (np.maximum(at1, at2) >= 0.0) & (np.minimum(at1, at2) <= lengths)
    ends = [
        np.hypot(at - end, across)
        for at, across in ((at1, across1), (at2, across2))
        for end in (0.0, lengths)
    ]
    turn = link_angles[None, :] - feature_angles[:, None]
    return (
        (np.abs(across1) + np.abs(across2) + 0.5 * np.abs(across1 + across2)) / 3.0,
        np.where(overlap, 0.0, np.minimum.reduce(ends)),
        wrap_undirected(turn),
        np.cos(turn) > 0.0,
    )


def plain(pose, features, chains, config):
    """`associate`, every wall against every link."""
    placed = np.array([f.segment.transformed(pose).as_row() for f in features])
    distance, gap, angle, same_side = gaps_of(placed, chains.segments)
    inside = (distance <= config.line_distance_max_m) & (gap <= config.end_gap_max_m)
    inside &= np.abs(angle) <= config.angle_max_rad
    rows, columns = np.nonzero(inside & same_side if config.facing else inside)
    keys = [np.abs(by[rows, columns]).round(9) for by in (angle, gap, distance)]
    owners = chains.owners[columns, 0]
    best: dict[tuple[int, int], tuple[int, int]] = {}
    for k in np.lexsort((columns, *keys, owners, rows)):
        best.setdefault((rows[k], owners[k]), (rows[k], columns[k]))
    return tuple(
        Association(row, chain, chains.owners[column, 1], distance[at], gap[at], angle[at])
        for (row, chain), at in best.items()
        for _, column in [at]
    )


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("seed", range(20))
def test_every_wall_meets_the_link_of_each_chain_that_is_closest(seed, config):
    rng = np.random.default_rng(seed)
    chains = ChainMap()
    for x, y, angle in rng.uniform((-3, -3, -3.2), (3, 3, 3.2), (1000, 3)):
        c, s = 0.3 * math.cos(angle), 0.3 * math.sin(angle)
        link = Link(Segment(x - c, y - s, x + c, y + s), 0, 0, wall_feature(0.0, 1.0))
        if len(chains) < 90:
            chains.add_root(link, 1.0)
        else:
            chains.add_link(int(rng.integers(90)), link)
    pose = Pose(*rng.uniform((-2, -2, -7), (2, 2, 7)))
    features = [wall_feature(*row) for row in rng.uniform((-3.1, 0.3), (3.1, 2.0), (6, 2))]
    found = associate(pose, features, chains, config)
    assert found == plain(pose, features, chains, config)
    assert len(found) > 5
