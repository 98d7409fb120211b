# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What eight discs agree on: a plane has one normal for all of them, a point has another bearing for each."""

import math
from dataclasses import replace

import numpy as np
import pytest
from plain_agreement import plain_extraction, plain_things
from synthetic import ROBOT, scan_room
from way_in import way_in

from sonar_explore.envs.load import load_world
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.geometry import Pose, Segment, wrap_angle
from sonar_explore.slam import FeatureKind, SlamConfig
from sonar_explore.slam.turn.agreement import AgreementConfig, extract
from sonar_explore.slam.turn.discs import agreeing

FEATURES = SlamConfig.robust().features
ALL = AgreementConfig(enabled=True)
WALL = Segment(1.2, -3.0, 1.2, 3.0)


def turn(pose, walls, edges=(), smear=1.0, spin=1):
    """One turn as all eight discs hear it."""
    first, *others = (
        scan_room(pose, walls, (), edges, sonar=disc, smear=smear, spin=spin)
        for disc in (ROBOT.sonars[2], *(d for i, d in enumerate(ROBOT.sonars) if i != 2))
    )
    return replace(first, others=tuple(others))


def walls_of(features):
    return [f for f in features if f.kind is FeatureKind.WALL]


@pytest.mark.parametrize("heading", np.linspace(0.0, 0.06, 7))
def test_eight_discs_hear_a_walls_bearing_finer_than_the_lattice_of_headings(heading):
    (wall,) = walls_of(extract(turn(Pose(0.0, 0.0, heading), [WALL]), FEATURES, ALL).features())
    assert abs(wrap_angle(wall.bearing_rad + heading)) < math.radians(0.8), "of steps of 4 degrees"
    assert wall.range_m == pytest.approx(1.2, abs=0.002) and wall.discs == 8


@pytest.mark.parametrize("range_m", [0.5, 0.7, 0.9])
def test_an_edge_that_one_disc_takes_for_a_wall_is_told_by_how_its_bearing_shifts_with_the_discs(range_m):
    wide = replace(FEATURES, beam_check=False)
    scan = turn(Pose(0.0, 0.0, 0.01), [], edges=[(range_m, 0.0)])
    assert walls_of(extract(scan, wide, AgreementConfig()).features()), "one disc is fooled"
    found = extract(scan, wide, replace(ALL, bearing_rad=math.radians(12.0))).features()
    assert not walls_of(found)
    (edge,) = (f for f in found if f.discs > 1)
    assert edge.kind is FeatureKind.EDGE and edge.range_m == pytest.approx(range_m, abs=0.02)
    assert abs(wrap_angle(edge.bearing_rad + 0.01)) < math.radians(2.5)


@pytest.mark.parametrize("spin", [1, -1])
@pytest.mark.parametrize("error", [-0.02, 0.01, 0.02])
def test_walls_heard_early_by_one_disc_and_late_by_another_tell_the_error_of_the_turn(error, spin):
    room = [WALL, Segment(-3.0, 1.1, 3.0, 1.1), Segment(-0.9, -3.0, -0.9, 3.0)]
    found = extract(turn(Pose(0.0, 0.0, 0.3), room, smear=1.0 + error, spin=spin), FEATURES, ALL)
    assert found.turn is not None
    assert found.turn.relative == pytest.approx(error, abs=3.0 * found.turn.sigma)
    assert found.turn.sigma < 0.006
    for wall in walls_of(found.features()):  # with the smear taken out, the bearings are right
        true = min((0.0, math.pi / 2, math.pi), key=lambda b: abs(wrap_angle(wall.bearing_rad + 0.3 - b)))
        off = wrap_angle(wall.bearing_rad + error * wall.sweep_rad + 0.3 - true)
        assert abs(off) < math.radians(1.2)


def test_with_one_disc_or_where_it_is_off_the_paper_extraction_stands():
    scan = turn(Pose(0.0, 0.0, 0.0), [WALL])
    alone = extract(replace(scan, others=()), FEATURES, ALL)
    paper = extract(scan, FEATURES, AgreementConfig())
    assert alone.features() == paper.features() and alone.turn is None and not alone.points
    assert all(f.discs == 1 for f in alone.features())


def test_the_order_of_the_discs_does_not_matter():
    scan = turn(Pose(0.1, 0.2, 0.4), [WALL, Segment(-3.0, 1.1, 3.0, 1.1)], edges=[(0.2, -0.9)])
    found = extract(scan, FEATURES, ALL)
    again = extract(replace(scan, others=scan.others[::-1]), FEATURES, ALL)
    assert len(found.features()) == len(again.features())
    for a, b in zip(found.features(), again.features(), strict=True):
        assert (a.kind, a.discs) == (b.kind, b.discs)
        assert a.bearing_rad == pytest.approx(b.bearing_rad) and a.range_m == pytest.approx(b.range_m)


ROOMS = ("paper/rooms", "paper/bend", "generated/home-3")


def numbers(of):
    """Of features, points or what is known of a turn: those that are rounded, and those that are not."""
    fields = [getattr(item, name) for item in of for name in item.__match_args__]
    loose = [f.as_row() if isinstance(f, Segment) else (f,) for f in fields if isinstance(f, float | Segment)]
    return [f for f in fields if not isinstance(f, float | Segment)], [x for row in loose for x in row]


@pytest.mark.parametrize("world", ROOMS)
def test_the_kernels_say_what_the_plain_form_says(world):
    places, agreed, points = load_world(world), 0, 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        start = replace(places.start, heading=rng.uniform(-7, 7))
        robot = Simulator(replace(places, start=start), SimulatorConfig(), rng)
        scan = robot.scan(1 if seed % 2 else -1)
        turn_error = rng.uniform(-0.01, 0.01)
        found = extract(scan, FEATURES, ALL, turn_error)
        expected = plain_extraction(scan.turned(turn_error), FEATURES, ALL)
        for one, other in (
            (found.features(), expected.features()),
            (found.features(0.01), [f.turned(0.01 * f.sweep_rad) for f in expected.features()]),
            (found.points, expected.points),
            ([found.turn], [expected.turn]),
        ):
            (names, values), (known, numbered) = numbers(one), numbers(other)
            assert names == known
            np.testing.assert_allclose(values, numbered, rtol=0, atol=1e-12)
        agreed += sum(f.discs > 1 for f in found.features())
        points += len(found.points)
    assert agreed > 20 and points > 5


@pytest.mark.parametrize("seed", range(60))
def test_things_are_grouped_as_the_plain_form_does(seed):
    rng = np.random.default_rng(seed)
    n, walls = int(rng.integers(1, 90)), rng.uniform([-4, 0.3], [4, 2.0], (9, 2))
    near = walls[rng.integers(0, 9, n)] + rng.normal(0, [0.03, 0.01], (n, 2))
    off = np.abs(near[:, None] - near[None, :]) / (ALL.bearing_rad, ALL.range_m)
    distance = np.where((off <= 1.0).all(axis=2), off.sum(axis=2), np.inf)
    disc, members, ends = np.sort(rng.integers(0, 8, n)), np.empty(n, np.int64), np.empty(n, np.int64)
    expected = plain_things(distance, disc, near[:, 0], ALL.discs_min)
    count = way_in(agreeing)(distance, disc, near[:, 0], float(ALL.discs_min), members, ends)
    found = [rows.tolist() for rows in np.split(members, ends[:count])[:count]]
    assert found == expected
    assert found or n < 40
