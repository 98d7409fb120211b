# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The kernel that finds walls, corners and edges says what the readable form says, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.load import load_world
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import FeatureConfig, FeatureKind, extract_features
from sonar_explore.slam.turn.heard import CORNER, DISC, EDGE, KIND, LENGTH, START, WALL, heard_by_discs
from sonar_explore.slam.turn.points import PointConfig

ROBOT = AmigoBot()
CONFIGS = [
    FeatureConfig(),
    FeatureConfig(beam_check=True),
    FeatureConfig(beam_check=True, beam_bearing=True, corner_on_wall=True),
]


KINDS = {FeatureKind.WALL: WALL, FeatureKind.CORNER: CORNER, FeatureKind.EDGE: EDGE}


def plainly(scan, config):
    """What the readable form finds: walls of every disc, corners and edges of the first."""
    for disc, one in enumerate((scan, *scan.others)):
        for f in extract_features(replace(one, others=()), config):
            if disc == 0 or f.kind is FeatureKind.WALL:
                yield (disc, KINDS[f.kind], f.bearing_rad, f.range_m, f.sweep_rad, f.width_rad, f.readings)


def found(scan, config):
    heard = heard_by_discs(scan, config, PointConfig())
    for row in [*heard.walls.tolist(), *heard.others.tolist()]:
        one, n = (scan, *scan.others)[int(row[DISC])], len(scan.ranges_m)
        way = -1 if one.bearings_rad[-1] < one.bearings_rad[0] else 1
        first = int(row[START]) if way > 0 else n - 1 - int(row[START])
        readings = tuple((first + way * k) % n for k in range(int(row[LENGTH])))
        yield (int(row[DISC]), int(row[KIND]), *row[:4], readings)


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("world", ["paper/rooms", "paper/bend", "generated/home-3"])
def test_in_simulated_rooms(world, config):
    places = load_world(world)
    count = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        start = replace(places.start, heading=rng.uniform(-7, 7))
        robot = Simulator(replace(places, start=start), SimulatorConfig(), rng)
        scan = robot.scan(1 if seed % 2 else -1)
        heard = sorted(found(scan, config))
        assert heard == sorted(plainly(scan, config))
        count += len(heard)
    assert count > 100


@settings(deadline=None, max_examples=60)
@given(st.integers(3, 120), st.sampled_from([1, -1]), st.sampled_from(CONFIGS), st.integers(0, 2**32 - 1))
def test_in_whatever_is_heard(n, spin, config, seed):
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(0.1, 2.5, n), rng.integers(1, 12, n))[:n]
    ranges = np.where(rng.random(n) < 0.1, 5.0, steps + rng.normal(0, 0.01, n))
    headings = spin * np.arange(n) * 2 * np.pi / n * rng.uniform(0.97, 1.03)
    scan = Scan(Pose(0.0, 0.0, 0.0), headings, np.abs(ranges), ROBOT.sonars[seed % 8], 5.0)
    assert sorted(found(scan, config)) == sorted(plainly(scan, config))


@pytest.mark.parametrize(
    ("headings", "ranges"),
    [([0.0, 1.0], [1.0, 1.0]), ([0.0, 1.0, 2.0], [1.0, np.nan, 1.0]), ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0])],
)
def test_what_is_no_scan_is_refused(headings, ranges):
    scan = Scan(Pose(0.0, 0.0, 0.0), np.array(headings), np.array(ranges), ROBOT.sonars[0], 5.0)
    with pytest.raises(SonarExploreError, match="a scan"):
        heard_by_discs(scan, CONFIGS[0], PointConfig())
