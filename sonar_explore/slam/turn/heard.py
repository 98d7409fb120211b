"""What the discs of one turn heard, all of them in one kernel: the arithmetic of `features`, without the objects.

`features.extract_features` is the readable form; the tests compare what both find to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_allocating_kernel, inner_kernel, kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.ends import SLACK_RAD
from sonar_explore.slam.features import ANGLE_SLACK_RAD, ASIDE_M, FeatureConfig
from sonar_explore.slam.rcd import TIE_DECIMALS, all_ranges, check_scan, nth, one_way_round, regions
from sonar_explore.slam.turn.discs import aside
from sonar_explore.slam.turn.points import PointConfig, in_front

FIRST, LAST, DEPTH, ECHO = range(4)  # columns of a region
BEARING, RANGE, SWEEP, WIDTH, ASIDE, DISC, KIND, START, LENGTH = range(9)  # columns of what is heard
WALL, CORNER, EDGE = range(3)


@dataclass(frozen=True, eq=False)
class Heard:
    """What each disc heard, row by row, the discs in order; the scan's own is number 0.

    Columns: bearing of the normal [rad], range [m], how far the robot had turned [rad], width [rad], how far the axis
    of the disc passes from the turning axis [m], number of the disc, kind, and where its readings begin,
    counter-clockwise, and how many they are.
    """

    walls: Array
    """Of every disc, by bearing, shape (n, 9)."""
    others: Array
    """Corners and edges that the scan's own disc heard, shape (m, 9)."""
    in_front: Array
    """What each disc heard in front of all beside it, shape (k, 7): see `points.in_front`."""


def heard_by_discs(scan: Scan, config: FeatureConfig, points: PointConfig, turn_error: float = 0.0) -> Heard:
    """What the disc of the scan and the others heard; the robot turned by so much more than it counted, relative."""
    scans = (scan, *scan.others)
    headings_rad, ranges_m = [disc.headings_rad for disc in scans], [disc.ranges_m for disc in scans]
    counts = tuple(map(len, ranges_m))
    if min(counts) < 3 or tuple(map(len, headings_rad)) != counts:
        _complain(scans)
    reach = tuple([disc.range_max_m for disc in scans])
    levers, mounts, ends = _mounted(tuple([disc.pose_sonar_in_robot for disc in scans]), counts, reach)
    if any(disc.ring is not None for disc in scans):
        levers = np.concatenate([[*disc.levers, disc.discs[:, 2]] for disc in scans], axis=1)
    headings = np.concatenate(headings_rad) * (1.0 + turn_error)
    ranges = np.concatenate(ranges_m, dtype=float)
    if headings.ndim != 1 or ranges.ndim != 1:
        _complain(scans)
    size = len(ranges)
    walls, others, found = np.empty((size, 9)), np.empty((counts[0], 9)), np.empty((size, 7))
    sizes = np.empty(3, dtype=np.int64)
    if not _hear(
        headings, ranges, levers, ends, mounts, _limits(config, points), walls, others, found, sizes
    ):
        _complain(scans)
    n, m, k = sizes.tolist()
    return Heard(walls[:n], others[:m], found[:k])


def _complain(scans: Sequence[Scan]) -> None:
    """Say what is wrong with the first scan that is none."""
    for disc in scans:
        check_scan(disc)


@lru_cache(maxsize=4)
def _mounted(
    mounts: tuple[Pose, ...], counts: tuple[int, ...], reach: tuple[float, ...]
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Lever of each reading, its direction and that of the beam, shape (3, n); x y heading aside, and the largest
    range, of each disc; where its readings end."""
    discs = np.array([(m.x, m.y, m.heading, aside(m), far) for m, far in zip(mounts, reach, strict=True)])
    x, y, heading = discs[:, :3].T
    levers = np.repeat([np.hypot(x, y), np.arctan2(y, x) - heading, heading], counts, axis=1)
    return levers, discs, np.cumsum(counts)


@lru_cache(maxsize=4)
def _limits(config: FeatureConfig, points: PointConfig) -> Array:
    """What passes for what, as the kernel takes it."""
    beam = config.beam
    return np.array(
        [
            config.tolerance_m,
            10.0**TIE_DECIMALS,
            config.range_min_m,
            config.range_max_m,
            config.width_min_rad - ANGLE_SLACK_RAD,
            config.run_max_beams * config.beam_rad + ANGLE_SLACK_RAD,
            config.jump_m,
            config.beam_check,
            config.beam_bearing,
            beam.s_rad,
            beam.threshold,
            config.corner_on_wall,
            config.corner_on_wall_m,
            config.corner_right_angle_rad,
            config.corner_range_m,
            config.corner_bearing_rad,
            config.edge_width_min_rad - ANGLE_SLACK_RAD,
            points.width_min_rad,
            points.width_max_rad,
            points.in_front_m,
        ],
        dtype=float,
    )


@kernel
def _hear(headings, ranges, levers, ends, mounts, limits, walls, others, found, sizes):  # type: ignore[no-untyped-def]
    """Walls, the first disc's other features, what is in front, and how many they are; False for what is no scan."""
    sizes[0] = sizes[1] = sizes[2] = 0
    begin = np.int64(0)  # a plain 0 is a constant: what it is handed to would be compiled twice
    for disc in range(len(ends)):
        end = ends[disc]
        heading, ping = headings[begin:end], ranges[begin:end]
        n, bearings = len(ping), np.empty(len(ping))
        for i in range(n):
            bearings[i] = heading[i] + levers[2, begin + i]
        if not all_ranges(ping) or not one_way_round(heading, bearings):
            return False
        rows, runs, kinds = np.empty((n, 4)), np.empty((n, 2), dtype=np.int64), np.empty(n, dtype=np.int64)
        lever_m, lever_rad = levers[0][begin:end], levers[1][begin:end]
        count = regions(bearings, ping, lever_m, lever_rad, mounts[disc, 4], limits[0], limits[1], rows, runs)
        sizes[2] = in_front(
            bearings, heading, ping, rows, runs, count, disc, mounts[disc], limits, found, sizes[2]
        )
        _classify(rows, runs, kinds, count, bearings, ping, limits)
        first = sizes[0]
        for k in range(count):
            if kinds[k] == WALL:
                _note(walls, first, sizes[0], rows, runs, k, kinds[k], heading, bearings, disc, mounts)
                sizes[0] += 1
            elif kinds[k] >= 0 and disc == 0:
                _note(others, sizes[1], sizes[1], rows, runs, k, kinds[k], heading, bearings, disc, mounts)
                sizes[1] += 1
        begin = end
    return True


@inner_kernel
def _note(out, first, at, rows, runs, k, kind, headings, bearings, disc, mounts):  # type: ignore[no-untyped-def]
    """What region k is heard as, among the rows from `first` to `at`, by bearing."""
    bearing = wrapped(0.5 * (rows[k, FIRST] + rows[k, LAST]))
    while at > first and out[at - 1, BEARING] > bearing:
        for column in range(9):
            out[at, column] = out[at - 1, column]
        at -= 1
    out[at, BEARING], out[at, RANGE] = bearing, rows[k, DEPTH]
    out[at, SWEEP] = _mean(headings, bearings, runs[k, 0], runs[k, 1])
    out[at, WIDTH] = rows[k, LAST] - rows[k, FIRST]
    out[at, ASIDE], out[at, DISC], out[at, KIND] = mounts[disc, 3], disc, kind
    out[at, START], out[at, LENGTH] = runs[k, 0], runs[k, 1]


@inner_allocating_kernel
def _classify(rows, runs, kinds, count, bearings, ranges, limits):  # type: ignore[no-untyped-def]
    """What each region is heard as, -1 for nothing; ends that something hides are put where they would be."""
    n, step = len(ranges), _usual_step(bearings)
    heard, wide = np.empty(count, dtype=np.bool_), np.empty(count, dtype=np.bool_)
    plateau = np.empty(count, dtype=np.bool_)
    for k in range(count):
        heard[k] = limits[2] <= rows[k, ECHO] <= limits[3]
        wide[k] = heard[k] and rows[k, LAST] - rows[k, FIRST] >= limits[4]
    for k in range(count):
        plateau[k] = wide[k] and _is_plateau(rows, runs, k, wide, n, limits)
    for k in range(count):
        plateau[k] = plateau[k] and _like_a_plane(rows, runs, k, bearings, ranges, step, limits)
    for k in range(count):
        kinds[k] = -1
        if plateau[k]:
            kinds[k] = CORNER if _is_corner(rows, k, plateau, limits) else WALL
        elif heard[k] and _is_edge(rows, runs, k, bearings, ranges, limits):
            kinds[k] = EDGE


@inner_kernel
def _is_edge(rows, runs, k, bearings, ranges, limits):  # type: ignore[no-untyped-def]
    """`features._is_edge`."""
    if rows[k, LAST] - rows[k, FIRST] < limits[16]:
        return False
    before = ranges[_reading(bearings, runs[k, 0] - 1 + len(ranges))]
    after = ranges[_reading(bearings, runs[k, 0] + runs[k, 1])]
    return max(before, after) - rows[k, ECHO] >= limits[6]


@inner_kernel
def wrapped(angle):  # type: ignore[no-untyped-def]
    """`geometry.wrap_angle`."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@kernel
def full_turn(headings, bearings):  # type: ignore[no-untyped-def]
    """The turn of a scan, signed: one usual step more than from its first reading to its last."""
    reached = headings[0]
    for heading in headings:
        if abs(heading) > abs(reached):
            reached = heading
    return reached + math.copysign(_usual_step(bearings), reached)


@inner_allocating_kernel
def _usual_step(bearings):  # type: ignore[no-untyped-def]
    """Median of the angles between two readings."""
    n = len(bearings) - 1
    steps = np.empty(n)
    for i in range(n):
        steps[i] = abs(bearings[i + 1] - bearings[i])
    upper = nth(steps, n // 2)
    return upper if n % 2 else 0.5 * (nth(steps, n // 2 - 1) + upper)


@inner_kernel
def _reading(bearings, i):  # type: ignore[no-untyped-def]
    """Index of the i-th reading counter-clockwise."""
    n = len(bearings)
    return n - 1 - i % n if bearings[n - 1] < bearings[0] else i % n


@inner_kernel
def _mean(headings, bearings, start, length):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(start, start + length):
        total += headings[_reading(bearings, i)]
    return total / length


@inner_kernel
def _is_plateau(rows, runs, k, wide, n, limits):  # type: ignore[no-untyped-def]
    """`features._is_plateau`."""
    if rows[k, LAST] - rows[k, FIRST] > limits[5]:
        return False
    before, after = (runs[k, 0] - 1) % n, (runs[k, 0] + runs[k, 1]) % n
    for other in range(len(wide)):
        if wide[other] and 0.0 < rows[k, DEPTH] - rows[other, DEPTH] < limits[6]:
            ends, begins = (runs[other, 0] + runs[other, 1] - 1) % n, runs[other, 0] % n
            if ends == before or begins == after:
                return False
    return True


@inner_kernel
def _like_a_plane(rows, runs, k, bearings, ranges, step, limits):  # type: ignore[no-untyped-def]
    """`Ends.like_a_plane`, then `Ends.centred` on the row, each where it is asked for."""
    row = rows[k]
    first, last = _reading(bearings, runs[k, 0]), _reading(bearings, runs[k, 0] + runs[k, 1] - 1)
    before = _reading(bearings, runs[k, 0] - 1 + len(bearings))
    after = _reading(bearings, runs[k, 0] + runs[k, 1])
    nearer = row[ECHO] - limits[6]
    first_hidden, last_hidden = ranges[before] < nearer, ranges[after] < nearer
    on_axis = 1.0 / max(row[ECHO], 0.05)
    full = 2.0 * (limits[9] * math.sqrt(max(0.0, math.log(on_axis / limits[10]))))
    if limits[7]:
        width = row[LAST] - row[FIRST]
        if width > full + SLACK_RAD:
            return False
        if first_hidden or last_hidden:
            if not width >= 0.5 * full - step:
                return False
        else:
            turn = 2.0 * math.pi
            room = (bearings[first] - bearings[before]) % turn + (bearings[after] - bearings[last]) % turn
            if not width > full - room - SLACK_RAD:
                return False
    if limits[8] and first_hidden != last_hidden:
        if first_hidden:
            row[FIRST] = row[LAST] - (full - step)
        else:
            row[LAST] = row[FIRST] + (full - step)
    return True


@inner_kernel
def _is_corner(rows, k, plateau, limits):  # type: ignore[no-untyped-def]
    """`features._is_corner`."""
    depth, bearing = rows[k, DEPTH], 0.5 * (rows[k, FIRST] + rows[k, LAST])
    for i in range(len(plateau)):
        first, first_bearing = rows[i, DEPTH], 0.5 * (rows[i, FIRST] + rows[i, LAST])
        if not (plateau[i] and first < depth):
            continue
        apart = bearing - first_bearing
        off = abs(depth * math.cos(apart) - first)
        aside = depth * abs(math.sin(apart))
        if limits[11] and math.cos(apart) > 0.0 and aside > ASIDE_M and off <= limits[12]:
            return True
        for j in range(len(plateau)):
            second, second_bearing = rows[j, DEPTH], 0.5 * (rows[j, FIRST] + rows[j, LAST])
            if not (plateau[j] and second < depth):
                continue
            if abs(wrapped(second_bearing - first_bearing) - math.pi / 2) > limits[13]:
                continue
            meets = first_bearing + math.atan2(second, first)
            far = abs(math.hypot(first, second) - depth)
            if far <= limits[14] and abs(wrapped(bearing - meets)) <= limits[15]:
                return True
    return False
