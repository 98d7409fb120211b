# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What is kept from map to map is, after any change, what would be worked out from nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from sonar_explore.mapping.changes import STRIPE, changed_spans, moved_spans
from sonar_explore.mapping.distance import Distances, distances
from sonar_explore.mapping.regions import WithoutHoles, without_holes

seeds = st.integers(0, 10_000)


def masks(rng, count=6):
    """A mask, and others that differ in a few blocks each; now and then the grid grows. And where the first cell of the
    one before is."""
    mask, at = (
        rng.random((rng.integers(1, 45), rng.integers(1, rng.choice([45, 300]))))
        < rng.choice([0.0, 0.02, 0.1, 0.5, 0.95]),
        (0, 0),
    )
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
    most = int(rng.choice([0, 1, 3, 10, 1000]))
    kept = Distances(less, cell_m, most)
    watch, told = kept.watch(), np.zeros((0, 0))
    for mask, at in masks(rng):
        before, found = told, kept.of(mask, at)
        expected = distances(mask)
        expected[expected >= most + 1.0] = np.inf
        assert (found == (expected - less) * cell_m).all()
        inside = within(watch.take(), mask.shape)
        told = np.full(mask.shape, np.nan)
        told[at[0] : at[0] + before.shape[0], at[1] : at[1] + before.shape[1]] = before
        told[inside] = found[inside]
        assert (told == found).all()  # whatever changed, or is new, was told of


@settings(max_examples=100, deadline=None)
@given(seeds)
def test_holes_that_are_carried_on_are_those_from_nothing(seed):
    rng = np.random.default_rng(seed)
    kept = WithoutHoles(most := int(rng.integers(1, 25)))
    for mask, _ in masks(rng):
        assert (kept.of(mask) == without_holes(mask, most)).all()


def within(spans, shape):
    """The cells of spans as a mask."""
    columns = np.arange(shape[1])
    inside = (spans[..., :1] <= columns) & (columns <= spans[..., 1:])
    return inside.any(axis=1)


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_spans_hold_what_lies_near_a_change_and_end_at_it_in_each_stripe(seed):
    rng = np.random.default_rng(seed)
    reach = int(rng.integers(0, 6))
    shape = rng.integers(1, 30), rng.integers(1, 200)
    before, after = (rng.random((2, *shape)) < rng.choice([0.001, 0.01, 0.1])).astype(np.uint8)
    spans = changed_spans(before, after, reach)
    near = ndimage.maximum_filter(before != after, 2 * reach + 1, mode="constant")
    for row, of_row in zip(near, spans.tolist(), strict=True):
        for stripe, (first, last) in enumerate(of_row):
            part = STRIPE * stripe + np.flatnonzero(row[STRIPE * stripe : STRIPE * (stripe + 1)])
            assert part[[0, -1]].tolist() == [first, last] if len(part) else last < first


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_spans_move_with_the_grid(seed):
    rng = np.random.default_rng(seed)
    shape, at = (5, int(rng.integers(1, 200))), (2, int(rng.integers(0, 100)))
    before, after = (rng.random((2, *shape)) < 0.01).astype(np.uint8)
    spans = changed_spans(before, after, 2)
    larger = (10, shape[1] + 150)
    moved = within(moved_spans(spans, at, larger), larger)
    there = within(spans, shape)
    assert (moved[2:7, at[1] : at[1] + shape[1]] >= there).all()
    assert moved.sum(axis=1).tolist()[:2] == [0, 0]
    assert (moved.any(axis=1)[2:7] == there.any(axis=1)).all()


@pytest.mark.parametrize("filled", [True, False])
def test_a_change_of_everything_is_no_exception(filled):
    kept, mask = Distances(), np.full((7, 9), filled)
    kept.of(mask)
    assert (kept.of(~mask) == distances(~mask)).all()
