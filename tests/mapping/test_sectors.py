# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Counts that are kept up to date are the counts that a fresh draw gives."""

import math
from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose
from sonar_explore.mapping.changes import STRIPE, no_spans
from sonar_explore.mapping.cuts import Known, cut_all_at_walls
from sonar_explore.mapping.grid import GridFrame
from sonar_explore.mapping.looks import MappingConfig
from sonar_explore.mapping.marks import Marks
from sonar_explore.mapping.sectors import Sectors

REACH_M = 1.0
seeds = st.integers(0, 10_000)


def random_put(rng):
    pose = Pose(*(rng.uniform(-2.0, 2.0, 3) * (1.0, 1.0, 2.0)))
    return pose, rng.uniform(0.0, REACH_M, 24), rng.uniform(0.0, REACH_M, 24) * rng.integers(0, 2, 24)


def put_one(sectors, index, pose, clear, core):
    sectors.put(np.array([index]), np.array([pose.as_row()]), clear[None], core[None])


def drawn(frame, held):
    """All scans put onto a map of their own."""
    sectors = Sectors()
    sectors.resize(frame)
    for index, put in enumerate(held):
        put_one(sectors, index, *put)
    return sectors


def put_at_random(rng, held, frame, sectors):
    """One scan more, or another one in the place of one; the frame that covers it."""
    index, put = int(rng.integers(0, len(held) + 1)), random_put(rng)
    held[index:] = [put, *held[index + 1 :]]
    frame = covering(frame, put[0])
    sectors.resize(frame)
    put_one(sectors, index, *put)
    return frame


def marks_of(frame, *layers):
    """The segments of each of four layers, as far as there are any."""
    out = [Marks() for _ in range(4)]
    for marks, segments in zip(out, [*layers, *[np.zeros((0, 4))] * 4], strict=False):
        marks.put(frame, segments, no_spans(frame.shape))
    return out


def covering(frame, pose):
    low, high = (pose.x - REACH_M, pose.y - REACH_M), (pose.x + REACH_M, pose.y + REACH_M)
    return frame.covering(low, high)


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_putting_replacing_and_growing_gives_what_a_fresh_draw_gives(seed):
    rng = np.random.default_rng(seed)
    frame, sectors = GridFrame(0.0, 0.0, 0.1, (10, 10)), Sectors()
    held: list = []
    for _ in range(12):
        frame = put_at_random(rng, held, frame, sectors)
    trails = list(rng.uniform(-0.4, 0.4, (3, 8, 2)))
    for k in range(9):  # the poses of the first scans are believed anew each time
        seats = [Pose(*rng.uniform(-0.2, 0.2, 3)), held[0][0], held[0][0]]
        sectors.trails(range(3), seats, [way[:k] for way in trails], 0.18)
    fresh = drawn(frame, held)
    assert (sectors.cleared == fresh.cleared).all() and sectors.cleared.any()
    assert (sectors.core == fresh.core).all()
    fresh.trails(range(3), seats, trails, 0.18)
    marks = marks_of(frame, np.zeros((0, 4)))
    body = [s.states(marks, MappingConfig()) for s in (sectors, fresh)]
    assert (body[0] == body[1]).all() and body[0].any()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_a_cell_is_cleared_where_its_own_sector_is_clear_that_far(seed):
    rng, sectors = np.random.default_rng(seed), Sectors()
    n = int(rng.choice([8, 90, 360]))
    pose, clear = Pose(*rng.uniform(-2.0, 2.0, 3) * (1, 1, 9)), rng.uniform(0.0, REACH_M, (2, n))
    frame = covering(GridFrame(0.0, 0.0, 0.05, (1, 1)), pose)
    sectors.resize(frame)
    put_one(sectors, 0, pose, *clear)
    dx, dy = (frame.centres(np.argwhere(np.ones(frame.shape))) - (pose.x, pose.y)).T
    bins = np.floor((np.arctan2(dy, dx) - pose.heading) / math.tau * n).astype(int) % n
    for counts, limits in zip((sectors.cleared, sectors.core), clear, strict=True):
        assert (counts.ravel() == (np.hypot(dx, dy) <= limits[bins])).all()


def test_putting_the_same_again_changes_nothing():
    rng, sectors = np.random.default_rng(0), Sectors()
    put = random_put(rng)
    sectors.resize(covering(GridFrame(0.0, 0.0, 0.1, (1, 1)), put[0]))
    put_one(sectors, 0, *put)
    before = sectors.cleared.copy()
    put_one(sectors, 0, *put)
    assert (sectors.cleared == before).all() and before.max() == 1


def cut_at_walls(x, y, heading, clear, walls, own, margin):
    """Of one scan, whose own walls are all real."""
    at, real = np.array([[x, y, heading]]), np.ones(len(own), dtype=bool)
    nothing = Known(np.zeros(1, dtype=bool), np.empty((1, len(clear))), walls[:0], walls[:0])
    cut, _ = cut_all_at_walls(
        np.array([0]), at, clear[None], walls, own, real, np.array([0, len(own)]), margin, nothing
    )
    return cut[0]


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_no_direction_is_clear_beyond_the_first_barrier_that_its_middle_ray_meets(seed):
    rng = np.random.default_rng(seed)
    n, margin = 90, 0.05
    x, y, heading = rng.uniform(-2.0, 2.0, 3)
    walls, own = rng.uniform(-3.0, 3.0, (4, 4)), rng.uniform(-3.0, 3.0, (1, 4))
    clear = rng.uniform(0.0, 3.0, n)
    cut = cut_at_walls(x, y, heading, clear, walls, own, margin)
    assert (cut >= 0.0).all() and (cut <= clear).all()
    for b in range(n):
        angle = heading + (b + 0.5) * math.tau / n
        hit = min(ray_hits(x, y, angle, segment) for segment in (*walls, *own))
        assert cut[b] <= max(0.0, hit - margin) + 1e-9


def ray_hits(x, y, angle, segment):
    ax, ay, bx, by = segment
    matrix = np.array([[math.cos(angle), ax - bx], [math.sin(angle), ay - by]])
    r, share = np.linalg.solve(matrix, [ax - x, ay - y])
    return r if r >= 0.0 and 0.0 <= share <= 1.0 else math.inf


@settings(max_examples=80, deadline=None)
@given(seeds)
def test_scans_cut_where_barriers_went_and_came_are_cut_as_if_from_nothing(seed):
    rng = np.random.default_rng(seed)
    n, scans, margin = 60, np.arange(5), 0.05
    at, clear = rng.uniform(-2.0, 2.0, (5, 3)), rng.uniform(0.0, 3.0, (5, n))
    walls, own = rng.uniform(-3.0, 3.0, (8, 4)), rng.uniform(-3.0, 3.0, (5, 4))
    rest = own, np.ones(5, dtype=bool), np.arange(6), margin
    stands, nothing = np.ones(5, dtype=bool), np.zeros((0, 4))
    cut, _ = cut_all_at_walls(scans, at, clear, walls, *rest, Known(~stands, clear, nothing, nothing))
    for _ in range(4):
        left = rng.random(len(walls)) < 0.8
        come = rng.uniform(-3.0, 3.0, (rng.integers(0, 3), 4))
        gone, walls = walls[~left], np.concatenate([walls[left], come])
        before = cut
        cut, differ = cut_all_at_walls(scans, at, clear, walls, *rest, Known(stands, before, gone, come))
        anew, _ = cut_all_at_walls(scans, at, clear, walls, *rest, Known(~stands, clear, nothing, nothing))
        assert (cut == anew).all()
        assert (differ == (cut != before).any(axis=1)).all()


@settings(deadline=None)
@given(seeds)
def test_what_no_barrier_stands_in_stays_clear(seed):
    rng = np.random.default_rng(seed)
    clear = rng.uniform(0.0, 1.0, 36)
    away = np.array([[3.0, -2.0, 3.0, 2.0]])
    assert (cut_at_walls(0.0, 0.0, seed, clear, away, np.zeros((0, 4)), 0.05) == clear).all()


@settings(deadline=None)
@given(seeds)
def test_a_segment_marks_each_cell_it_passes_once_and_no_other(seed):
    frame, marks = GridFrame(0.0, 0.0, 0.1, (20, 20)), Marks()
    segment = np.random.default_rng(seed).uniform(0.0, 2.0, (1, 4))
    marks.put(frame, segment, no_spans(frame.shape))
    along = np.linspace(0.0, 1.0, 200)[:, None]
    cells = frame.cells(segment[:, :2] + along * (segment[:, 2:] - segment[:, :2]))
    passed = np.zeros(frame.shape, dtype=bool)
    passed[cells[:, 0], cells[:, 1]] = True
    assert set(np.unique(marks.counts)) <= {0, 1}
    assert not (marks.counts > 0)[~passed].any() or np.count_nonzero((marks.counts > 0) & ~passed) <= 1
    ends = frame.cells(segment.reshape(2, 2))
    assert (marks.counts[ends[:, 0], ends[:, 1]] == 1).all()


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_marks_of_segments_that_come_and_go_are_those_of_the_last_ones_and_tell_where_they_differ(seed):
    rng, frame, marks = np.random.default_rng(seed), GridFrame(0.0, 0.0, 0.1, (20, 20)), Marks()
    segments = np.zeros((0, 4))
    for _ in range(5):
        before, counts = segments, marks.counts.copy()
        segments = np.concatenate([segments[rng.random(len(segments)) < 0.7], rng.uniform(-0.3, 2.3, (3, 4))])
        segments = np.concatenate([segments, segments[:1]])  # one may stand there twice
        if rng.random() < 0.2:
            frame = GridFrame(frame.x0 - 1.0, frame.y0, 0.1, (frame.shape[0], frame.shape[1] + 10))
        spans, fresh = no_spans(frame.shape), Marks()
        gone, come = marks.put(frame, segments, spans)
        fresh.put(frame, segments, no_spans(frame.shape))
        assert (marks.counts == fresh.counts).all()
        was, now = (Counter(map(tuple, rows)) for rows in (before, segments))
        assert Counter(map(tuple, gone)) == was - now
        assert Counter(map(tuple, come)) == now - was
        if counts.shape == marks.counts.shape:
            rows, columns = np.nonzero(counts != marks.counts)
            first, last = spans[rows, columns // STRIPE].T
            assert ((first <= columns) & (columns <= last)).all()


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_states_that_are_kept_where_nothing_changed_are_those_of_all_cells_anew(seed):
    rng = np.random.default_rng(seed)
    frame, sectors = GridFrame(0.0, 0.0, 0.1, (10, 10)), Sectors()
    held: list = []
    layers = [Marks() for _ in range(4)]
    for k in range(8):
        frame = put_at_random(rng, held, frame, sectors)
        for layer in layers:
            layer.put(frame, rng.uniform(-2.0, 2.0, (4, 4)), sectors.changed)
        sectors.trails(range(1), [held[0][0]], [np.zeros((k, 2))], 0.18)
        found, fresh = sectors.states(layers, MappingConfig()), drawn(frame, held)
        fresh.trails(range(1), [held[0][0]], [np.zeros((k, 2))], 0.18)
        assert (found == fresh.states(layers, MappingConfig())).all()


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_scans_that_are_put_together_count_as_they_do_one_by_one(seed):
    rng = np.random.default_rng(seed)
    puts, frame = [random_put(rng) for _ in range(6)], GridFrame(0.0, 0.0, 0.1, (10, 10))
    for pose, _, _ in puts:
        frame = covering(frame, pose)
    together, single = Sectors(), Sectors()
    for sectors in (together, single):
        sectors.resize(frame)
    for _ in range(3):
        poses, clear, core = zip(*puts, strict=True)
        at = np.array([pose.as_row() for pose in poses])
        together.put(np.arange(len(puts)), at, np.array(clear), np.array(core))
        for index, put in enumerate(puts):
            put_one(single, index, *put)
        puts = [
            random_put(rng) if rng.random() < 0.5 else (pose, *random_put(rng)[1:]) for pose, _, _ in puts
        ]
    assert (together.cleared == single.cleared).all() and (together.core == single.core).all()
