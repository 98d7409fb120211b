# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Evidence kept in rows is that of all scans; kernels that mark and pair it agree with their plain forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.mapping.evidence import Evidence, Rows, Standing
from sonar_explore.mapping.looks import BINS, Look, _hear
from sonar_explore.mapping.walls import bridges, pivot_points

seeds = st.integers(0, 10_000)


def random_look(rng):
    walls, passed = (
        rng.uniform(-2.0, 2.0, (rng.integers(0, 5), 4)),
        rng.uniform(-2.0, 2.0, (rng.integers(3), 4)),
    )
    points = rng.uniform(-2.0, 2.0, (rng.integers(0, 4), 2))
    return Look(rng.uniform(0, 1, BINS), rng.uniform(0, 1, BINS), walls, 2.0 * walls, points, passed)


def random_walls(rng, count):
    """Crowded, so that many ends and feet lie near each other."""
    first = rng.uniform(0.0, 2.0, (count, 2))
    return np.hstack([first, first + rng.uniform(-0.6, 0.6, (count, 2))])


@settings(max_examples=50, deadline=None)
@given(seeds)
def test_rows_that_are_put_and_replaced_stand_by_scan(seed):
    rng, rows = np.random.default_rng(seed), Rows(3)
    held: list[np.ndarray] = []
    for _ in range(80):
        scan = int(rng.integers(0, len(held) + 1))
        new = rng.uniform(size=(rng.integers(0, 6), 3))
        held[scan : scan + 1] = [new]
        rows.put(scan, new)
    assert (rows.all == np.concatenate(held)).all()
    assert rows.first.tolist() == np.cumsum([0, *map(len, held)]).tolist()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_what_stands_with_a_scan_goes_where_that_goes_whatever_else_comes_and_goes(seed):
    rng, standing = np.random.default_rng(seed), Standing()
    poses = [Pose(*rng.uniform(-1.0, 1.0, 3)) for _ in range(4)]
    pieces: list[tuple[int, np.ndarray]] = []
    for _ in range(6):
        poses = [Pose(*rng.uniform(-1.0, 1.0, 3)) if rng.random() < 0.3 else pose for pose in poses]
        pieces = [piece for piece in pieces if rng.random() < 0.9]
        pieces += [(int(rng.integers(4)), rng.uniform(-1.0, 1.0, (1, 4))) for _ in range(rng.integers(3))]
        expected = [poses[scan].transform(ends.reshape(-1, 2)).reshape(4) for scan, ends in pieces]
        assert (standing.at(poses, pieces) == np.reshape(expected, (-1, 4))).all()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_evidence_is_placed_where_its_scans_are_believed_to_stand(seed):
    rng, evidence = np.random.default_rng(seed), Evidence(still_m=0.0, far_still_m=0.0, lever_m=1.5)
    poses: list[Pose] = []
    looks: list[Look] = []
    for _ in range(6):
        poses = [Pose(*rng.uniform(-1.0, 1.0, 3)) if rng.random() < 0.3 else pose for pose in poses]
        looks[-1:] = [random_look(rng)] if looks else []  # as what was passed comes to the last scan
        poses.append(Pose(*rng.uniform(-1.0, 1.0, 3)))
        looks.append(random_look(rng))
        evidence.place(poses, looks)
        placed = list(zip(poses, looks, strict=True))
        for rows, own in (
            (evidence.walls, "walls"),
            (evidence.continuations, "continuations"),
            (evidence.bounds, "bounds"),
        ):
            parts = [p.transform(getattr(look, own).reshape(-1, 2)).reshape(-1, 4) for p, look in placed]
            assert rows.all == pytest.approx(np.concatenate(parts), abs=1e-12)
        points = np.concatenate([p.transform(look.points) for p, look in placed])
        assert evidence.points.all == pytest.approx(points, abs=1e-12)
        assert evidence.at.all.tolist() == [list(p.as_row()) for p in poses]
        assert (evidence.clear_m.all == [look.clear_m for look in looks]).all()


@settings(max_examples=50, deadline=None)
@given(seeds)
def test_bridges_join_all_ends_of_two_walls_that_a_tree_finds_near_each_other(seed):
    rng = np.random.default_rng(seed)
    walls, gap = random_walls(rng, int(rng.integers(0, 40))), 0.36
    ends = np.vstack([walls[:, :2], walls[:, 2:]])
    pairs = sorted(cKDTree(ends).query_pairs(gap)) if len(ends) else []
    expected = [[*ends[i], *ends[j]] for i, j in pairs if (j - i) % max(1, len(walls))]
    assert sorted(bridges(walls, gap).tolist()) == sorted(expected)


@settings(max_examples=50, deadline=None)
@given(seeds)
def test_a_wall_is_none_where_a_tree_finds_another_scans_foot_under_another_normal(seed):
    rng = np.random.default_rng(seed)
    walls, within, turn = random_walls(rng, 60), 0.1, math.radians(15.0)
    scan = np.sort(rng.integers(0, 8, 60))
    feet = 0.5 * (walls[:, :2] + walls[:, 2:])
    tangent = np.arctan2(walls[:, 3] - walls[:, 1], walls[:, 2] - walls[:, 0])
    expected = np.zeros(60, dtype=bool)
    for i, j in cKDTree(feet).query_pairs(within):
        if scan[i] != scan[j] and abs(wrap_angle(tangent[i] - tangent[j])) >= turn:
            expected[[i, j]] = True
    assert (pivot_points(walls, scan, within, turn) == expected).all()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_features_narrow_the_bins_that_their_width_covers_and_walls_are_sure_about_their_middle(seed):
    rng, core_rad = np.random.default_rng(seed), math.radians(5.0)
    bins = (np.arange(BINS) + 0.5) * (2.0 * math.pi / BINS)
    features = np.column_stack(
        [rng.uniform(-4.0, 4.0, 5), rng.uniform(0.0, 0.6, 5), rng.uniform(0.3, 2.0, 5), rng.integers(0, 2, 5)]
    )
    clear, core = rng.uniform(0.0, 2.0, BINS), np.zeros(BINS)
    expected, sure = clear.copy(), core.copy()
    for bearing, width, range_m, is_wall in features:
        off = np.abs((bins - bearing + math.pi) % (2.0 * math.pi) - math.pi)
        near = off <= 0.5 * width
        expected[near] = np.minimum(expected[near], range_m - 0.05)
        centre = (off <= core_rad) & (is_wall > 0)
        sure[centre] = np.maximum(sure[centre], range_m - 0.05)
    _hear(features, bins, 0.05, core_rad, clear, core)
    assert (clear == expected).all() and (core == sure).all()
