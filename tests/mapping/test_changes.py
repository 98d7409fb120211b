# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What is kept from map to map is, after any change, what would be worked out from nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from sonar_explore.mapping.changes import box_of, changed_spans
from sonar_explore.mapping.distance import Distances, distances
from sonar_explore.mapping.regions import WithoutHoles, without_holes

seeds = st.integers(0, 10_000)


def masks(rng, count=6):
    """A mask, and others that differ in a few blocks each; now and then the grid grows. And where the first cell of the
    one before is."""
    mask, at = rng.random(rng.integers(1, 45, 2)) < rng.choice([0.0, 0.02, 0.1, 0.5, 0.95]), (0, 0)
    for _ in range(count):
        yield mask, at
        more = rng.integers(0, 7, (2, 2)) * rng.integers(0, 2, (2, 2)) * (rng.random() < 0.3)
        mask, at = np.pad(mask, more, constant_values=bool(rng.integers(2))), tuple(more[:, 0].tolist())
        for _ in range(rng.integers(0, 4)):
            row, column = rng.integers(0, mask.shape)
            block = mask[row : row + rng.integers(1, 9), column : column + rng.integers(1, 9)]
            block[:] = rng.random(block.shape) < rng.choice([0.0, 0.1, 0.9, 1.0])


@settings(max_examples=100, deadline=None)
@given(seeds)
def test_distances_that_are_carried_on_are_those_from_nothing(seed):
    rng = np.random.default_rng(seed)
    less, cell_m = rng.choice([0.0, 0.5]), rng.choice([1.0, 0.05])
    kept = Distances(less, cell_m)
    watch, told = kept.watch(), np.zeros((0, 0))
    for mask, at in masks(rng):
        before, found = told, kept.of(mask, at)
        assert (found == (distances(mask) - less) * cell_m).all()
        columns = np.arange(mask.shape[1])
        inside = [(first <= columns) & (columns <= last) for first, last in watch.take()]
        told = np.full(mask.shape, np.nan)
        told[at[0] : at[0] + before.shape[0], at[1] : at[1] + before.shape[1]] = before
        told[np.array(inside)] = found[np.array(inside)]
        assert (told == found).all()  # whatever changed, or is new, was told of


@settings(max_examples=100, deadline=None)
@given(seeds)
def test_holes_that_are_carried_on_are_those_from_nothing(seed):
    rng = np.random.default_rng(seed)
    kept = WithoutHoles(most := int(rng.integers(1, 25)))
    for mask, _ in masks(rng):
        assert (kept.of(mask) == without_holes(mask, most)).all()


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_spans_hold_what_lies_near_a_change_and_end_at_it(seed):
    rng = np.random.default_rng(seed)
    within = int(rng.integers(0, 6))
    shape = tuple(rng.integers(1, 30, 2))
    before, after = (rng.random((2, *shape)) < rng.choice([0.01, 0.1])).astype(np.uint8)
    spans = changed_spans(before, after, within)
    near = ndimage.maximum_filter(before != after, 2 * within + 1, mode="constant")
    for row, (first, last) in zip(near, spans.tolist(), strict=True):
        assert (np.flatnonzero(row)[[0, -1]].tolist() if row.any() else [shape[1], -1]) == [first, last]


def test_the_box_of_spans_is_the_least_that_holds_them():
    before = np.zeros((9, 12), dtype=np.uint8)
    after = before.copy()
    assert box_of(changed_spans(before, after, 2)) is None
    after[3, 5] = after[6, 8] = 1
    assert box_of(changed_spans(before, after, 1)) == (slice(2, 8), slice(4, 10))


@pytest.mark.parametrize("filled", [True, False])
def test_a_change_of_everything_is_no_exception(filled):
    kept, mask = Distances(), np.full((7, 9), filled)
    kept.of(mask)
    assert (kept.of(~mask) == distances(~mask)).all()
