# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The kernels of residuals and link graphs say what the plain forms say."""

import math

import numpy as np
import pytest
from synthetic import residuals_to_roots, wall_feature

from sonar_explore.geometry import Pose, Segment, wrap_undirected
from sonar_explore.slam import ChainMap, Link
from sonar_explore.slam.association import Association
from sonar_explore.slam.link_graph import SLACK, LinkGraphConfig, fit_link_graphs


def random_residuals(seed):
    """Of walls that met chains of two links each, anywhere."""
    rng = np.random.default_rng(seed)
    n, chains, features, associations = int(rng.integers(1, 12)), ChainMap(), [], []
    for i in range(n):
        ends = rng.uniform(-3, 3, (2, 4))
        links = [Link(Segment(*row), 0, 0, wall_feature(0.0, 1.0)) for row in ends.tolist()]
        chains.add_link(chains.add_root(links[0], float(rng.uniform(0.5, 1.0))), links[1])
        features.append(wall_feature(*rng.uniform((-3, 0.3), (3, 2.0))))
        associations.append(Association(i, i, 1, 0.0, 0.0, 0.0))
    pose = Pose(*rng.uniform(-3, 3, 3).tolist())
    return pose, features, chains, associations, residuals_to_roots(pose, features, associations, chains)


def plain_offset(pose, feature, line):
    """Angle to the line [rad], signed normal distance once parallel to it [m]."""
    normal_in_map = pose.heading + feature.bearing_rad
    angle = wrap_undirected(line.direction - (normal_in_map + math.pi / 2))
    x = pose.x + feature.range_m * math.cos(normal_in_map + angle)
    y = pose.y + feature.range_m * math.sin(normal_in_map + angle)
    return angle, line.signed_distance(x, y)


@pytest.mark.parametrize("seed", range(20))
def test_residuals_are_taken_to_the_lines_of_root_and_link(seed):
    pose, features, chains, associations, found = random_residuals(seed)
    for i, a in enumerate(associations):
        feature, (root, link) = features[a.feature], (k.segment for k in chains[a.chain].links)
        assert (found.adr_rad[i], found.ndr_m[i]) == plain_offset(pose, feature, root)
        assert found.link_ndr_m[i] == plain_offset(pose, feature, link)[1]
        assert tuple(found.normals[i]) == root.unit_normal
        assert tuple(found.link_normals[i]) == link.unit_normal
        assert found.root_probability[i] == chains[a.chain].root_probability
        assert (found.range_m[i], found.discs[i]) == (feature.range_m, feature.discs)


def plain_fits(residuals, config):
    """The misfits of angle and distance, row i fitted, over their thresholds."""
    adr, distance, normals = residuals.adr_rad, residuals.ndr_m, residuals.normals
    th = np.abs(adr).mean() + config.angle_margin_rad
    th2 = np.abs(distance).mean() + config.distance_margin_m
    shifted = distance[None, :] - distance[:, None] * (normals @ normals.T)
    return np.abs(wrap_undirected(adr[None, :] - adr[:, None])) / th, np.abs(shifted) / th2


@pytest.mark.parametrize("seed", range(60))
def test_the_winners_are_those_of_the_plain_form(seed):
    *_, associations, residuals = random_residuals(seed)
    config = LinkGraphConfig()
    angle, distance = plain_fits(residuals, config)
    fits = angle <= 1.0 + SLACK, distance <= 1.0 + SLACK
    winners = [tuple(np.flatnonzero(f.sum(axis=1) == f.sum(axis=1).max()).tolist()) for f in fits]

    def rank(a, d):
        common = fits[0][a] & fits[1][d]
        cost, trust = (angle[a] + distance[d])[common].sum(), residuals.root_probability[common].sum()
        return -common.sum(), round(cost, 9), -round(trust, 9), a, d

    best = min((rank(a, d) for a in winners[0] for d in winners[1]), default=None)
    found = fit_link_graphs(associations, residuals, config)
    assert (found.angle_fits == fits[0]).all() and (found.distance_fits == fits[1]).all()
    assert [found.angle_winners, found.distance_winners] == winners
    assert best is not None and found.pair == best[3:]
    assert (found.final == (fits[0][best[3]] & fits[1][best[4]])).all()
