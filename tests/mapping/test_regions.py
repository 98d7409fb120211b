# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Holes, regions and distances are those of scikit-image and SciPy, cell by cell."""

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from skimage.measure import label, regionprops
from skimage.morphology import remove_small_holes

from sonar_explore.mapping.distance import distances
from sonar_explore.mapping.regions import enclosed_blocks, labelled, without_holes
from sonar_explore.mapping.rows import differing_rows

seeds = st.integers(0, 10_000)


def patches(seed, shares=(0.95, 0.8, 0.6, 0.4)):
    rng = np.random.default_rng(seed)
    return rng.random(rng.integers(1, 40, 2)) < rng.choice(shares), rng


@settings(max_examples=150, deadline=None)
@given(seeds)
def test_small_holes_are_those_of_scikit_image(seed):
    mask, rng = patches(seed)
    most = int(rng.integers(1, 25))
    assert (without_holes(mask, most) == remove_small_holes(mask, max_size=most)).all()


@settings(max_examples=150, deadline=None)
@given(seeds)
def test_blocks_that_are_surrounded_are_those_of_scikit_image(seed):
    free, rng = patches(seed)
    least_m2 = float(rng.uniform(0.0025, 0.02))
    regions = regionprops(label(ndimage.binary_fill_holes(free) & ~free, connectivity=1))
    assert enclosed_blocks(free, (-1.0, 2.0), 0.05, least_m2) == [
        (-1.0 + (region.centroid[1] + 0.5) * 0.05, 2.0 + (region.centroid[0] + 0.5) * 0.05)
        for region in regions
        if region.area * 0.05**2 >= least_m2
    ]


@settings(max_examples=100, deadline=None)
@given(seeds)
def test_regions_are_those_of_scikit_image(seed):
    mask, _ = patches(seed)
    assert (label(mask, connectivity=2)[mask] - 1 == labelled(np.argwhere(mask))).all()


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_rows_differ_that_stand_more_often_in_one_list(seed):
    rng = np.random.default_rng(seed)
    first, second = (rng.integers(-1, 2, (rng.integers(0, 60), 4)).astype(float) for _ in range(2))
    if rng.random() < 0.7:  # the first ones and the last ones are the same
        begin, end = rng.integers(0, 20, 2)
        second = np.concatenate([first[:begin], second, first[max(0, len(first) - end) :]])
    counted = [Counter(map(tuple, rows.tolist())) for rows in (first, second)]
    gone, come = (Counter(map(tuple, rows.tolist())) for rows in differing_rows(first, second))
    assert gone == counted[0] - counted[1] and come == counted[1] - counted[0]


@settings(max_examples=150, deadline=None)
@given(seeds)
def test_distances_are_those_of_scipy_to_the_last_bit(seed):
    mask, rng = patches(seed, shares=(0.5, 0.05, 0.005))
    mask[tuple(rng.integers(0, mask.shape))] = True
    assert (distances(mask) == ndimage.distance_transform_edt(~mask)).all()


def test_where_there_is_nothing_it_is_infinitely_far():
    assert np.isinf(distances(np.zeros((3, 4), dtype=bool))).all()
