# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Everything measured, solved at once: exact measurements give the truth, false ones do little harm."""

import numpy as np
import pytest
from a_room import START, WHEELS, all_pillars_heard, loop, off_by, sightings, smoother

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig
from sonar_explore.slam.turn.sighting import Sighting


@pytest.mark.parametrize("seed", range(4))
def test_exact_measurements_give_the_true_poses_from_bad_first_guesses(seed):
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(seed), off=(0.08, 0.08, 0.04))
    for _ in range(5):
        out.solve()
    assert (off_by(out, poses) < 1e-4).all()
    assert np.abs(out.constants).max() < 1e-5


def test_a_wrong_wheel_base_is_found_by_the_turns():
    poses, motions = loop(turn_error=0.01)
    out = smoother(poses, motions, np.random.default_rng(0), off=(0.03, 0.03, 0.02))
    for _ in range(5):
        out.solve()
    assert out.constants[0] == pytest.approx(0.01, abs=0.002)
    assert (off_by(out, poses) < (0.01, 0.01, 0.005)).all()


@pytest.mark.parametrize("scale", [0.01, -0.01])
def test_the_scale_of_the_ranges_is_learned_from_walls_near_and_far_more_with_every_round(scale):
    found = []
    for rounds in (2, 8, 20):
        poses, motions = loop(rounds=rounds)
        out = Smoother(START, SmoothingConfig(range_m=0.003), WHEELS)
        for i, p in enumerate(poses):
            out.add_scan(p, motions[i - 1] if i else None)
        for s in sightings(poses):
            out.add_sighting(s._replace(range_m=s.range_m / (1.0 + scale)))
        for _ in range(5):
            out.solve()
        found.append(out.constants[2] / scale)
    assert 0.2 < found[0] < found[1] < found[2] < 1.0
    assert found[2] > 0.75


def test_a_planted_false_merge_does_not_fold_the_map():
    poses, motions = loop()

    def chain_of(scan, wall):  # the last round meets another chain on the far wall
        return 9 if wall == 1 and scan > len(poses) // 2 else wall

    out = smoother(poses, motions, np.random.default_rng(0), chain_of=chain_of)
    stranger = [Sighting(k, 5, wrap_angle(-poses[k].heading), 0.0, 3.7 - poses[k].x) for k in (2, 3)]
    for s in stranger:  # a cupboard 0.3 m before the wall
        out.add_sighting(s)
    out.solve()
    assert (off_by(out, poses) < 1e-6).all()
    out.merge(1, 9)
    out.merge(1, 5)
    for _ in range(3):
        out.solve()
    assert (off_by(out, poses) < (0.03, 0.03, 0.02)).all()


def test_a_true_merge_puts_two_chains_on_one_line_and_moves_nothing():
    poses, motions = loop()
    out = smoother(poses, motions, np.random.default_rng(0), chain_of=lambda i, w: w + 4 * (i > 9))
    for wall in range(4):
        out.merge(wall, wall + 4)
    out.solve()
    assert (off_by(out, poses) < 1e-6).all()
    assert out.chains == [0, 1, 2, 3]


def test_a_copy_stays_as_it_was_whatever_becomes_of_the_other():
    out, other = all_pillars_heard(), all_pillars_heard()
    kept = out.copy()
    out.merge_points(10, 12)
    out.merge(0, 2)
    out.add_scan(Pose(1.0, 1.0, 0.0), loop()[1][0])
    out.add_point(Sighting(0, 99, 0.4, 0.0, 1.0))
    out.solve()
    for one in (kept, other):
        one.solve()
    assert (kept.poses == other.poses).all() and (kept.points()[1] == other.points()[1]).all()
    assert kept.misfit() == other.misfit() != out.misfit()
