# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Few false-free cells: what is free has been heard to be free, and walls stay where they were heard."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose
from sonar_explore.mapping.grid import FREE, OCCUPIED, UNKNOWN, window
from sonar_explore.mapping.looks import BINS, Look, MappingConfig, look_of
from sonar_explore.mapping.occupancy import OccupancyMapper
from sonar_explore.mapping.walls import bridges, pivot_points, shortened, trimmed
from sonar_explore.slam import FeatureKind, SlamConfig
from sonar_explore.slam.features import extract_features

CONFIG = MappingConfig()
PIVOT = CONFIG.pivot_m, CONFIG.pivot_turn_rad
NONE = np.zeros((0, 4))
ROBUST = SlamConfig.robust().features
WIDTH, HEIGHT = 2.6, 2.2
seeds = st.integers(0, 10_000)


def mapper():
    return OccupancyMapper(CONFIG, 0.18, 2.0)


def nothing_seen(clear_m=0.0, core_m=0.0):
    return Look(np.full(BINS, clear_m), np.full(BINS, core_m), NONE, NONE, np.zeros((0, 2)))


def seen(walls, clear_m=0.0):
    rows = np.array(walls, dtype=float).reshape(-1, 4)
    return replace(nothing_seen(clear_m), walls=rows, continuations=rows)


def draw(poses, looks, trail=(), obstacles=()):
    """With a trail, given in the map frame, since the first scan."""
    since_first = poses[0].inverse().transform(np.array(trail, dtype=float).reshape(-1, 2))
    return mapper().draw(poses, looks, [since_first, *nowhere(len(poses) - 1)], obstacles)


def nowhere(scans):
    return [np.zeros((0, 2))] * scans


def state(grid, x, y):
    return grid.states[grid.frame.cell(x, y)]


def scans_of_a_room(seed, count):
    """True poses in a closed room, and what a scan at each says."""
    points = [(0.0, 0.0), (WIDTH, 0.0), (WIDTH, HEIGHT), (0.0, HEIGHT)]
    walls = np.array([[*a, *b] for a, b in zip(points, points[1:] + points[:1], strict=True)])
    rng = np.random.default_rng(seed)
    poses, looks, features = [], [], []
    for _ in range(count):
        start = Pose(rng.uniform(0.5, WIDTH - 0.5), rng.uniform(0.5, HEIGHT - 0.5), rng.uniform(-3.0, 3.0))
        world = World("room", "A room", walls, np.zeros(4), np.zeros((0, 3)), start, False)
        robot = Simulator(world, SimulatorConfig(noise=noise_preset("ideal")), rng)
        scan = robot.scan(1)
        found = extract_features(scan, ROBUST)
        poses.append(start)
        features.append(found)
        looks.append(look_of(scan, found, CONFIG))
    return poses, looks, features


def test_hardly_anything_outside_a_closed_room_is_free_and_where_the_body_stood_is():
    shares = []
    for seed in range(12):
        poses, looks, _ = scans_of_a_room(seed, 6)
        grid = draw(poses, looks, [(p.x, p.y) for p in poses])
        free = grid.frame.centres(np.argwhere(grid.free))
        shares.append(np.mean(np.maximum(-free, free - (WIDTH, HEIGHT)).max(axis=1) > 0.10))
        assert all(state(grid, p.x, p.y) == FREE for p in poses)
    assert np.mean(shares) < 0.02  # where no scan has told a wall from a corner, a reading may pass it


@settings(max_examples=15, deadline=None)
@given(seeds)
@example(3533)
def test_the_foot_of_a_wall_feature_is_occupied_and_the_way_to_it_free(seed):
    (pose,), looks, (features,) = scans_of_a_room(seed, 1)
    grid = draw([pose], looks)
    for f in features:
        if f.kind is FeatureKind.WALL:
            bearing = pose.heading + f.bearing_rad
            to = np.array([math.cos(bearing), math.sin(bearing)])
            at = [(pose.x, pose.y) + (f.range_m + off) * to for off in (-0.002, 0.0, 0.002)]
            assert OCCUPIED in [state(grid, x, y) for x, y in at]  # a foot may lie on the border of two cells
            assert state(grid, *((pose.x, pose.y) + 0.5 * f.range_m * to)) == FREE


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 9))
def test_a_long_specular_reading_neither_erases_a_wall_nor_frees_what_is_behind_it(seed, times):
    rng = np.random.default_rng(seed)
    here = [Pose(rng.uniform(-0.6, 0.8), rng.uniform(-0.4, 0.4), rng.uniform(-3, 3)) for _ in range(times)]
    wall = [1.0, -0.6, 1.0, 0.6]
    grid = draw([Pose(0, 0, 0), *here], [seen([wall]), *[nothing_seen(clear_m=1.9) for _ in here]])
    for y in np.arange(-0.58, 0.6, 0.04):
        assert state(grid, 1.0, y) == OCCUPIED
    free = grid.frame.centres(np.argwhere(grid.free))
    for x, y in free[free[:, 0] > 1.06]:
        crossings = [p.y + (y - p.y) * (1.0 - p.x) / (x - p.x) for p in here]
        assert max(map(abs, crossings)) > 0.6 - 0.05


def test_what_was_free_behind_a_wall_not_yet_seen_does_not_stay_free():
    before, after = mapper(), mapper()
    look, wall = nothing_seen(clear_m=1.4), seen([[0.8, -0.6, 0.8, 0.6]])
    grid = before.draw([Pose(0, 0, 0)], [look], nowhere(1), [])
    assert state(grid, 1.2, 0.0) == FREE
    for m in (before, after):
        grid = m.draw([Pose(0, 0, 0)] * 2, [look, wall], nowhere(2), [])
        assert state(grid, 1.2, 0.0) == UNKNOWN


def test_certain_sectors_outweigh_a_wall_of_long_ago_and_mere_silence_never_does():
    wall, here = seen([[0.8, -0.6, 0.8, 0.6]]), Pose(0, 0, 0)
    certain = [replace(nothing_seen(core_m=1.2)) for _ in range(6)]
    silent = [nothing_seen(clear_m=1.2) for _ in range(20)]
    assert state(draw([here] * 7, [wall, *certain]), 0.8, 0.0) == FREE
    assert state(draw([here] * 21, [wall, *silent]), 0.8, 0.0) == OCCUPIED


def test_the_wall_just_seen_stands_whatever_older_scans_say():
    certain = [nothing_seen(core_m=1.2) for _ in range(6)]
    grid = draw([Pose(0, 0, 0)] * 7, [*certain, seen([[0.8, -0.6, 0.8, 0.6]])])
    assert state(grid, 0.8, 0.0) == OCCUPIED


def test_what_the_body_has_covered_is_free_though_the_ring_once_told_of_a_wall_there():
    obstacle = np.array([[0.5, -0.3, 0.5, 0.3]])
    trail = [(x, 0.0) for x in np.arange(0.0, 1.0, 0.05)]
    blocked, passed = (draw([Pose(0, 0, 0)], [nothing_seen()], t, [(0, obstacle)]) for t in ([], trail))
    assert state(blocked, 0.5, 0.0) == OCCUPIED and state(passed, 0.5, 0.0) == FREE
    assert state(passed, 0.5, 0.25) == OCCUPIED


@settings(deadline=None)
@given(seeds, st.floats(0.02, 0.8).filter(lambda gap: abs(gap - 0.36) > 1e-6))
def test_two_wall_ends_are_bridged_where_the_body_cannot_pass_and_only_there(seed, gap):
    turn = Pose(0.3, -0.2, np.random.default_rng(seed).uniform(-3, 3))
    walls = np.array([[0.0, 0.0, 1.0, 0.0], [1.0 + gap, 0.0, 2.2 + gap, 0.0]])
    walls = turn.transform(walls.reshape(-1, 2)).reshape(-1, 4)
    found = bridges(walls, 0.36)
    assert len(found) == (gap <= 0.36)
    if gap <= 0.36:
        assert np.hypot(*(found[0, 2:] - found[0, :2])) == pytest.approx(gap)


@pytest.mark.parametrize(
    ("gap", "jambs", "middle"),
    [
        (0.10, True, OCCUPIED),
        (0.30, True, OCCUPIED),
        (0.44, True, FREE),
        (0.80, True, FREE),
        (0.80, False, OCCUPIED),
    ],
)
def test_silence_passes_a_door_but_neither_what_is_too_narrow_for_the_body_nor_what_has_no_jambs(
    gap, jambs, middle
):
    walls = [[1.0, -1.0, 1.0, -0.5 * gap], [1.0, 0.5 * gap, 1.0, 1.0]]
    edges = np.array([[1.0, -0.5 * gap], [1.0, 0.5 * gap]])
    look = replace(seen(walls), points=edges if jambs else np.zeros((0, 2)))
    grid = draw([Pose(0, 0, 0)] * 2, [look, nothing_seen(clear_m=1.4)])
    assert state(grid, 1.0, 0.0) == middle
    assert (state(grid, 1.2, 0.0) == FREE) == (middle == FREE)


@settings(deadline=None)
@given(seeds, st.integers(2, 6))
def test_a_foot_met_again_under_a_turned_normal_is_no_wall(seed, count):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-3, 3) + math.radians(20.0) * np.arange(count)
    walls = np.array([segment(0.0, 0.0, a) + np.tile(rng.uniform(-0.02, 0.02, 2), 2) for a in angles])
    assert pivot_points(walls, np.arange(count), *PIVOT).all()
    assert not pivot_points(walls, np.zeros(count, dtype=np.int64), *PIVOT).any()


@settings(deadline=None)
@given(seeds, st.integers(1, 8))
def test_a_plane_met_by_many_scans_stays_a_wall(seed, count):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-3, 3)
    at = rng.uniform(-2, 2, count)
    noisy = angle + rng.uniform(-1, 1, count) * math.radians(7.0)
    walls = [segment(t * math.cos(angle), t * math.sin(angle), a) for t, a in zip(at, noisy, strict=True)]
    assert not pivot_points(np.array(walls), np.arange(count), *PIVOT).any()


def segment(x, y, angle, half=0.3):
    c, s = half * math.cos(angle), half * math.sin(angle)
    return np.array([x - c, y - s, x + c, y + s])


def test_a_foot_that_turns_is_on_the_map_as_a_point_and_bars_no_door():
    walls = [segment(1.0, 0.0, a) for a in (0.0, 0.5, 1.0)]
    m = mapper()
    looks = [*[seen([w]) for w in walls], nothing_seen(clear_m=1.5)]
    grid = m.draw([Pose(0, 0, 0)] * 4, looks, nowhere(4), [])
    assert state(grid, 1.0, 0.0) == OCCUPIED
    assert np.count_nonzero(grid.occupied) == 1
    assert m.recent_points == pytest.approx(np.array([[1.0, 0.0]] * 3))


@settings(deadline=None)
@given(seeds)
def test_a_wall_segment_ends_at_the_edges_heard_on_it_and_keeps_its_foot(seed):
    rng = np.random.default_rng(seed)
    wall = segment(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-3, 3), half=0.6)
    foot, along = 0.5 * (wall[:2] + wall[2:]), (wall[2:] - wall[:2]) / 1.2
    normal = np.array([-along[1], along[0]])
    at, across = rng.uniform(0.1, 0.9) * rng.choice([-1, 1]), rng.uniform(-0.16, 0.16)
    edge = foot + at * along + across * normal
    out = trimmed(wall[None], edge[None], CONFIG.trim_m)[0]
    low, high = (out.reshape(2, 2) - foot) @ along
    on = abs(across) <= CONFIG.trim_m
    assert high == pytest.approx(min(0.6, at) if on and at > 0 else 0.6)
    assert low == pytest.approx(max(-0.6, at) if on and at < 0 else -0.6)


def test_walls_whose_feet_are_at_the_jambs_of_a_door_do_not_shut_it():
    # heard from before either jamb, half of them in the door
    walls = [[1.0, -0.9, 1.0, -0.15], [1.0, 0.9, 1.0, 0.15]]
    sides = [[1.0, -1.2, 1.0, -0.5], [1.0, 0.5, 1.0, 1.2]]
    jambs = np.array([[1.0, -0.5], [1.0, 0.5]])
    looks = [replace(seen([*walls, *sides]), points=jambs), nothing_seen(1.4)]
    grid = mapper().draw([Pose(0, 0, 0)] * 2, looks, nowhere(2), [])
    assert [state(grid, 1.0, y) for y in (-0.9, -0.5, 0.5, 0.9)] == [OCCUPIED] * 4
    assert [state(grid, 1.0, y) for y in (-0.3, 0.0, 0.3)] == [FREE] * 3


@settings(max_examples=50)
@given(seeds, st.floats(0.01, 3.0))
def test_a_shortened_wall_keeps_its_middle_and_line_and_is_never_longer(seed, half):
    walls = np.random.default_rng(seed).uniform(-4, 4, (8, 4))
    short = shortened(walls, half)
    np.testing.assert_allclose(short[:, :2] + short[:, 2:], walls[:, :2] + walls[:, 2:], atol=1e-9)
    long, now = walls[:, 2:] - walls[:, :2], short[:, 2:] - short[:, :2]
    assert np.abs(long[:, 0] * now[:, 1] - long[:, 1] * now[:, 0]).max() < 1e-6
    lengths = np.hypot(*now.T)
    np.testing.assert_allclose(lengths, np.minimum(np.hypot(*long.T), 2 * half), atol=1e-9)


def test_a_door_under_a_wall_drawn_too_long_is_shut_until_the_map_is_doubted():
    maps, poses = mapper(), [Pose(0.0, 0.0, 0.0), Pose(0.0, 0.7, 0.0)]
    wall = replace(seen([1.0, -1.2, 1.0, 1.2]), points=np.array([[1.0, -0.9]]))
    looks = [wall, nothing_seen(1.5)]  # the second scan stands before the door and hears nothing
    believed = maps.draw(poses, looks, nowhere(2), [])
    doubted = maps.draw(poses, looks, nowhere(2), [], doubtful=True)
    assert state(believed, 1.0, 0.0) == state(doubted, 1.0, 0.0) == OCCUPIED  # the foot is sure
    assert state(believed, 1.0, 0.7) == OCCUPIED and state(believed, 1.3, 0.7) != FREE
    assert state(doubted, 1.0, 0.7) == state(doubted, 1.3, 0.7) == FREE
    assert state(believed, 1.0, -0.9) == OCCUPIED and state(doubted, 1.0, -0.9) != OCCUPIED
    again = maps.draw(poses, looks, nowhere(2), [])
    np.testing.assert_array_equal(again.states, believed.states)


def test_a_bound_lets_no_scan_clear_what_is_behind_and_stands_where_the_map_is_doubted_unless_bounds_are_too():
    maps, poses = mapper(), [Pose(0.0, 0.0, 0.0)]
    passed = replace(nothing_seen(1.5), bounds=np.array([[1.0, -0.3, 1.0, 0.3]]))
    believed = maps.draw(poses, [nothing_seen(1.5)], nowhere(1), [])
    assert state(believed, 1.3, 0.0) == FREE
    believed = maps.draw(poses, [passed], nowhere(1), [])
    doubted = maps.draw(poses, [passed], nowhere(1), [], doubtful=True)
    assert state(believed, 1.3, 0.0) == state(doubted, 1.3, 0.0) == UNKNOWN
    assert state(believed, 0.8, 0.0) == state(believed, 1.0, 0.8) == FREE
    assert state(believed, 1.0, 0.0) != OCCUPIED and state(doubted, 1.0, 0.0) == OCCUPIED
    unbounded = maps.draw(poses, [passed], nowhere(1), [], doubtful=True, bounded=False)
    assert state(unbounded, 1.0, 0.0) != OCCUPIED
    again = maps.draw(poses, [passed], nowhere(1), [], doubtful=True)
    np.testing.assert_array_equal(again.states, doubted.states)


def test_where_the_body_has_been_moves_with_the_scan_it_was_believed_after():
    m, wall = mapper(), np.array([[0.5, -0.6, 0.5, 0.6]])
    driven = np.column_stack([np.arange(0.0, 1.0, 0.05), np.zeros(20)])
    looks = [nothing_seen()] * 2
    grid = m.draw([Pose(0, 0, 0)] * 2, looks, [driven, driven[:1]], [(1, wall)])
    assert state(grid, 0.5, 0.0) == FREE and state(grid, 0.5, 0.4) == OCCUPIED
    grid = m.draw([Pose(0, 0.4, 0), Pose(0, 0, 0)], looks, [driven, driven[:1]], [(1, wall)])
    assert state(grid, 0.5, 0.0) == OCCUPIED and state(grid, 0.5, 0.4) == FREE


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_a_wall_ends_at_the_nearest_point_on_it_to_either_side(seed):
    rng = np.random.default_rng(seed)
    walls, points = rng.uniform(-1.0, 1.0, (6, 4)), rng.uniform(-1.0, 1.0, (40, 2))
    feet, half = 0.5 * (walls[:, :2] + walls[:, 2:]), 0.5 * np.hypot(*(walls[:, 2:] - walls[:, :2]).T)
    along = 0.5 * (walls[:, 2:] - walls[:, :2]) / half[:, None]
    offset = points[None] - feet[:, None]
    at = (offset * along[:, None]).sum(axis=2)
    across = offset[:, :, 0] * along[:, None, 1] - offset[:, :, 1] * along[:, None, 0]
    on = np.abs(across) <= CONFIG.trim_m
    for sign, ends in ((1.0, slice(2, 4)), (-1.0, slice(0, 2))):
        to_this_side = on & (sign * at >= -CONFIG.trim_m)  # a point at the foot may end either side
        reach = np.where(to_this_side, np.maximum(sign * at, CONFIG.trim_m), np.inf).min(axis=1)
        expected = feet + sign * along * np.minimum(half, reach)[:, None]
        assert trimmed(walls, points, CONFIG.trim_m)[:, ends] == pytest.approx(expected)


@settings(max_examples=8, deadline=None)
@given(seeds)
def test_redrawing_from_scratch_gives_the_grid_that_was_drawn_scan_by_scan(seed):
    true, looks, _ = scans_of_a_room(seed, 7)
    rng, m = np.random.default_rng(seed), OccupancyMapper(replace(CONFIG, still_m=0.0), 0.18, 2.0)
    trails = rng.uniform(-0.4, 0.4, (7, 3, 2))
    obstacle = rng.uniform(0.0, 2.0, (1, 4))
    for k in range(1, 8):  # every pose is believed anew with every scan
        poses = [Pose(p.x + dx, p.y + dy, p.heading + dh) for p, (dx, dy, dh) in moved(true[:k], rng)]
        grid = m.draw(poses, looks[:k], [*trails[: k - 1], trails[k - 1, :1]], [(0, obstacle)])
    fresh = mapper().draw(poses, looks, [*trails[:6], trails[6, :1]], [(0, obstacle)])
    assert (window(grid.frame, grid.states, fresh.frame) == fresh.states).all()


def test_a_scan_is_drawn_again_only_when_it_has_moved_and_then_where_it_is_now():
    true, looks, _ = scans_of_a_room(3, 4)
    m, off = mapper(), CONFIG.still_m
    first = m.draw(true, looks, nowhere(4), [])
    for step in (0.3, 0.6, 0.9):  # by little and little, and never farther off than that
        crept = [Pose(p.x + step * off, p.y, p.heading) for p in true]
        assert (m.draw(crept, looks, nowhere(4), []).states == first.states).all()
    turned = [Pose(p.x, p.y, p.heading + 1.1 * off / CONFIG.free_range_m) for p in true]
    now, fresh = (one.draw(turned, looks, nowhere(4), []) for one in (m, mapper()))
    assert (window(now.frame, now.states, fresh.frame) == fresh.states).all()
    assert (now.states != first.states).any()


def moved(poses, rng):
    return zip(poses, rng.normal(0.0, 0.05, (len(poses), 3)), strict=True)


def test_a_scan_far_away_waits_until_it_moved_by_a_cell_or_all_of_the_map_is_asked_for():
    looks = [seen([0.52, -0.58, 0.52, 0.58])] * 2
    there, here = Pose(0.0, 0.0, 0.0), Pose(6.0, 0.0, 0.0)
    m = mapper()
    first = m.draw([there, here], looks, nowhere(2), [])
    crept = [Pose(0.8 * CONFIG.far_still_m, 0.0, 0.0), here]
    left = m.draw(crept, looks, nowhere(2), [], fresh_m=5.0)
    assert (left.states == first.states).all() and m.is_late(doubtful=False)
    for poses, fresh_m in ((crept, 7.0), (crept, math.inf), ([Pose(0.06, 0.0, 0.0), here], 5.0)):
        m = mapper()
        m.draw([there, here], looks, nowhere(2), [])
        now, fresh = (
            m.draw(poses, looks, nowhere(2), [], fresh_m=fresh_m),
            mapper().draw(poses, looks, nowhere(2), []),
        )
        assert (window(now.frame, now.states, fresh.frame) == fresh.states).all() and not m.is_late(
            doubtful=False
        )


def test_what_stood_in_the_way_stays_with_its_scan_where_that_is_drawn():
    m, looks = mapper(), [nothing_seen()] * 2
    stood = [(0, np.array([[0.5, -0.3, 0.5, 0.3]]))]
    first = m.draw([Pose(0, 0, 0), Pose(6, 0, 0)], looks, nowhere(2), stood)
    crept = [Pose(0.8 * CONFIG.still_m, 0, 0), Pose(6, 0, 0)]
    assert (m.draw(crept, looks, nowhere(2), stood).states == first.states).all()
    off = m.draw([Pose(0.2, 0, 0), Pose(6, 0, 0)], looks, nowhere(2), stood)
    assert state(off, 0.7, 0.0) == OCCUPIED and state(off, 0.5, 0.0) != OCCUPIED


@settings(max_examples=8, deadline=None)
@given(seeds)
def test_what_was_late_on_the_doubted_map_is_made_up_for_once_all_of_it_is_asked_for(seed):
    true, looks, _ = scans_of_a_room(seed, 7)
    rng, m = (
        np.random.default_rng(seed),
        OccupancyMapper(replace(CONFIG, still_m=0.0, far_still_m=0.0), 0.18, 2.0),
    )
    trails = rng.uniform(-0.4, 0.4, (7, 3, 2))
    for k in range(1, 8):
        poses = [Pose(p.x + dx, p.y + dy, p.heading + dh) for p, (dx, dy, dh) in moved(true[:k], rng)]
        doubtful, fresh_m = bool(rng.random() < 0.7), rng.uniform(0.1, 2.0)
        m.draw(poses, looks[:k], [*trails[:k]], [], doubtful=doubtful, fresh_m=fresh_m)
    grid = m.draw(poses, looks, [*trails], [], doubtful=True)
    fresh = mapper().draw(poses, looks, [*trails], [], doubtful=True)
    assert (window(grid.frame, grid.states, fresh.frame) == fresh.states).all()
    assert not m.is_late(doubtful=True)
