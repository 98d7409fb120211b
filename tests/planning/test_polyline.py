# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A polyline with fewer corners is that of scikit-image, to the last point."""

import numpy as np
import pytest
from skimage.measure import approximate_polygon

from sonar_explore.planning.polyline import fewer_corners


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
