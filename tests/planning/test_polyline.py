# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A polyline with fewer corners is that of scikit-image, to the last point; what is noted of a way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import approximate_polygon

from sonar_explore.geometry import Pose
from sonar_explore.planning.polyline import fewer_corners, spaced


@pytest.mark.parametrize("seed", range(200))
def test_of_a_way_over_cells_the_same_corners_are_kept_as_by_scikit_image(seed):
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.integers(-1, 2, (30, 2)), rng.integers(1, 9, 30), axis=0)
    path = rng.normal(size=2) + 0.05 * np.cumsum(steps, axis=0)
    for tolerance_m in (0.10, 0.05, 0.025):
        assert np.array_equal(fewer_corners(path, tolerance_m), approximate_polygon(path, tolerance_m))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_short_one_is_left_as_it_is(n):
    path = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])[:n]
    assert np.array_equal(fewer_corners(path, 0.1), path)


@given(st.integers(0, 10_000), st.booleans())
def test_poses_are_taken_where_they_lie_as_far_from_the_last_one_taken(seed, begun):
    rng = np.random.default_rng(seed)
    poses = np.cumsum(rng.uniform(-0.03, 0.03, (60, 3)), axis=0)
    last = Pose(0.01, 0.0, 0.0) if begun else None
    expected, before = [], last
    for pose in (Pose(*row) for row in poses.tolist()):
        if before is None or pose.distance_to(before) >= 0.05:
            expected.append(pose)
            before = pose
    assert spaced(poses, last, 0.05) == expected
