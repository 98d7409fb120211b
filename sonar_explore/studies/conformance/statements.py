"""What section III of the paper says, statement by statement, and where it stands in code, tests and figures.

docs/conformance.md is made from this list and from the docstrings; `conformance.problems` checks it against both.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Statement:
    """One sentence, number or equation, in our words."""

    section: str
    """`III.A` to `III.G`."""
    says: str
    code: tuple[str, ...]
    """`file:name`, the file within `sonar_explore/`; its docstring or comment cites the section."""
    tests: tuple[str, ...]
    """Without `test_`, in the section's file in `tests/paper/`; `file:name` for another file."""
    figure: str
    """Of docs/figures/, or of the runs."""


def _a(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str = "5") -> Statement:
    return Statement("III.A", says, code, tests, figure)


def _b(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str = "5") -> Statement:
    return Statement("III.B", says, code, tests, figure)


def _c(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str) -> Statement:
    return Statement("III.C", says, code, tests, figure)


def _d(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str = "10") -> Statement:
    return Statement("III.D", says, code, tests, figure)


def _e(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str = "runs") -> Statement:
    return Statement("III.E", says, code, tests, figure)


def _f(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str = "12") -> Statement:
    return Statement("III.F", says, code, tests, figure)


def _g(says: str, code: tuple[str, ...], tests: tuple[str, ...], figure: str = "runs") -> Statement:
    return Statement("III.G", says, code, tests, figure)


_GRAPH = "slam/link_graph.py:"
_PROBABILITY = "slam/probability.py:"
_LOCAL = "slam/localization.py:"
_ASSOCIATION = "slam/association.py:"

STATEMENTS: tuple[Statement, ...] = (
    _a(
        "Features are extracted from the first scan; every wall roots a chain with P(root) = 1.",
        ("slam/slam.py:ChainSlam._root_new_chains", _PROBABILITY + "RootCertainty.of_first_scan"),
        ("every_wall_of_the_first_scan_roots_a_chain_of_certainty_one",),
    ),
    _a(
        "Only wall segments make chains.",
        ("slam/slam.py:ChainSlam._root_new_chains",),
        ("corners_and_edges_root_no_chain",),
    ),
    _a(
        "Later features become links or roots; a chain can grow both ways.",
        ("slam/chains.py:ChainMap.add_link", "slam/chains.py:ChainMap.add_root"),
        ("a_scan_of_the_same_room_lengthens_every_chain",),
    ),
    _b(
        "d1: mean distance of both ends and the middle from the other wall, 20 cm.",
        (_ASSOCIATION + "MAX_LINE_DISTANCE_M", _ASSOCIATION + "_gaps"),
        (
            "d1_is_the_mean_over_both_ends_and_the_middle",
            "an_overlapping_wall_within_20_cm_is_associated",
            "a_wall_21_cm_away_is_not",
        ),
    ),
    _b(
        "a1: angle between the two walls, 20 degrees.",
        (_ASSOCIATION + "MAX_ANGLE_RAD",),
        ("a_wall_turned_by_more_than_20_degrees_is_not",),
    ),
    _b(
        "d2: only where they do not overlap, distance of the nearest ends, 50 cm.",
        (_ASSOCIATION + "MAX_END_GAP_M",),
        ("a_gap_of_up_to_half_a_metre_may_lie_between",),
    ),
    _b(
        "A feature is associated with any link of a chain, not the root alone.",
        (_ASSOCIATION + "associate", _ASSOCIATION + "_closer"),
        ("the_closest_link_stands_for_its_chain", "equal_links_give_way_to_the_older"),
    ),
    _b(
        "The initial link graph: chains above, features below, an edge for each association.",
        (_GRAPH + "LinkGraphs",),
        (
            "test_iii_c_link_graph:figure_6_the_initial_link_graph_has_five_features_on_four_chains",
            "a_feature_may_meet_two_chains",
        ),
        "6",
    ),
    _c(
        "Angle fit: the robot is turned until one feature is parallel to its root, and the differences of all others "
        "to their roots are taken.",
        (_GRAPH + "_angle_misfit", "slam/residuals.py:residuals_to_lines"),
        ("adr_and_ndr_are_what_the_example_was_built_from",),
        "7",
    ),
    _c(
        "Edges within th = average angle difference + 2 degrees are kept; the graphs with most edges win.",
        (_GRAPH + "ANGLE_MARGIN_RAD", _GRAPH + "_best_pair"),
        ("figure_7_the_fits_of_b_d_and_f_win_the_angle_fit",),
        "7",
    ),
    _c(
        "Distance fit: every feature is made parallel to its root about the robot; all are shifted by one feature's "
        "normal distance.",
        (_GRAPH + "_distance_misfit", "slam/residuals.py:_offsets_to"),
        ("figure_8_fitting_a_b_c_or_d_wins_the_distance_fit_with_the_same_graph",),
        "8",
    ),
    _c(
        "Edges within th2 = average normal distance + 5 cm are kept.",
        (_GRAPH + "DISTANCE_MARGIN_M",),
        ("every_fit_keeps_the_edge_that_it_fits_and_the_winner_fits_both_ways",),
        "8",
    ),
    _c(
        "The final winner is the pair of an angle and a distance winner with most edges in common, and these edges.",
        (_GRAPH + "fit_link_graphs", _GRAPH + "_best_pair"),
        ("figure_9_c_and_f_are_removed", "equal_pairs_are_decided_by_the_smaller_misfit"),
        "9",
    ),
    _c(
        "Features with an edge in it become links of their chains, the others roots of new ones.",
        ("slam/slam.py:ChainSlam._grow_chains",),
        ("test_iii_e_new_chains:a_new_wall_seen_beside_a_known_one_takes_its_certainty",),
        "9",
    ),
    _d(
        "Features are clustered by their angle difference to their roots.",
        (_PROBABILITY + "clusters",),
        (
            "the_largest_cluster_comes_first",
            "clusters_share_out_all_and_stay_within_5_degrees_of_their_means",
        ),
    ),
    _d(
        "Equation (1): P(cluster) = elements in the cluster / all elements.",
        (_PROBABILITY + "association_probabilities",),
        ("a_probability_is_at_least_the_share_of_its_cluster",),
    ),
    _d(
        "P(dist), figure 10(a): by the distance to the nearest end of the link, from half a door's width to 50 cm.",
        (_PROBABILITY + "p_distance", _PROBABILITY + "DOOR_WIDTH_M", _PROBABILITY + "DISTANCE_ZERO_M"),
        ("figure_10a_is_one_to_half_a_door_and_nothing_at_50_cm",),
    ),
    _d(
        "P(ang), figure 10(b): by the angle from the cluster's mean, nothing at 5 degrees.",
        (_PROBABILITY + "p_angle", _PROBABILITY + "CLUSTER_HALF_WIDTH_RAD"),
        ("figure_10b_is_a_triangle_of_5_degrees",),
    ),
    _d(
        "Equation (2): P(association) is the union of the three.",
        (_PROBABILITY + "association_probabilities",),
        ("equation_2_is_the_union_of_the_three",),
    ),
    _e(
        "Equation (3), case (a), some feature was associated: P(new root) is the mean of P(root) of the associated "
        "chains.",
        (_PROBABILITY + "RootCertainty.after",),
        ("case_a_is_the_mean_of_the_associated_roots",),
    ),
    _e(
        "Case (b), none was: half of the most recent case (a), and the chain dangles.",
        (_PROBABILITY + "DANGLING_SHARE", _PROBABILITY + "RootCertainty", "slam/chains.py:Chain"),
        (
            "case_b_is_half_of_the_latest_case_a_and_dangles",
            "case_b_does_not_compound",
            "a_scan_that_meets_nothing_known_roots_dangling_chains",
        ),
    ),
    _e(
        "Exploration seeks unassociated features of case (a), avoids dangling chains, and seeks the missing link of "
        "those there are.",
        ("agents/frontier.py:FrontierPolicy",),
        (
            "agents/test_agents:frontier_prefers_new_area_up_to_enough_of_it",
            "agents/test_agents:frontier_prefers_places_where_known_chains_answer",
            "agents/test_agents:frontier_goes_some_way_for_a_missing_link_but_not_any_way",
        ),
        "20",
    ),
    _f(
        "Two steps: first the heading, then the position.",
        (_LOCAL + "localize",),
        ("no_association_gives_no_correction", "a_single_association_is_applied"),
    ),
    _f(
        "Equation (4): the heading that minimises the sum of (w1 + w2 + w3) times the angle differences to the roots.",
        (_LOCAL + "correct_heading", _LOCAL + "weighted_median"),
        ("no_heading_is_better_than_the_weighted_median", "a_pure_heading_error_is_undone_exactly"),
        "11",
    ),
    _f(
        "w1 is P(root) and w2 half of P(association).",
        (_LOCAL + "ASSOCIATION_SHARE", _LOCAL + "association_weights"),
        ("weights_add_and_w2_is_half_of_the_association",),
        "11",
    ),
    _f(
        "w3, figure 11: from 0.9 at 20 cm to 0.3 at 200 cm, the sonar's reliable ranges.",
        (_LOCAL + "NEAR_M", _LOCAL + "FAR_M", "amigobot.py:AmigoBot"),
        ("figure_11_w3_falls_from_near_to_far",),
        "11",
    ),
    _f(
        "The normal distance is split into (dx, dy); their largest values are the window of the search, so that an "
        "axis nothing observes is left alone.",
        (_LOCAL + "_window", _LOCAL + "correct_position"),
        ("in_a_corridor_the_axis_that_nothing_observes_is_left_alone", "ties_go_to_the_smallest_shift"),
    ),
    _f(
        "Equation (5): the shift that minimises the sum of (w1 + w3) times the normal distances to the roots, with the "
        "features made parallel.",
        (_LOCAL + "correct_position", _LOCAL + "_smallest_best_shift"),
        ("no_shift_in_the_window_is_better", "two_walls_at_right_angles_give_both_coordinates"),
    ),
    _f(
        "Readings and features are then placed by the corrected pose, and the map is drawn.",
        (_LOCAL + "Correction.applied_to",),
        ("a_pure_heading_error_is_undone_exactly",),
        "14",
    ),
    _g(
        "A feature associated with two chains is two instances all the way.",
        (_ASSOCIATION + "associate",),
        ("test_iii_b_association:a_feature_may_meet_two_chains",),
        "6",
    ),
    _g(
        "If both survive, the chains are merged: a loop is closed, or a missing link found.",
        ("slam/dual.py:merge_dual_associations",),
        ("a_wall_held_by_two_chains_becomes_one_and_its_feature_one_link", "merges_follow_one_another"),
        "18",
    ),
    _g(
        "The root with the higher probability is the new root.",
        ("slam/dual.py:merge_dual_associations",),
        ("the_more_certain_root_survives", "equal_roots_leave_the_older"),
        "18",
    ),
    _g(
        "The dangling tag is removed.",
        ("slam/chains.py:ChainMap.merge",),
        ("a_merge_leaves_no_dangling_tag",),
        "18",
    ),
)
