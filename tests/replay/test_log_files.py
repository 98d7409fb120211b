"""The log as a file: a replay repeats the run, and whatever is wrong is said in one line."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore import cli
from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.run import run_episode
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose
from sonar_explore.measurement import Scan
from sonar_explore.replay.files import MAX_READINGS, read_log, write_log
from sonar_explore.replay.log import Log, Recorder
from sonar_explore.replay.play import replay

HEAD = {"log": "sonar_explore", "version": 1, "start": [0, 0, 0]}
SCAN = {"at": [0, 0, 0], "headings": [0, 2, 4], "ranges": [1.0, 1.2, 5.0], "range_max": 5.0}
numbers = st.floats(-50.0, 50.0)
poses = st.builds(Pose, numbers, numbers, numbers)


def write(path, *lines):
    path.write_text("\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines))
    return path


@pytest.mark.parametrize("scan", ["turn", "ring"])
@pytest.mark.parametrize("slam", ["chain", "smoothed", "literal", "off"])
def test_a_replay_gives_the_poses_of_the_run(tmp_path, slam, scan):
    recorder, config = Recorder(), ExplorationConfig(scan=scan, max_scans=5)
    record = run_episode("paper/rooms", slam=slam, seed=1, config=config, recorder=recorder)
    write_log(recorder.log, tmp_path / "log.jsonl")
    again = replay(read_log(tmp_path / "log.jsonl"), slam, config.slam)
    poses = [(round(u.pose.x, 6), round(u.pose.y, 6), round(u.pose.heading, 6)) for u in again.updates]
    assert poses == [step.pose for step in record.steps]
    assert again.errors is not None
    assert again.errors[0].max() < 1e-6  # the first scan is taken at the start


def test_to_be_overheard_changes_nothing():
    config = ExplorationConfig(max_scans=3)
    quiet = run_episode("paper/bend", seed=4, config=config)
    assert run_episode("paper/bend", seed=4, config=config, recorder=Recorder()).steps == quiet.steps


@settings(max_examples=50, deadline=None)
@given(st.data(), st.integers(3, 40), st.booleans(), st.booleans())
def test_what_is_written_is_read_back_to_the_last_bit(tmp_path_factory, data, n, ring, known):
    path = tmp_path_factory.mktemp("log") / "log.jsonl"
    discs = np.array(data.draw(st.lists(st.tuples(numbers, numbers), min_size=n, max_size=n)))
    headings = np.linspace(0.0, 6.0, n)
    scan = Scan(
        pose_robot_in_odometry=data.draw(poses),
        headings_rad=headings,
        ranges_m=np.array(data.draw(st.lists(st.floats(0.0, 5.0), min_size=n, max_size=n))),
        pose_sonar_in_robot=data.draw(poses),
        range_max_m=5.0,
        ring=np.column_stack([discs, np.full(n, 0.25)]) if ring else None,
    )
    way = tuple(data.draw(st.lists(poses, max_size=5)))
    log = Log("about", data.draw(poses), (*way, scan), (data.draw(poses),) if known else None, "nxt")
    write_log(log, path)
    back = read_log(path)
    assert (back.about, back.start, back.reference, back.sensor) == ("about", log.start, log.reference, "nxt")
    assert back.entries[:-1] == way
    (again,) = back.scans
    assert again.pose_robot_in_odometry == scan.pose_robot_in_odometry
    assert np.array_equal(again.ranges_m, scan.ranges_m)
    assert np.array_equal(again.bearings_rad, scan.bearings_rad)
    assert np.array_equal(again.discs, scan.discs)


@pytest.mark.parametrize(
    "lines, said",
    [
        ([], "is empty"),
        (["not json", SCAN], "line 1"),
        ([SCAN], "line 1"),
        ([HEAD], "0 scans"),
        ([HEAD | {"version": 2}, SCAN], "line 1"),
        ([HEAD | {"sensor": "bat"}, SCAN], "known: amigobot"),
        ([HEAD, SCAN | {"speed": 3}], "line 2.*speed"),
        ([HEAD, SCAN, SCAN | {"ranges": [1, 2]}], "line 3"),
        ([HEAD, SCAN | {"ranges": [1, 2, -3]}], "line 2"),
        ([HEAD, SCAN | {"ranges": [1, 2, "far"]}], "line 2.*ranges"),
        ([HEAD, SCAN | {"headings": [0, 2, 1]}], "line 2.*one way round"),
        ([HEAD, SCAN | {"headings": [0, 3, 7]}], "line 2.*more than once round"),
        ([HEAD, SCAN | {"at": [0, 0]}], "line 2"),
        ([HEAD, SCAN | {"at": [1e9, 0, 0]}], "line 2"),
        ([HEAD, json.dumps(SCAN).replace("1.2", "NaN")], "line 2"),
        ([HEAD, json.dumps(SCAN).replace("1.2", "1e999")], "line 2"),
        ([HEAD, SCAN | {"ring": [[0, 0, 0]]}], "line 2.*3 ranges.*1 disc"),
        ([HEAD, SCAN | {"reference": [0, 0, 0]}, SCAN], "1 of 2 scans"),
        ([HEAD, SCAN | {"ranges": [1.0] * (MAX_READINGS + 1)}], "line 2"),
        ([HEAD, "[" * 100_000], "line 2"),
    ],
)
def test_a_bad_log_is_refused_in_one_line_and_nothing_is_written(tmp_path, capsys, lines, said):
    path = write(tmp_path / "log.jsonl", *lines)
    with pytest.raises(SonarExploreError, match=said):
        read_log(path)
    assert cli.main(["replay", str(path), "--out", str(tmp_path / "out")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_truth_needs_somebody_who_knows(tmp_path):
    log = read_log(write(tmp_path / "log.jsonl", HEAD, SCAN))
    with pytest.raises(SonarExploreError, match="reference poses"):
        replay(log, "truth")
    told = replay(replace(log, reference=(Pose(1.0, 2.0, 0.5),)), "truth")
    assert told.updates[0].pose == Pose(1.0, 2.0, 0.5)


def test_the_command_line_keeps_a_log_and_replays_it(tmp_path, capsys):
    log, out = tmp_path / "logs" / "a.jsonl", tmp_path / "replay"
    run = ["run", "paper/corridor", "--seed", "2", "--max-scans", "3", "--json", "--log", str(log)]
    assert cli.main([*run, "--out", str(tmp_path / "run")]) == 0
    assert json.loads(capsys.readouterr().out)["scans"] == 3
    assert cli.main(["replay", str(log), "--out", str(out), "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    record = json.loads((tmp_path / "run" / "episode.json").read_text())
    for scan, step in zip(found["scans"], record["steps"], strict=True):
        assert scan["pose"] == pytest.approx(step["pose"], abs=1e-6)
    assert sorted(p.name for p in out.iterdir()) == ["replay.html", "replay.json"]


def test_headings_may_run_through_full_turns(tmp_path):
    turned = SCAN | {"at": [0.5, 0, math.tau]}
    once, more = (replay(read_log(write(tmp_path / "l", HEAD, SCAN, s))) for s in (SCAN, turned))
    assert once.updates[0].pose == more.updates[0].pose
