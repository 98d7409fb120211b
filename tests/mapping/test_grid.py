# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Metres to cells and back."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.mapping.grid import GridFrame, window

frames = st.builds(
    GridFrame,
    st.integers(-200, 200).map(lambda k: 0.05 * k),
    st.integers(-200, 200).map(lambda k: 0.05 * k),
    st.sampled_from([0.05, 0.1]),
    st.tuples(st.integers(1, 60), st.integers(1, 60)),
)
metres = st.floats(-20.0, 20.0)


@settings(deadline=None)
@given(frames)
def test_a_cells_centre_lies_in_that_cell(frame):
    cells = np.argwhere(np.ones(frame.shape))
    assert (frame.cells(frame.centres(cells)) == cells).all()
    assert frame.contains(cells).all()


@settings(deadline=None)
@given(frames, metres, metres)
def test_a_point_is_no_farther_than_half_a_cell_from_the_centre_of_its_cell(frame, x, y):
    cell = frame.cell(x, y)
    assert tuple(frame.cells(np.array([[x, y]]))[0]) == cell
    assert np.abs(frame.centres(np.array([cell])) - (x, y)).max() <= 0.5 * frame.resolution_m + 1e-9


@settings(deadline=None)
@given(frames, metres, metres, metres, metres)
def test_growth_covers_the_box_and_keeps_every_cell_in_its_place(frame, x1, y1, x2, y2):
    low, high = (min(x1, x2), min(y1, y2)), (max(x1, x2), max(y1, y2))
    grown = frame.covering(low, high)
    last = grown.centres(np.array([grown.shape])) - 0.5 * grown.resolution_m
    assert grown.x0 <= low[0] + 1e-9 and grown.y0 <= low[1] + 1e-9
    assert (last >= np.array(high) - 1e-9).all()
    states = np.random.default_rng(0).integers(1, 3, frame.shape).astype(np.uint8)
    moved = window(frame, states, grown)
    cells = np.argwhere(np.ones(frame.shape))
    there = grown.cells(frame.centres(cells))
    assert (moved[there[:, 0], there[:, 1]] == states.ravel()).all()
    assert np.count_nonzero(moved) == states.size


@settings(deadline=None)
@given(frames)
def test_a_frame_that_covers_the_box_already_stays_as_it_is(frame):
    middle = tuple(frame.centres(np.array([[frame.shape[0] // 2, frame.shape[1] // 2]]))[0])
    assert frame.covering(middle, middle) is frame


@settings(deadline=None)
@given(frames, st.integers(-70, 70), st.integers(-70, 70))
def test_a_window_and_back_loses_only_what_falls_outside(frame, rows, columns):
    states = np.random.default_rng(1).integers(0, 3, frame.shape).astype(np.uint8)
    res = frame.resolution_m
    other = GridFrame(frame.x0 + columns * res, frame.y0 + rows * res, res, frame.shape)
    back = window(other, window(frame, states, other), frame)
    kept = back != 0
    assert (back[kept] == states[kept]).all()
    inside = other.contains(other.cells(frame.centres(np.argwhere(np.ones(frame.shape)))))
    assert (back.ravel()[inside] == states.ravel()[inside]).all()
