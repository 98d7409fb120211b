# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.E: how sure a new root is, and which chains dangle."""

import numpy as np
import pytest
from synthetic import scan_room

from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam import SlamConfig, make_slam
from sonar_explore.slam.probability import RootCertainty

NOTHING = np.array([])
START = Pose(0.0, 0.0, 0.0)
NEAR = [Segment(-1, 1, 1, 1), Segment(1.2, -1, 1.2, 1)]
FAR = [Segment(x, 21, x + 2, 21) for x in (-1.0,)]


def test_case_a_is_the_mean_of_the_associated_roots():
    certainty = RootCertainty.of_first_scan().after(np.array([1.0, 0.4]))
    assert certainty.probability == pytest.approx(0.7) and not certainty.dangling


def test_case_b_is_half_of_the_latest_case_a_and_dangles():
    certainty = RootCertainty.of_first_scan().after(np.array([1.0, 0.4])).after(NOTHING)
    assert certainty.probability == pytest.approx(0.35) and certainty.dangling


def test_case_b_without_any_case_a_is_one_half():
    assert RootCertainty.of_first_scan().after(NOTHING).probability == 0.5


def test_case_b_does_not_compound():
    certainty = RootCertainty.of_first_scan().after(np.array([0.8]))
    for _ in range(4):
        certainty = certainty.after(NOTHING)
        assert certainty.probability == pytest.approx(0.4)


def test_a_scan_that_meets_nothing_known_roots_dangling_chains():
    slam = make_slam("chain", START, SlamConfig())
    slam.update(scan_room(START, NEAR))
    away = Pose(0.0, 20.0, 0.0)
    update = slam.update(scan_room(away, FAR))
    assert update.dangling == update.new_chains == (2,)
    assert slam.chains[2].root_probability == 0.5
    assert update.pose == update.predicted_pose


def test_a_new_wall_seen_beside_a_known_one_takes_its_certainty():
    slam = make_slam("chain", START, SlamConfig())
    slam.update(scan_room(START, NEAR))
    update = slam.update(scan_room(START, [*NEAR, Segment(-1, -1, 1, -1)]))
    assert update.dangling == () and len(update.new_chains) == 1
    assert slam.chains[update.new_chains[0]].root_probability == 1.0
