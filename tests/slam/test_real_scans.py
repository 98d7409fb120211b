# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The extractor on real rotating-sonar scans of a known arena; needs SONAR_EXPLORE_DATA.

The sensor (a hobby ultrasonic ranger) hears near planes over up to 90 degrees, three times the beam that the
defaults are made for, and the poses are fitted to the walls to a few centimetres and degrees. The shares
asserted lie a little below those measured.
"""

from __future__ import annotations

import csv
import math
import os
from pathlib import Path

import numpy as np
import pytest

from sonar_explore.geometry import Pose, Segment, wrap_undirected
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import FeatureConfig, FeatureKind, extract_features

DATA = os.environ.get("SONAR_EXPLORE_DATA")
FOLDER = Path(DATA or ".") / "sonar" / "imperial_nxt"
NO_ECHO_M = 2.55

pytestmark = pytest.mark.skipif(DATA is None, reason="SONAR_EXPLORE_DATA is not set: no real scans to read")


def index():
    with (FOLDER / "INDEX.tsv").open() as file:
        return list(csv.DictReader(file, delimiter="\t"))


def arena():
    lines = (FOLDER / "arena_walls_lab.txt").read_text().split()
    return [Segment(*(float(v) / 100 for v in line.strip("()").split(","))) for line in lines]


def read(row):
    """The scan, and the pose that was fitted to it."""
    lines = [line for line in (FOLDER / row["file"]).read_text().splitlines() if line.strip()]
    ranges = np.array([float(line.strip("() ").split(",")[0]) for line in lines[: int(row["n"])]]) / 100
    heard = (ranges > 0.0) & (ranges < 2.54)
    ranges = np.where(heard, ranges + float(row["range_bias_added_cm"]) / 100, NO_ECHO_M)
    spin = 1 if row["sense"] == "ccw" else -1
    headings = spin * np.arange(len(ranges)) * math.tau / len(ranges)
    heading = math.radians(float(row["start_heading_deg"]))
    pose = Pose(float(row["fit_x_cm"]) / 100, float(row["fit_y_cm"]) / 100, heading)
    return Scan(Pose(0, 0, 0), headings, ranges, Pose(0, 0, 0), NO_ECHO_M), pose


def on_a_true_wall(segment, wall, metres=0.10, degrees=10.0):
    x, y = segment.midpoint
    along = (x - wall.x1) * math.cos(wall.direction) + (y - wall.y1) * math.sin(wall.direction)
    reach = sorted(
        (0.0, (wall.x2 - wall.x1) * math.cos(wall.direction) + (wall.y2 - wall.y1) * math.sin(wall.direction))
    )
    return (
        abs(wall.signed_distance(x, y)) <= metres
        and abs(wrap_undirected(wall.direction - segment.direction)) <= math.radians(degrees)
        and reach[0] - metres <= along <= reach[1] + metres
    )


def judged(quality):
    """Whether each wall extracted from the scans of one quality lies on a true wall, scan by scan."""
    walls, answer = arena(), []
    for row in index():
        if row["quality"] == quality:
            scan, pose = read(row)
            found = [f for f in extract_features(scan, FeatureConfig()) if f.kind is FeatureKind.WALL]
            placed = [f.segment.transformed(pose) for f in found]
            answer.append([any(on_a_true_wall(s, wall) for wall in walls) for s in placed])
    return answer


def test_at_good_waypoints_most_walls_are_true():
    scans = judged("good")
    share = sum(map(sum, scans)) / sum(map(len, scans))
    assert share >= 0.55
    assert np.mean([sum(scan) for scan in scans]) >= 2.0  # enough for a position


def test_every_scan_can_be_read_and_gives_features():
    for row in index():
        assert extract_features(read(row)[0], FeatureConfig())


@pytest.mark.parametrize("spin", [1, -1])
def test_on_real_scans_too_neither_seam_nor_spin_matters(spin):
    for row in index()[1::5]:
        scan, _ = read(row)
        n = len(scan.ranges_m)
        turned = np.roll(scan.ranges_m, 17)[::spin]
        headings = scan.headings_rad[0] + np.sign(scan.headings_rad[1]) * spin * np.arange(n) * math.tau / n
        other = Scan(scan.pose_robot_in_odometry, headings, turned, scan.pose_sonar_in_robot, NO_ECHO_M)
        kept = [
            sorted(
                (f.kind, round(f.range_m, 6), round(f.width_rad, 6))
                for f in extract_features(s, FeatureConfig())
            )
            for s in (scan, other)
        ]
        assert kept[0] == kept[1]
