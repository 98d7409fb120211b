# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Trajectories and maps for others: they read back what was believed, where it was."""

import math

import numpy as np
import pytest

from sonar_explore.cli import main
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.load import load_world
from sonar_explore.episodes.export import pgm, tum
from sonar_explore.episodes.files import save_record
from sonar_explore.episodes.run import run_episode
from sonar_explore.mapping.grid import FREE, OCCUPIED
from sonar_explore.reports.raster import grid_states


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """(record, folder with way.txt, true.txt, map.yaml and map.pgm)"""
    folder = tmp_path_factory.mktemp("export")
    record = run_episode("paper/bend", seed=1, config=ExplorationConfig(max_scans=10))
    save_record(record, folder / "episode.json")
    files = ["--tum", "way.txt", "--truth", "true.txt", "--map", "map"]
    paths = [name if name.startswith("--") else str(folder / name) for name in files]
    assert main(["export", str(folder / "episode.json"), *paths]) == 0
    return record, folder


def rows(path):
    return np.array([[float(n) for n in line.split()] for line in path.read_text().splitlines()])


def test_a_trajectory_has_every_scan_in_order_of_time_at_its_pose(exported):
    record, folder = exported
    for name, field in (("way.txt", "pose"), ("true.txt", "true_pose")):
        t, x, y, z, qx, qy, qz, qw = rows(folder / name).T
        poses = np.array([getattr(step, field) for step in record.steps])
        assert np.column_stack([x, y]) == pytest.approx(poses[:, :2], abs=1e-6)
        assert (np.diff(t) > 0).all()
        assert not (z.any() or qx.any() or qy.any())
        turn = 2.0 * np.arctan2(qz, qw) - poses[:, 2]
        assert np.abs(np.arctan2(np.sin(turn), np.cos(turn))).max() < 1e-6


def test_a_quaternion_is_of_length_one_and_its_qw_not_negative_whatever_the_heading():
    lines = tum(range(50), [(0.0, 0.0, h) for h in np.linspace(-20, 20, 50)]).splitlines()
    quaternions = [tuple(map(float, line.split()[4:])) for line in lines]
    assert [math.hypot(*q) for q in quaternions] == pytest.approx([1.0] * 50, abs=1e-8)
    assert all(q[3] >= 0.0 for q in quaternions)


def test_evo_reads_the_trajectories_and_finds_the_error_that_the_summary_says(exported):
    metrics = pytest.importorskip("evo.core.metrics", reason="the extra [evo] is not installed")
    from evo.tools.file_interface import read_tum_trajectory_file

    record, folder = exported
    believed, true = (read_tum_trajectory_file(str(folder / name)) for name in ("way.txt", "true.txt"))
    assert believed.check()[0] and true.check()[0]
    for relation, found in (
        (metrics.PoseRelation.translation_part, record.summary.position_error_m),
        (metrics.PoseRelation.rotation_angle_deg, record.summary.heading_error_deg),
    ):
        error = metrics.APE(relation)
        error.process_data((true, believed))
        assert error.get_statistic(metrics.StatisticsType.mean) == pytest.approx(found.mean, abs=2e-5)
        assert error.get_statistic(metrics.StatisticsType.max) == pytest.approx(found.max, abs=2e-5)


def test_the_ros_map_reads_back_as_a_world_with_walls_round_what_is_free(exported):
    record, folder = exported
    x, y, heading = record.world.start
    world = load_world(f"{folder / 'map.yaml'}?start={x},{y},{math.degrees(heading)}")
    states, size = grid_states(record.grid), record.grid.resolution_m
    free = states == FREE
    inner = free[1:-1, 1:-1] & free[:-2, 1:-1] & free[2:, 1:-1] & free[1:-1, :-2] & free[1:-1, 2:]
    edge = free & ~np.pad(inner, 1)

    def places(mask):
        row, column = np.nonzero(mask)
        return np.column_stack([column + 0.5, row + 0.5]) * size + record.grid.origin

    assert np.median(world.clearance(places(edge))) < size
    assert np.quantile(world.clearance(places(np.pad(inner, 1))), 0.05) > 0.4 * size
    low, high = places(free).min(axis=0) - 2 * size, places(free).max(axis=0) + 2 * size
    assert (world.bounds[:2] >= low).all() and (world.bounds[2:] <= high).all()


def test_a_map_says_free_occupied_and_unknown_as_map_server_does():
    states = np.array([[FREE, OCCUPIED, 0], [0, 0, FREE]], dtype=np.uint8)
    assert pgm(states) == b"P5\n3 2\n255\n" + bytes((205, 205, 254, 254, 0, 205))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--tum FILE"),
        (["--tum", "way.txt", "--truth", "way.txt"], "a file of its own"),
        (["--tum", "/dev/null/way.txt"], "cannot write"),
        (["--tum", "way.txt", "--map", "/dev/null/map"], "cannot write"),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_leaves_nothing(
    exported, tmp_path, monkeypatch, capsys, arguments, words
):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(exported[1] / "episode.json"), *arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and words in said
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_no_episode_is_one_line(tmp_path, capsys):
    (tmp_path / "e.json").write_text("{}")
    assert main(["export", str(tmp_path / "e.json"), "--tum", str(tmp_path / "way.txt")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "way.txt").exists()
