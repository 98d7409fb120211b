# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Edges and corners fall together where several discs hear them, walls do not; and they are known again."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_agreement import plain_echoes
from way_in import way_in

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose
from sonar_explore.slam import SlamConfig
from sonar_explore.slam.smoothing.point_matching import MatchingConfig, match
from sonar_explore.slam.turn.discs import TurnError
from sonar_explore.slam.turn.heard import heard_by_discs
from sonar_explore.slam.turn.points import PointConfig, points_among

FEATURES, CONFIG, MATCHING = SlamConfig.robust().features, PointConfig(), MatchingConfig()
DOOR = [[0, 0, 5, 0], [5, 0, 5, 4], [5, 4, 0, 4], [0, 4, 0, 0], [0, 2, 1.9, 2], [3.1, 2, 5, 2]]
"""Two rooms and a door between them, its edges at x = 1.9 and 3.1."""
seeds = st.integers(0, 10_000)


def scan_at(x, y, heading=0.3, walls=DOOR, seed=0, direction=1):
    world = World(
        "door", "", np.array(walls, float), np.zeros(len(walls)), np.zeros((0, 3)), Pose(x, y, heading), False
    )
    robot = Simulator(world, SimulatorConfig(noise=noise_preset("ideal")), np.random.default_rng(seed))
    return robot.true_pose, robot.scan(direction)


def heard_points(scan, sums=None):
    in_front = heard_by_discs(scan, FEATURES, CONFIG).in_front
    return points_among(in_front, FEATURES.beam, CONFIG, np.zeros(2) if sums is None else sums)


def matched(here, about, prior, known, spread, config, alike=None):
    """For each point of a scan the index of the known one that it is, -1 for a new one; shape (n,)."""
    out = np.full(len(here), -1)
    alike = np.ones((len(here), len(known)), dtype=bool) if alike is None else alike
    limits = config.reach_m, config.apart_m, config.unmatched
    way_in(match)(here - about, known - about, alike, spread + config.place_m**2, prior, limits, out)
    return out


def places(pose, scan):
    return np.array([p.seen_from(pose) for p in heard_points(scan)]).reshape(-1, 2)


@pytest.mark.parametrize("direction", [-1, 1])
def test_the_edges_of_a_door_are_heard_to_two_centimetres_whichever_way_the_robot_turns(direction):
    """One edge in a hundred and thirty goes unheard: too few discs agree on it (1,000 scans)."""
    rng, off = np.random.default_rng(7), []
    for seed in range(40):
        x, y, heading = rng.uniform((2.2, 0.9, -math.pi), (2.8, 1.3, math.pi))
        found = places(*scan_at(x, y, heading, seed=seed, direction=direction))
        off += [np.hypot(*(found - edge).T).min(initial=math.inf) for edge in ((1.9, 2.0), (3.1, 2.0))]
    heard = np.array(off)[np.array(off) < 0.2]
    assert len(heard) >= 0.95 * len(off)
    assert heard.max() < 0.025


@settings(max_examples=12, deadline=None)
@given(seeds, st.floats(0.8, 1.7), st.floats(-0.9, 0.9))
def test_a_plain_wall_gives_no_point(seed, away, along):
    _, scan = scan_at(10.0 - away, along, walls=[[10, -6, 10, 6]], seed=seed)
    assert heard_points(scan) == ()


def test_a_scan_of_one_disc_gives_no_points():
    _, scan = scan_at(2.5, 1.2)
    assert heard_points(scan)
    assert heard_points(replace(scan, others=())) == ()


@pytest.mark.parametrize("direction", [-1, 1])
def test_points_tell_by_how_much_the_robot_turned_more_than_it_counted(direction):
    off = []
    for seed in range(8):
        _, scan = scan_at(2.3 + 0.05 * seed, 1.1, seed=seed, direction=direction)
        heard_points(
            scan.turned(1.0 / 1.006 - 1.0), sums := np.zeros(2)
        )  # it turned by 0.6 % more than these say
        turn = TurnError.of(sums, math.radians(1.2))
        assert turn is not None
        off.append((turn.relative - 0.006) / turn.sigma)
    assert abs(np.mean(off)) < 1.0 and np.abs(off).max() < 3.5


@settings(max_examples=10, deadline=None)
@given(seeds, st.sampled_from([-1, 1]))
def test_the_kernel_finds_the_echoes_that_the_plain_form_finds(seed, direction):
    x, y, heading = np.random.default_rng(seed).uniform((0.4, 0.4, -3.0), (4.6, 1.6, 3.0))
    _, scan = scan_at(x, y, heading, seed=seed, direction=direction)
    found = heard_by_discs(scan, FEATURES, CONFIG).in_front
    for number, disc in enumerate((scan, *scan.others)):
        here, expected = (
            found[found[:, 0] == number, 1:],
            np.array(list(plain_echoes(disc, FEATURES, CONFIG))).reshape(-1, 6),
        )
        order = np.lexsort(here.T.round(6)), np.lexsort(expected.T.round(6))
        np.testing.assert_allclose(here[order[0]], expected[order[1]], atol=1e-9)


def move(points, about, shift, turn):
    c, s = math.cos(turn), math.sin(turn)
    return (points - about) @ np.array([[c, s], [-s, c]]) + about + shift


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(2, 6))
def test_points_are_known_again_from_a_pose_that_is_off_as_far_as_its_prior_allows(seed, count):
    rng = np.random.default_rng(seed)
    sigma = np.array([0.05, 0.05, math.radians(3.0)])
    known = np.stack(np.meshgrid(np.arange(-3.0, 3.1), np.arange(-3.0, 3.1)), axis=-1).reshape(-1, 2)
    known = known + rng.uniform(-0.25, 0.25, known.shape)
    chosen = rng.choice(np.flatnonzero(np.hypot(*known.T) < 2.0), count, replace=False)
    dx, dy, turn = rng.uniform(-1.5, 1.5, 3) * sigma
    here = move(known[chosen], np.zeros(2), np.array([dx, dy]), turn) + rng.normal(0.0, 0.005, (count, 2))
    found = matched(here, np.zeros(2), np.diag(sigma**2), known, np.zeros(len(known)), MATCHING)
    assert (found == chosen).mean() >= 0.5  # one may be left out, none is another
    assert ((found == chosen) | (found == -1)).all()


def test_the_other_edges_of_a_thick_wall_are_new_points_and_not_those_known():
    known = np.array([[-0.45, 0.0], [0.45, 0.0]])
    beyond = known + [0.0, 0.15]
    prior = np.diag([0.03, 0.03, math.radians(1.0)]) ** 2
    about = np.array([0.0, 1.0])
    assert matched(known, about, prior, known, np.zeros(2), MATCHING).tolist() == [0, 1]
    assert matched(beyond, about, prior, known, np.zeros(2), MATCHING).tolist() == [-1, -1]


def test_a_pose_that_is_sure_of_nothing_takes_two_points_for_the_two_of_the_same_distance():
    known = np.array([[1.0, 0.0], [1.0, 0.9], [-1.0, 0.3]])
    here = move(known[:2], np.zeros(2), np.array([0.2, -0.1]), 0.15)
    unsure = np.diag([0.3, 0.3, 0.2]) ** 2
    assert matched(here, np.zeros(2), unsure, known, np.zeros(3), MATCHING).tolist() == [0, 1]


def test_nothing_known_or_nothing_near_makes_every_point_new():
    here = np.array([[0.0, 1.0], [1.0, 0.0]])
    prior = np.diag([0.01, 0.01, 0.001])
    assert matched(here, np.zeros(2), prior, np.zeros((0, 2)), np.zeros(0), MATCHING).tolist() == [-1, -1]
    far = np.array([[5.0, 5.0]])
    assert matched(here, np.zeros(2), prior, far, np.zeros(1), MATCHING).tolist() == [-1, -1]


@pytest.mark.parametrize("spread", [0.0, 0.2**2])
def test_a_point_of_which_the_map_is_unsure_may_be_farther_off(spread):
    known, here = np.array([[1.0, 0.0]]), np.array([[1.0, 0.2]])
    prior = np.diag([0.01, 0.01, 0.01]) ** 2
    found = matched(here, np.zeros(2), prior, known, np.array([spread]), MATCHING)
    assert found.tolist() == ([0] if spread else [-1])


def plainly_squared(here, about, known, variance, move):
    """Of each point of the moved scan to each known one, in squared standard deviations, shape (n, m)."""
    c, s = math.cos(move[2]), math.sin(move[2])
    moved = (here - about) @ np.array([[c, s], [-s, c]]) + about + move[:2]
    gap = known[None] - moved[:, None]
    return (gap**2).sum(axis=2) / variance


def plain_moves(points, targets, rows, columns, config):
    """Moves x, y [m], turn [rad] about the pose that put one point, or two, on known ones; and none; shape (h, 3)."""
    first, second = np.triu_indices(len(rows), 1)
    two = (rows[first] != rows[second]) & (columns[first] != columns[second])
    first, second = first[two], second[two]
    before, after = points[second] - points[first], targets[second] - targets[first]
    alike = np.abs(np.hypot(*before.T) - np.hypot(*after.T)) <= config.apart_m
    first, second, before, after = first[alike], second[alike], before[alike], after[alike]
    turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
    middle, aim = 0.5 * (points[first] + points[second]), 0.5 * (targets[first] + targets[second])
    c, s = np.cos(turn), np.sin(turn)
    turned = np.column_stack([c * middle[:, 0] - s * middle[:, 1], s * middle[:, 0] + c * middle[:, 1]])
    pairs = np.column_stack([aim - turned, turn])
    alone = np.column_stack([targets - points, np.zeros(len(points))])
    return np.vstack([np.zeros((1, 3)), alone, pairs])


def plainly_matched(here, about, prior, known, spread, config, alike):
    """All moves at once, as arrays."""
    out = np.full(len(here), -1)
    off = known[None] - here[:, None]
    rows, columns = np.nonzero((np.hypot(off[..., 0], off[..., 1]) <= config.reach_m) & alike)
    if not len(rows):
        return out
    moves = plain_moves(here[rows] - about, known[columns] - about, rows, columns, config)
    price = np.einsum("hi,ij,hj->h", moves, np.linalg.inv(prior + 1e-8 * np.eye(3)), moves)
    costs = np.stack(
        [plainly_squared(here, about, known, spread + config.place_m**2, move) for move in moves]
    )
    costs[:, ~alike] = np.inf
    cost = costs[np.argmin(price + np.minimum(costs.min(axis=2), config.unmatched).sum(axis=1))]
    for i in range(len(here)):
        j = int(np.argmin(cost[i]))
        if cost[i, j] < config.unmatched and int(np.argmin(cost[:, j])) == i:
            out[i] = j
    return out


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_points_are_matched_as_by_trying_all_moves_at_once(seed):
    rng = np.random.default_rng(seed)
    known = rng.uniform(0.0, 2.0, (rng.integers(1, 12), 2))
    true = known[rng.random(len(known)) < 0.7]
    here = np.vstack(
        [true + rng.normal(0, 0.02, true.shape) + rng.normal(0, 0.15, 2), rng.uniform(0, 2.0, (1, 2))]
    )
    prior = np.diag(rng.uniform(0.01, 0.2, 3) ** 2)
    alike = rng.random((len(here), len(known))) < 0.9
    args = (
        here,
        np.array([1.0, 1.0]),
        prior,
        known,
        rng.uniform(0.0, 0.03, len(known)) ** 2,
        MatchingConfig(),
        alike,
    )
    assert matched(*args).tolist() == plainly_matched(*args).tolist()
