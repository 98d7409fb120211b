# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The whole of SLAM, scan by scan."""

import math

import numpy as np
import pytest
from synthetic import rectangle, scan_room

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam import SLAMS, ChainSlam, SlamConfig, make_slam
from sonar_explore.slam.features import FeatureConfig
from sonar_explore.slam.localization import Correction, LocalizationConfig

ROOM, CORNERS = rectangle(2.6, 2.2)
CORRIDOR = [Segment(-2, 0.8, 20, 0.8), Segment(-2, -0.8, 20, -0.8)]
START = Pose(1.2, 0.9, 0.3)


def drive(name, seed, walls=CORRIDOR, steps=14, step_m=0.7, heading=0.0):
    """True and believed poses of a robot that drives straight on with a drifting odometry."""
    rng = np.random.default_rng(seed)
    bend, spin = rng.choice([-1, 1], 2) * rng.uniform(0.5, 1.5, 2) * np.radians([0.75, 1.8])
    true = odometry = Pose(0.0, 0.0, heading)
    slam = make_slam(name, true, SlamConfig())
    believed = []
    for _ in range(steps):
        if name == "truth":
            slam.place(true)
        scan = scan_room(true, walls, odometry=odometry, smear=1 + spin / math.tau, rng=rng)
        believed.append((true, slam.update(scan).pose))
        spun = true @ Pose(0, 0, math.tau + spin + rng.normal(0, math.radians(1.0)))
        odometry = odometry @ Pose(0, 0, math.tau)
        # The robot steers by what it believes, or it would leave the corridor.
        turn = heading - spun.heading
        true = spun @ Pose(0, 0, turn) @ Pose(step_m, 0, bend * step_m)
        odometry = odometry @ Pose(0, 0, turn) @ Pose(step_m * (1 + rng.normal(0, 0.02)), 0, 0)
    return slam, believed


def errors(believed):
    true, belief = believed[-1]
    return abs(math.remainder(belief.heading - true.heading, math.tau)), belief.distance_to(true)


@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_down_a_corridor_chains_end_nearer_the_truth_than_dead_reckoning(heading):
    walls = [wall.transformed(Pose(0, 0, heading)) for wall in CORRIDOR]
    ends = {
        name: np.array([errors(drive(name, seed, walls, heading=heading)[1]) for seed in range(6)])
        for name in ("chain", "off")
    }
    (chain_turn, chain_off), (off_turn, off_off) = (ends[name].mean(axis=0) for name in ("chain", "off"))
    assert chain_turn < 0.2 * off_turn and chain_off < 0.2 * off_off
    assert ends["chain"][:, 0].max() < math.radians(3.0)
    # A root is as straight as a 4-degree lattice sees it: a degree of tilt is 16 cm after 9 m.
    assert ends["chain"][:, 1].max() < 0.30


def test_off_grows_chains_by_the_same_code_but_never_corrects():
    slam, believed = drive("off", 0, steps=4)
    assert len(slam.chains) > 0
    assert believed[0][1] == Pose(0, 0, 0)
    update = slam.update(scan_room(START, ROOM))
    assert update.correction == Correction() and update.pose == update.predicted_pose


def test_truth_is_where_it_is_placed():
    slam, believed = drive("truth", 0, steps=4)
    assert [entry.pose for entry in slam.scans] == [belief for _, belief in believed]
    for true, belief in believed:
        assert belief.distance_to(true) == 0.0


def test_truth_that_is_not_placed_says_so():
    slam = make_slam("truth", START, SlamConfig())
    slam.place(START)
    slam.update(scan_room(START, ROOM))
    with pytest.raises(SonarExploreError, match=r"place\(\)"):
        slam.update(scan_room(START, ROOM))


def test_an_unknown_slam_lists_the_known():
    with pytest.raises(
        SonarExploreError, match="known: chain, grid-pf, literal, off, scan-match, smoothed, truth"
    ):
        make_slam("fast", START, SlamConfig())


@pytest.mark.parametrize("name", SLAMS)
def test_a_scan_that_hears_nothing_changes_nothing(name):
    slam = make_slam(name, START, SlamConfig())
    slam.place(START)
    update = slam.update(scan_room(START, []))
    assert (update.features, update.associations, update.new_chains, update.dangling) == ((), (), (), ())
    assert slam.pose == START and len(slam.scans) == 1


def test_a_bad_scan_leaves_the_belief_as_it_was():
    slam = ChainSlam(START, SlamConfig())
    slam.update(scan_room(START, ROOM))
    bad = scan_room(START, ROOM, odometry=Pose(5, 5, 1))
    bad.ranges_m[3] = math.nan
    with pytest.raises(SonarExploreError):
        slam.update(bad)
    assert slam.pose == START and len(slam.scans) == 1


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_a_full_turn_of_the_odometry_only_counts_on(turns):
    slam = ChainSlam(START, SlamConfig())
    slam.update(scan_room(START, ROOM, odometry=Pose(0, 0, 0)))
    pose = slam.predict(Pose(1.0, 0.0, turns * math.tau))
    expected = START @ Pose(1.0, 0.0, 0.0)
    assert (pose.x, pose.y) == pytest.approx((expected.x, expected.y))
    assert pose.heading == pytest.approx(START.heading + turns * math.tau)


def test_a_placed_heading_keeps_the_count_of_turns():
    slam = ChainSlam(Pose(0, 0, 3 * math.tau), SlamConfig())
    slam.place(Pose(0, 0, 0.1))
    assert slam.pose.heading == pytest.approx(3 * math.tau + 0.1)


def test_a_small_error_in_a_known_room_is_undone():
    slam = ChainSlam(START, SlamConfig())
    slam.update(scan_room(START, ROOM, CORNERS, odometry=START))
    drifted = Pose(START.x + 0.06, START.y - 0.04, START.heading + math.radians(4.0))
    update = slam.update(scan_room(START, ROOM, CORNERS, odometry=drifted))
    assert len(update.link_graphs.kept) == 4
    assert update.predicted_pose.distance_to(drifted) < 1e-9
    assert (update.pose.x, update.pose.y, update.pose.heading) == pytest.approx(
        (START.x, START.y, START.heading)
    )


def test_turning_and_moving_the_map_frame_leaves_every_decision_unchanged():
    def history(frame):
        slam = ChainSlam(frame @ START, SlamConfig())
        updates = []
        for step in range(4):
            pose = START @ Pose(0.1 * step, 0.02 * step, 0.04 * step)
            rng = np.random.default_rng(step)
            scan = scan_room(pose, ROOM, CORNERS, odometry=Pose(0.11 * step, 0, 0), rng=rng)
            updates.append(slam.update(scan))
        return [
            (
                [
                    (a.association.feature, a.association.chain, a.association.link, a.kept)
                    for a in u.associations
                ],
                u.new_chains,
                u.merges,
                u.dangling,
            )
            for u in updates
        ]

    assert (
        history(Pose(0, 0, 0)) == history(Pose(7.0, -3.0, math.pi / 2)) == history(Pose(-2.0, 4.0, math.pi))
    )


def test_features_of_one_scan_never_meet():
    slam = ChainSlam(START, SlamConfig())
    walls = [Segment(0.0, 2.2, 2.6, 2.2), Segment(1.0, 2.05, 2.6, 2.05)]
    update = slam.update(scan_room(START, [*walls, *ROOM[:2]]))
    assert update.associations == () and len(update.new_chains) == len(slam.chains)


def test_without_consensus_a_demand_for_two_corrects_nothing():
    walls = [Segment(-1, 1, 1, 1), Segment(1, -1, 1, 1)]
    config = SlamConfig(localization=LocalizationConfig(min_consensus=3))
    slam = ChainSlam(Pose(0, 0, 0), config)
    slam.update(scan_room(Pose(0, 0, 0), walls))
    update = slam.update(scan_room(Pose(0.05, 0.05, 0.03), walls, odometry=Pose(0, 0, 0)))
    assert len(update.associations) == 2 and update.correction == Correction()


def test_a_turn_beyond_belief_is_refused():
    config = SlamConfig(localization=LocalizationConfig(turn_max_rad=math.radians(5.0)))
    for degrees, corrected in ((4.0, True), (8.0, False)):
        slam = ChainSlam(START, config)
        slam.update(scan_room(START, ROOM, odometry=START))
        turned = START @ Pose(0, 0, math.radians(degrees))
        update = slam.update(scan_room(START, ROOM, odometry=turned))
        assert (update.correction != Correction()) is corrected


def test_the_robust_config_leaves_out_a_jamb_that_the_paper_takes_for_a_wall():
    walls, jamb = [Segment(-2, 0.9, 2, 0.9)], [(0.8, -0.3)]
    found = [
        len(ChainSlam(START, config).update(scan_room(Pose(0, 0, 0), walls, edges=jamb)).new_chains)
        for config in (SlamConfig(), SlamConfig.robust())
    ]
    assert found == [2, 1]


def test_a_config_out_of_range_is_refused_by_name():
    with pytest.raises(SonarExploreError, match=r"slam\.features\.tolerance_m"):
        SlamConfig(features=FeatureConfig(tolerance_m=0.0))


def test_what_was_scored_is_told_edge_by_edge():
    slam = ChainSlam(START, SlamConfig())
    slam.update(scan_room(START, ROOM))
    update = slam.update(scan_room(START, ROOM))
    for scored in update.associations:
        assert scored.kept and scored.adr_rad == pytest.approx(0.0, abs=1e-9)
        assert (scored.w1, scored.probability, scored.w2) == pytest.approx((1.0, 1.0, 0.5))
