# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""A loop is open until the way has gone all round the block, and then it is not."""

import math
from typing import Any

import numpy as np
import pytest

from sonar_explore.mapping.grid import FREE, GridFrame
from sonar_explore.planning.loops import OVERLAP_RAD, blocks_of, open_loops, went_round

SIDE, MIDDLE = 8.0, (4.0, 4.0)


class Map:
    """A square hall about a square block; what open_loops asks of a grid."""

    def __init__(self, block_m):
        self.frame = GridFrame(0.0, 0.0, 0.05, (160, 160))
        x = (np.arange(160) + 0.5) * 0.05
        off = np.maximum(np.abs(x[None, :] - MIDDLE[0]), np.abs(x[:, None] - MIDDLE[1]))
        states = np.where((off < 3.8) & (off > 0.5 * block_m), FREE, 0)
        self.free = states == FREE


def hall(block_m) -> Any:
    return Map(block_m)


def way(first_deg, last_deg, radius=2.8):
    """Along a circle about the block, a scan every tenth point."""
    angle = np.radians(np.arange(first_deg, last_deg + 1e-9, 2.0))
    trail = np.column_stack([MIDDLE[0] + radius * np.cos(angle), MIDDLE[1] + radius * np.sin(angle)])
    return trail, np.arange(0, len(trail), 10)


def found(driven, grid):
    trail, scans = driven
    return open_loops(trail, scans, grid)


@pytest.mark.parametrize("driven_deg", [230, 300, 350, 362])
def test_a_loop_of_which_the_last_stretch_is_missing_is_closed_by_driving_that_stretch(driven_deg):
    trail, scans = way(0, driven_deg)
    (loop,) = open_loops(trail, scans, hall(3.0))
    assert (loop.x, loop.y) == pytest.approx(MIDDLE, abs=0.05)
    on, _ = way(driven_deg, 360 + math.degrees(OVERLAP_RAD))
    back, _ = way(0, driven_deg)
    assert loop.closed_by(on), "through the gap"
    assert not loop.closed_by(back[::-1]), "back the way it came"
    assert not found(way(0, 360 + math.degrees(OVERLAP_RAD) + 2), hall(3.0))


def test_the_goals_are_scan_positions_a_little_inside_either_end():
    trail, scans = way(0, 300)
    (loop,) = open_loops(trail, scans, hall(3.0))
    for goal, end in zip(loop.goals, (0.0, 300.0), strict=True):
        assert any(np.array_equal(goal, trail[k]) for k in scans)
        bearing = math.degrees(math.atan2(goal[1] - MIDDLE[1], goal[0] - MIDDLE[0])) % 360.0
        assert 9.0 <= abs(bearing - end) <= 31.0


def test_a_pillar_is_no_loop_and_a_loop_hardly_begun_is_left_alone():
    assert not found(way(0, 300), hall(0.9))
    assert not found(way(0, 200), hall(3.0))


def test_a_way_has_gone_round_from_where_it_crosses_its_own_beginning_and_not_before():
    assert went_round(way(0, 358)[0], [MIDDLE]) is None
    trail, _ = way(20, 420)
    at = went_round(trail, blocks_of(hall(3.0)))
    assert at is not None
    assert math.degrees(math.atan2(*(trail[at] - MIDDLE)[::-1])) == pytest.approx(20, abs=2.5)
    assert went_round(trail, blocks_of(hall(0.9))) is None
    there_and_back = np.vstack([trail[:100], trail[:100][::-1], trail[:100]])
    assert went_round(there_and_back, [MIDDLE]) is None
