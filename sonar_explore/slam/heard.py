"""What passes for a wall with each of several discs, in one kernel: the arithmetic of `features`, without the objects.

`features.extract_features` is the readable form; the tests compare the walls of both to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array
from sonar_explore.measurement import Scan
from sonar_explore.slam.ends import SLACK_RAD
from sonar_explore.slam.features import ANGLE_SLACK_RAD, ASIDE_M, FeatureConfig
from sonar_explore.slam.rcd import TIE_DECIMALS, all_ranges, check_scan, nth, one_way_round, regions

FIRST, LAST, DEPTH, ECHO = range(4)  # columns of a region
BEARING, RANGE, SWEEP, WIDTH = range(4)  # columns of a wall


def walls_heard(scans: Sequence[Scan], config: FeatureConfig) -> list[Array]:
    """Walls that each disc heard, by bearing: bearing [rad], range [m], how far the robot had turned [rad], width
    [rad]; shape (n, 4) each."""
    limits = _limits(config)
    return [_walls_of(scan, limits) for scan in scans]


def _walls_of(scan: Scan, limits: Array) -> Array:
    ranges, headings = np.asarray(scan.ranges_m, dtype=float), np.asarray(scan.headings_rad, dtype=float)
    if headings.ndim != 1 or headings.shape != ranges.shape or headings.size < 3:
        check_scan(scan)
    walls = np.empty((len(ranges), 4))
    count = _walls(scan.bearings_rad, headings, ranges, *scan.levers, scan.range_max_m, limits, walls)
    if count < 0:
        check_scan(scan)
    return walls[:count]


@lru_cache(maxsize=4)
def _limits(config: FeatureConfig) -> Array:
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
        ],
        dtype=float,
    )


@kernel
def _walls(bearings, headings, ranges, lever_m, lever_rad, range_max, limits, walls):  # type: ignore[no-untyped-def]
    """Walls of one disc into `walls`: how many; -1 for what is no scan."""
    n = len(ranges)
    if not all_ranges(ranges) or not one_way_round(headings, bearings):
        return -1
    rows, runs = np.empty((n, 4)), np.empty((n, 2), dtype=np.int64)
    count = regions(bearings, ranges, lever_m, lever_rad, range_max, limits[0], limits[1], rows, runs)
    kept = np.int64(0)  # a plain 0 is a constant: what it is handed to would be compiled twice
    for k in range(count):
        wide = rows[k, LAST] - rows[k, FIRST] >= limits[4]
        if limits[2] <= rows[k, ECHO] <= limits[3] and wide:
            _move(rows, runs, k, kept)
            kept += 1
    plateau = np.empty(kept, dtype=np.bool_)
    for k in range(kept):
        plateau[k] = _is_plateau(rows, runs, k, kept, n, limits)
    count = np.int64(0)
    step = _usual_step(bearings)
    for k in range(kept):
        if plateau[k] and _like_a_plane(rows, runs, k, bearings, ranges, step, limits):
            _move(rows, runs, k, count)
            count += 1
    found = 0
    for k in range(count):
        if not _is_corner(rows, k, count, limits):
            bearing = 0.5 * (rows[k, FIRST] + rows[k, LAST])
            at = found
            bearing = _wrapped(bearing)
            while at > 0 and walls[at - 1, BEARING] > bearing:
                for column in range(4):
                    walls[at, column] = walls[at - 1, column]
                at -= 1
            walls[at, BEARING], walls[at, RANGE] = bearing, rows[k, DEPTH]
            walls[at, SWEEP] = _mean(headings, bearings, runs[k, 0], runs[k, 1])
            walls[at, WIDTH] = rows[k, LAST] - rows[k, FIRST]
            found += 1
    return found


@inner_kernel
def _move(rows, runs, k, to):  # type: ignore[no-untyped-def]
    for column in range(4):
        rows[to, column] = rows[k, column]
    runs[to, 0], runs[to, 1] = runs[k, 0], runs[k, 1]


@inner_kernel
def _wrapped(angle):  # type: ignore[no-untyped-def]
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@kernel
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
def _is_plateau(rows, runs, k, count, n, limits):  # type: ignore[no-untyped-def]
    """`features._is_plateau`."""
    if rows[k, LAST] - rows[k, FIRST] > limits[5]:
        return False
    before, after = (runs[k, 0] - 1) % n, (runs[k, 0] + runs[k, 1]) % n
    for other in range(count):
        ends, begins = (runs[other, 0] + runs[other, 1] - 1) % n, runs[other, 0] % n
        if (ends == before or begins == after) and 0.0 < rows[k, DEPTH] - rows[other, DEPTH] < limits[6]:
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
def _is_corner(rows, k, count, limits):  # type: ignore[no-untyped-def]
    """`features._is_corner`."""
    depth, bearing = rows[k, DEPTH], 0.5 * (rows[k, FIRST] + rows[k, LAST])
    for i in range(count):
        first, first_bearing = rows[i, DEPTH], 0.5 * (rows[i, FIRST] + rows[i, LAST])
        if not first < depth:
            continue
        apart = bearing - first_bearing
        off = abs(depth * math.cos(apart) - first)
        aside = depth * abs(math.sin(apart))
        if limits[11] and math.cos(apart) > 0.0 and aside > ASIDE_M and off <= limits[12]:
            return True
        for j in range(count):
            second, second_bearing = rows[j, DEPTH], 0.5 * (rows[j, FIRST] + rows[j, LAST])
            if not second < depth:
                continue
            if abs(_wrapped(second_bearing - first_bearing) - math.pi / 2) > limits[13]:
                continue
            meets = first_bearing + math.atan2(second, first)
            far = abs(math.hypot(first, second) - depth)
            if far <= limits[14] and abs(_wrapped(bearing - meets)) <= limits[15]:
                return True
    return False
