# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Points hold the poses as walls do, once a second scan hears them; two that are one are put together."""

import math

import numpy as np
import pytest
from a_room import PILLARS, START, WHEELS, all_pillars_heard, loop, off_by, pillars_seen, smoother

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig
from sonar_explore.slam.turn.sighting import Sighting


@pytest.mark.parametrize("seed", range(3))
def test_points_alone_give_the_true_poses_from_bad_first_guesses(seed):
    poses, motions = loop()
    rng, out = np.random.default_rng(seed), Smoother(START, SmoothingConfig(), WHEELS)
    for i, p in enumerate(poses):
        dx, dy, dh = rng.normal(0, (0.05, 0.05, 0.03)) if i else (0.0, 0.0, 0.0)
        out.add_scan(Pose(p.x + dx, p.y + dy, p.heading + dh), motions[i - 1] if i else None)
        for s in pillars_seen(i, p):
            out.add_point(s)
    for _ in range(6):
        out.solve()
    assert (off_by(out, poses) < 1e-4).all()
    numbers, places = out.points()
    assert dict(zip(numbers.tolist(), places.round(3).tolist(), strict=True)) == {
        10 + k: list(place) for k, place in enumerate(PILLARS)
    }


def test_a_column_heard_from_all_sides_is_known_by_its_middle_and_radius():
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        away = math.hypot(2.5 - p.x, 1.5 - p.y)
        bearing = wrap_angle(math.atan2(1.5 - p.y, 2.5 - p.x) - p.heading)
        out.add_point(Sighting(i, 7, bearing, 0.0, away - 0.12, radius_m=0.12 * (1.3 if i % 2 else 0.9)))
    for _ in range(5):
        out.solve()
    (number,), ((x, y),) = out.points()
    assert number == 7
    assert (x, y) == pytest.approx((2.5, 1.5), abs=1e-3)
    assert out.radii == pytest.approx([0.12], abs=2e-3)
    assert (off_by(out, poses) < 1e-3).all()


def test_a_point_heard_once_binds_nothing_and_stays_where_its_scan_heard_it():
    poses, motions = loop(rounds=1)
    out = smoother(poses, motions, np.random.default_rng(0))
    out.solve()
    before = out.poses.copy()
    out.add_point(Sighting(3, 7, 0.4, 0.0, 1.0))
    out.solve()
    np.testing.assert_allclose(out.poses, before, atol=1e-9)
    (number,), ((x, y),) = out.points()
    assert number == 7
    assert (x, y) == pytest.approx(
        (poses[3] @ Pose(0.0, 0.0, 0.4)).transform(np.array([[1.0, 0.0]]))[0], abs=1e-6
    )


def test_two_numbers_of_one_column_become_one_and_say_together_what_one_would():
    poses, motions = loop()
    found = []
    for split in (False, True):
        out = smoother(poses, motions, np.random.default_rng(0))
        for i, p in enumerate(poses):
            for s in pillars_seen(i, p):
                number = s.what + 50 * (split and i > len(poses) // 2)
                out.add_point(s._replace(what=number, range_m=s.range_m - 0.1, radius_m=0.08))
        for number in range(10, 14) if split else ():
            out.merge_points(number, number + 50)
        for _ in range(5):
            out.solve()
        numbers, places = out.points()
        assert sorted(numbers.tolist()) == [10, 11, 12, 13] and len(out.radii) == 4
        found.append((out.poses, places[np.argsort(numbers)]))
    np.testing.assert_allclose(found[0][0], found[1][0], atol=2e-5)
    np.testing.assert_allclose(found[0][1], found[1][1], atol=2e-5)
    np.testing.assert_allclose(found[1][1], PILLARS, atol=2e-3)


def test_a_planted_false_merge_of_points_does_not_fold_the_map():
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0))
    for i, p in enumerate(poses):
        for s in pillars_seen(i, p):
            out.add_point(s)
    out.solve()
    out.merge_points(10, 12)  # more than a metre apart
    for _ in range(3):
        out.solve()
    assert (off_by(out, poses) < (0.03, 0.03, 0.02)).all()


def test_putting_points_together_costs_nothing_where_they_are_the_same_and_much_where_they_are_not():
    out = all_pillars_heard(split=50)
    before, false = out.misfit(), out.copy()
    for number in range(10, 14):
        out.merge_points(number, number + 50)
    out.solve()
    assert out.misfit() == pytest.approx(before, abs=1.0)
    false.merge_points(10, 62)
    false.solve()
    assert false.misfit() > before + 25.0
