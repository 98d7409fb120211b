"""Scans as others keep them: made-up files in their layouts, and the recorded ones where they are."""

import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import wrap_angle
from sonar_explore.replay.layouts import WAYPOINTS_M, read_logs, turning_stretches
from sonar_explore.replay.play import replay
from sonar_explore.slam.features import FeatureKind

DATA = os.environ.get("SONAR_EXPLORE_DATA")
recorded = pytest.mark.skipif(DATA is None, reason="SONAR_EXPLORE_DATA is not set: no recorded sonar to read")
INDEX = "file\tsense\tstart_heading_deg\tfit_x_cm\tfit_y_cm\tquality\n"


def nxt_folder(tmp_path, count=5, n=72):
    folder = tmp_path / "team"
    folder.mkdir()
    for k in range(count):
        (folder / f"loc_{k:02}.dat").write_text("\n".join(str(50 + (i + k) % 9) for i in range(n)))
    return folder


def test_scans_of_one_name_are_one_log_in_waypoint_order(tmp_path):
    folder = nxt_folder(tmp_path)
    (log,) = read_logs(sorted(folder.glob("*.dat"), reverse=True))
    assert log.reference is not None
    assert [(pose.x, pose.y) for pose in log.reference] == list(WAYPOINTS_M)
    assert [scan.ranges_m[0] for scan in log.scans] == pytest.approx([0.5, 0.51, 0.52, 0.53, 0.54])


def test_255_and_0_are_no_echo(tmp_path):
    folder = nxt_folder(tmp_path, 1)
    (folder / "loc_00.dat").write_text("255\n0\n100\n90\n")
    (log,) = read_logs([folder / "loc_00.dat"])
    (scan,) = log.scans
    assert list(scan.ranges_m < scan.range_max_m) == [False, False, True, True]


def test_the_index_gives_sense_and_start_heading(tmp_path):
    folder = nxt_folder(tmp_path, 1)
    (tmp_path / "INDEX.tsv").write_text(INDEX + "team/loc_00.dat\tcw\t90\t84\t30\tgood\n")
    (log,) = read_logs([folder / "loc_00.dat"])
    (scan,) = log.scans
    assert scan.headings_rad[1] == pytest.approx(-math.tau / 72)
    assert log.start.heading == pytest.approx(math.pi / 2)


def test_a_sensor_turned_by_hand_is_one_turn_with_each_measurement_once(tmp_path):
    rows = ["t_s,yaw_rad,pitch_rad,roll_rad,range_mm,acc_x,acc_y"]
    for i in range(800):  # clockwise, 20 readings a second, a new value four times a second
        yaw = math.remainder(0.01 * i, math.tau)
        rows.append(f"{0.05 * i:.3f},{yaw:.5f},0,0,{2000 + 10 * (i // 5)},0,0")
    (tmp_path / "room.csv").write_text("\n".join(rows))
    (log,) = read_logs([tmp_path / "room.csv"])
    (scan,) = log.scans
    assert (np.diff(scan.headings_rad) < 0.0).all()
    assert abs(scan.headings_rad[-1]) < math.tau
    assert len(set(scan.ranges_m)) == len(scan.ranges_m) == pytest.approx(0.01**-1 * math.tau / 5, abs=2)


def test_stretches_turn_at_least_so_far_and_do_not_overlap():
    rng = np.random.default_rng(0)
    headings = np.cumsum(rng.normal(0.0, 0.05, 500))
    stretches = turning_stretches(headings, 0.35)
    assert stretches
    for first, end in stretches:
        assert abs(headings[end - 1] - headings[first]) >= 0.35
    assert all(a[1] <= b[0] for a, b in pairwise(stretches))


def test_a_plane_heard_on_the_way_round_a_bend_is_found_where_it_is(tmp_path):
    """A robot turns on an arc beside a wall at y = 1.5 m; each sonar hears its foot near its own axis."""
    poses, ranges = [], []
    for i in range(60):
        heading = math.radians(1.0 * i)
        x, y = 0.8 * math.sin(heading), 0.8 * (1.0 - math.cos(heading))
        poses.append(f"{200 * i} {1000 * x:.1f} {1000 * y:.1f} {10 * math.degrees(heading):.1f}")
        bearings = np.radians([-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0])
        off = np.abs(wrap_angle(bearings + heading - math.pi / 2))
        ranges.append(" ".join([str(200 * i), *(str(1000 * (1.5 - y)) if o < 0.2 else "5110" for o in off)]))
    (tmp_path / "poses.txt").write_text("\n".join(poses))
    (tmp_path / "measurement.txt").write_text("\n".join(ranges))
    (log,) = read_logs([tmp_path / "poses.txt", tmp_path / "measurement.txt"])
    done = replay(log, "off")
    walls = [
        f.segment.transformed(u.pose) for u in done.updates for f in u.features if f.kind is FeatureKind.WALL
    ]
    assert walls
    for wall in walls:
        assert wall.midpoint[1] == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize(
    "name, text, said",
    [
        ("loc_00.dat", "1\n2\nx\n", "loc_00.dat"),
        ("loc_00.dat", "1\n", "1 readings"),
        ("loc_00.dat", "1\n2\nnan\n", "no measurement"),
        ("loc.dat", "1\n2\n3\n", "number"),
        ("room.csv", "a,b,c\n1,2,3\n", "t_s,yaw_rad"),
        ("room.csv", "t_s,yaw_rad,pitch_rad,roll_rad,range_mm\n1,2\n1,2\n1,2\n", "columns"),
        ("measurement.txt", "1 2 3\n", "9 numbers"),
        ("log.jsonl", "{}\n", "line 1"),
    ],
)
def test_a_bad_file_is_refused_by_its_name(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(SonarExploreError, match=said):
        read_logs([tmp_path / name])


@recorded
def test_every_recorded_layout_can_be_replayed():
    folder = Path(DATA or ".") / "sonar"
    files = [*folder.rglob("*.dat"), *folder.rglob("*.csv"), folder / "pioneer8" / "poses.txt"]
    logs = read_logs(sorted(files))
    assert len(logs) == 5 + 3 + 1
    for log in logs:
        done = replay(log)
        assert sum(len(update.features) for update in done.updates) > 0
