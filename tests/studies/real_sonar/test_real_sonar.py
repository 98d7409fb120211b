"""The study of real sonar, on recordings made up by the simulator, and on the recorded ones where they are."""

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore import cli
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose, Segment, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.replay.layouts import WAYPOINTS_M, read_logs
from sonar_explore.replay.log import Log
from sonar_explore.replay.play import replay
from sonar_explore.sensors import sensor_preset
from sonar_explore.studies.real_sonar.fit import fit_beam, half_angle_deg
from sonar_explore.studies.real_sonar.study import arena, study_real_sonar, with_odometry
from sonar_explore.studies.real_sonar.walls import judged, lies_on, visible_walls

DATA = os.environ.get("SONAR_EXPLORE_DATA")
recorded = pytest.mark.skipif(DATA is None, reason="SONAR_EXPLORE_DATA is not set: no recorded sonar to read")
ARENA_CM = [(0, 0, 0, 168), (0, 168, 84, 168), (84, 168, 84, 210), (84, 210, 168, 210)]
ARENA_CM += [(168, 210, 168, 84), (168, 84, 210, 84), (210, 84, 210, 0), (210, 0, 0, 0)]
WALLS = [Segment(*(v / 100 for v in row)) for row in ARENA_CM]


def simulator(sensor: str = "nxt") -> Simulator:
    rows = np.array(ARENA_CM) / 100
    world = World("arena", "Arena", rows, np.zeros(len(rows)), np.zeros((0, 3)), Pose(0.84, 0.3, 0.0), False)
    config = ExplorationConfig().with_sensor(sensor).with_noise("ideal").simulator
    centred = replace(config.robot, sonars=(Pose(0.0, 0.0, 0.0),), scan_sonar=0)
    return Simulator(world, replace(config, robot=centred), np.random.default_rng(3))


@pytest.fixture(scope="module")
def recordings(tmp_path_factory) -> Path:
    """Five scans in the layout of `imperial_nxt`, as the simulated sensor hears them."""
    data = tmp_path_factory.mktemp("data")
    folder = data / "imperial_nxt" / "team__robots"
    folder.mkdir(parents=True)
    lines = [",".join(map(str, row)) for row in ARENA_CM]
    (data / "imperial_nxt" / "arena_walls_lab.txt").write_text("\n".join(f"({line})" for line in lines))
    index = ["file\tsense\tstart_heading_deg\tfit_x_cm\tfit_y_cm\tquality"]
    robot = simulator()
    for k, (x, y) in enumerate(WAYPOINTS_M):
        robot.true_pose = Pose(x, y, 0.0)
        heard = np.round(robot.scan(1).ranges_m * 100)
        (folder / f"loc_0{k}.dat").write_text("\n".join(f"{value:.0f}" for value in heard))
        index.append(f"team__robots/loc_0{k}.dat\tccw\t0\t{100 * x:.0f}\t{100 * y:.0f}\tgood")
    (data / "imperial_nxt" / "INDEX.tsv").write_text("\n".join(index))
    return data


def test_on_simulated_scans_most_walls_are_true_and_most_are_found(recordings):
    found = study_real_sonar(recordings, 1)
    (scans,) = found.sets
    assert arena(recordings / "imperial_nxt" / "arena_walls_lab.txt") == tuple(WALLS)
    true = [good for verdict in scans.verdicts for good in verdict.true]
    met = [hit for verdict in scans.verdicts for hit in verdict.found]
    assert np.mean(true) > 0.7
    assert np.mean(met) > 0.7


def test_an_odometry_without_errors_leads_to_the_waypoints(recordings):
    (log,) = read_logs(sorted(recordings.glob("imperial_nxt/*/*.dat")))
    errors = replay(with_odometry(log, "ideal", 0), "off").errors
    assert errors is not None
    assert errors.max() < 1e-9


@pytest.mark.parametrize("noise", ["paper", "worn"])
def test_the_errors_of_the_odometry_are_of_the_size_that_the_preset_says(noise):
    """Four metres straight on: distance within the random walk, heading within bend and drift."""
    quiet = Scan(Pose(0, 0, 0), np.arange(90) * 0.069, np.full(90, 2.55), Pose(0, 0, 0), 2.55)
    log = Log("", Pose(0, 0, 0), (quiet, quiet), (Pose(0.0, 0.0, 0.0), Pose(4.0, 0.0, 0.0)), "nxt")
    ends = [with_odometry(log, noise, seed).scans[1].pose_robot_in_odometry for seed in range(60)]
    preset = noise_preset(noise)
    sigma = preset.distance_sigma_m * math.sqrt(4.0)
    far = [end.x for end in ends]
    assert np.std(far) == pytest.approx(sigma, rel=0.35)
    bend = (preset.wheel_ratio - 1.0) / 0.23 * 4.0
    assert np.median([abs(end.heading) for end in ends]) == pytest.approx(bend, rel=0.35)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.3, 1.8), st.floats(0.3, 1.3), st.floats(-3.0, 3.0))
def test_the_foot_of_a_visible_wall_lies_on_it_and_makes_a_true_wall(x, y, heading):
    pose = Pose(x, y, heading)
    for wall in visible_walls(pose, WALLS, 0.2, 2.0):
        distance = wall.signed_distance(x, y)
        nx, ny = wall.unit_normal
        foot_x, foot_y = x - distance * nx, y - distance * ny
        piece = Segment(foot_x - 0.1 * ny, foot_y + 0.1 * nx, foot_x + 0.1 * ny, foot_y - 0.1 * nx)
        assert lies_on(piece, wall)
        away = Segment(piece.x1 + 0.2 * nx, piece.y1 + 0.2 * ny, piece.x2 + 0.2 * nx, piece.y2 + 0.2 * ny)
        assert not lies_on(away, wall)
        turned = piece.transformed(Pose(0.0, 0.0, 0.3))
        assert abs(wrap_angle(turned.direction - piece.direction)) > 0.2
        assert not lies_on(turned, wall)


def test_the_beam_that_was_simulated_is_found_again():
    robot = simulator()
    beam = sensor_preset("nxt").sonar.beam
    verdicts = []
    for x, y in np.random.default_rng(1).uniform(0.35, 1.3, (60, 2)):
        robot.true_pose = Pose(float(x), float(y), 0.0)
        verdicts.append(judged(robot.scan(1), robot.true_pose, WALLS, sensor_preset("nxt").slam.features))
    fit = fit_beam(verdicts)
    ranges = np.array([0.4, 0.8, 1.2])
    told = np.degrees([beam.plane_half_angle_rad(r) for r in ranges])
    assert half_angle_deg(fit.s_deg, fit.heard_deg, ranges) == pytest.approx(told, abs=5.0)


def test_the_command_leaves_a_page_and_makes_the_tables_of_the_docs_anew(recordings, tmp_path, capsys):
    docs = tmp_path / "real.md"
    docs.write_text("before\n<!-- real-sonar -->\nyesterday\n<!-- end of real-sonar -->\nafter\n")
    command = ["real-sonar", str(recordings), "--seeds", "1", "--out", str(tmp_path / "out")]
    assert cli.main([*command, "--docs", str(docs)]) == 0
    page = (tmp_path / "out" / "index.html").read_text()
    assert 'src="data:image/png' in page and "http" not in page.split("</style>")[1]
    text = docs.read_text()
    assert text.startswith("before\n") and text.endswith("after\n") and "yesterday" not in text
    assert "| smoothed |" in text
    assert (tmp_path / "real" / "beam.png").read_bytes().startswith(b"\x89PNG")


def test_a_folder_without_recordings_is_refused_and_nothing_is_left(tmp_path, capsys):
    with pytest.raises(SonarExploreError, match="imperial_nxt"):
        study_real_sonar(tmp_path, 1)
    assert cli.main(["real-sonar", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()
    assert capsys.readouterr().err.count("\n") == 1


@recorded
def test_the_preset_is_what_the_recorded_scans_say():
    folder = Path(DATA or ".") / "sonar" / "imperial_nxt"
    walls = arena(folder / "arena_walls_lab.txt")
    features, beam = sensor_preset("nxt").slam.features, sensor_preset("nxt").sonar.beam
    verdicts = []
    for log in read_logs(sorted(folder.glob("fracek*/*.dat")) + sorted(folder.glob("yifan*/*.dat"))):
        assert log.reference is not None
        verdicts += [
            judged(s, pose, walls, features) for s, pose in zip(log.scans, log.reference, strict=True)
        ]
    fit = fit_beam(verdicts)
    assert fit.heard_deg == pytest.approx(math.degrees(beam.plane_half_angle_rad(1.0)), abs=6.0)
