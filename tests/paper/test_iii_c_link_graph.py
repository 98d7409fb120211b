# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.C: link graphs, with the paper's own example of figures 5 to 9."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import residuals_to_roots, wall_feature

from sonar_explore.geometry import Pose
from sonar_explore.slam import ChainMap, Link
from sonar_explore.slam.association import Association, AssociationConfig, associate
from sonar_explore.slam.link_graph import LinkGraphConfig, fit_link_graphs
from sonar_explore.slam.residuals import Residuals

# Roots by (bearing of the normal [deg], distance [m]) from the robot. Chain 4 is an open door beside a wall.
ROOTS = [(90.0, 1.0), (-90.0, 1.0), (0.0, 1.2), (90.0, 1.5)]
# Features by name: (chain, ADR [deg], farther than the root by [m]). c is no wall; f lies behind the door.
FEATURES = {
    "a": (1, -3.0, 0.02),
    "b": (2, 0.5, -0.02),
    "c": (3, 7.0, 0.02),
    "d": (3, 1.0, 0.01),
    "f": (4, 3.0, 0.18),
}
NAMES = list(FEATURES)


ORIGIN = Pose(0.0, 0.0, 0.0)


def graphs_of_figure_5(frame=ORIGIN):
    chains = ChainMap()
    for bearing, distance in ROOTS:
        root = wall_feature(math.radians(bearing), distance, math.radians(30.0))
        chains.add_root(Link(root.segment.transformed(frame), 0, 0, root), 1.0)
    seen = []
    for chain, adr, farther in FEATURES.values():
        bearing, distance = ROOTS[chain - 1]
        seen.append(wall_feature(math.radians(bearing - adr), distance + farther))
    associations = associate(frame, seen, chains, AssociationConfig())
    residuals = residuals_to_roots(frame, seen, associations, chains)
    return fit_link_graphs(associations, residuals, LinkGraphConfig()), residuals


def names(edges):
    return {NAMES[i] for i in np.flatnonzero(edges)}


def test_figure_6_the_initial_link_graph_has_five_features_on_four_chains():
    graphs, _ = graphs_of_figure_5()
    assert [(NAMES[a.feature], a.chain + 1) for a in graphs.associations] == [
        (name, chain) for name, (chain, _, _) in FEATURES.items()
    ]
    graph = graphs.graph()
    above = [node for node, layer in graph.nodes(data="bipartite") if layer == 0]
    assert len(above) == 4 and graph.number_of_nodes() == 9 and graph.number_of_edges() == 5


def test_adr_and_ndr_are_what_the_example_was_built_from():
    _, residuals = graphs_of_figure_5()
    assert np.degrees(residuals.adr_rad) == pytest.approx([adr for _, adr, _ in FEATURES.values()])
    assert np.abs(residuals.ndr_m) == pytest.approx([abs(d) for _, _, d in FEATURES.values()])


def test_figure_7_the_fits_of_b_d_and_f_win_the_angle_fit():
    graphs, _ = graphs_of_figure_5()
    assert [NAMES[i] for i in graphs.angle_winners] == ["b", "d", "f"]


def test_figure_8_fitting_a_b_c_or_d_wins_the_distance_fit_with_the_same_graph():
    graphs, _ = graphs_of_figure_5()
    assert [NAMES[i] for i in graphs.distance_winners] == ["a", "b", "c", "d"]
    assert all(names(graphs.distance_fits[i]) == {"a", "b", "c", "d"} for i in graphs.distance_winners)
    assert len(names(graphs.distance_fits[NAMES.index("f")])) < 4


def test_figure_9_c_and_f_are_removed():
    graphs, _ = graphs_of_figure_5()
    assert names(graphs.final) == {"a", "b", "d"}
    assert graphs.graph(graphs.final).number_of_edges() == 3


@settings(max_examples=40, deadline=None)
@given(st.floats(-3, 3), st.floats(-20, 20), st.floats(-20, 20))
def test_where_the_map_frame_lies_does_not_matter(heading, x, y):
    here, _ = graphs_of_figure_5()
    there, _ = graphs_of_figure_5(Pose(x, y, heading))
    assert (here.final == there.final).all() and here.angle_winners == there.angle_winners
    assert (here.angle_fits == there.angle_fits).all() and (here.distance_fits == there.distance_fits).all()


def edges(adr_deg, ndr, bearings_deg, p=None):
    n = len(adr_deg)
    bearings = np.radians(bearings_deg)
    normals = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    ndr = np.array(ndr, dtype=float)
    probability = np.array(p if p is not None else [1.0] * n)
    residuals = Residuals(
        np.radians(adr_deg), ndr, normals, ndr, normals, probability, np.ones(n), np.ones(n)
    )
    return [Association(i, i, 0, 0.0, 0.0, 0.0) for i in range(n)], residuals


def final(*args, **kwargs):
    associations, residuals = edges(*args, **kwargs)
    return list(np.flatnonzero(fit_link_graphs(associations, residuals, LinkGraphConfig()).final))


def test_no_association_gives_no_winner():
    associations, residuals = edges([], [], [])
    graphs = fit_link_graphs(associations, residuals, LinkGraphConfig())
    assert graphs.pair is None and graphs.kept == () and graphs.graph().number_of_edges() == 0


def test_a_single_association_agrees_with_itself():
    assert final([9.0], [0.15], [0.0]) == [0]


def test_a_common_error_keeps_everything():
    assert final([8.0] * 4, [0.1] * 4, [0.0, 0.0, 0.0, 0.0]) == [0, 1, 2, 3]


def test_equal_pairs_are_decided_by_the_smaller_misfit():
    assert final([0.0, 0.0, 20.0, 20.5], [0.0] * 4, [0, 90, 0, 90]) == [0, 1]


def test_then_by_the_more_certain_roots():
    assert final([0.0, 0.0, 20.0, 20.0], [0.0] * 4, [0, 90, 0, 90], p=[0.5, 0.5, 1, 1]) == [2, 3]


def test_then_by_the_smaller_ids():
    assert final([0.0, 0.0, 20.0, 20.0], [0.0] * 4, [0, 90, 0, 90]) == [0, 1]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-20, 20), st.floats(-0.2, 0.2), st.floats(-90, 90)), min_size=1, max_size=8)
)
def test_every_fit_keeps_the_edge_that_it_fits_and_the_winner_fits_both_ways(drawn):
    associations, residuals = edges(*map(list, zip(*drawn, strict=True)))
    graphs = fit_link_graphs(associations, residuals, LinkGraphConfig())
    assert graphs.angle_fits.diagonal().all() and graphs.distance_fits.diagonal().all()
    best = max(
        (graphs.angle_fits[a] & graphs.distance_fits[d]).sum()
        for a in graphs.angle_winners
        for d in graphs.distance_winners
    )
    assert graphs.final.sum() == best


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=2, max_size=6))
def test_the_sense_of_a_normal_is_a_convention(adr):
    n = len(adr)
    associations, residuals = edges(adr, [0.05 * (-1) ** i for i in range(n)], [40.0 * i for i in range(n)])
    flipped = replace(residuals, ndr_m=-residuals.ndr_m, normals=-residuals.normals)
    first, second = (fit_link_graphs(associations, r, LinkGraphConfig()) for r in (residuals, flipped))
    assert (first.final == second.final).all()
