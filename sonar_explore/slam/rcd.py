"""Regions of constant depth: headings over which a sonar hears one thing (section II, READING section 4).

While a flat wall's normal lies inside the beam, the first echo comes from the foot of that normal,
whatever the heading: the depth is the perpendicular distance, and it stays constant for about a beam width.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonar_explore.compiled import inner_allocating_kernel, inner_kernel, kernel, lean_kernel
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array
from sonar_explore.measurement import Scan

LARGEST_GAP_STEPS = 2.0  # headings farther apart than this many usual steps do not follow one another
FAR_M = 1e9  # nothing is as far apart
SLACK_M = 1e-9  # ranges that are alike but for rounding
TIE_DECIMALS = 9  # spreads equal to a nanometre are a tie: the choice must not hang on the last bit


@dataclass(frozen=True, slots=True)
class Rcd:
    """One region of constant depth, counter-clockwise whichever way the robot turned."""

    readings: tuple[int, ...]
    """Indices into the scan's readings, counter-clockwise."""
    first_rad: float
    """Bearing of the beam at the first reading, in the robot frame at the start of the scan, [rad]."""
    last_rad: float
    """Bearing at the last reading, not less than `first_rad`, [rad]."""
    depth_m: float
    """Median perpendicular distance from the robot's centre, the middle bearing being the normal, [m]."""
    echo_m: float
    """Median distance from the sonar disc, [m]."""

    @property
    def bearing_rad(self) -> float:
        """Middle bearing: the direction of the wall's normal, [rad]."""
        return 0.5 * (self.first_rad + self.last_rad)

    @property
    def width_rad(self) -> float:
        """From the first to the last heading that heard it, [rad].

        This is never more than the angle over which the thing can be heard, and at most one scan step
        less on either side: in steps of 4 degrees a plane 2 m away (heard over 22.6 degrees) measures 16 or
        20 and a far edge (heard over 8.8) 4 or 8, so a limit of 10 degrees tells them apart.
        """
        return self.last_rad - self.first_rad


def check_scan(scan: Scan) -> None:
    """Raise a one-line error where a scan cannot be one."""
    headings, ranges = np.asarray(scan.headings_rad), np.asarray(scan.ranges_m)
    if headings.ndim != 1 or headings.shape != ranges.shape or headings.size < 3:
        raise SonarExploreError(
            f"a scan needs headings and ranges of one shape (n,), n >= 3; "
            f"got {headings.shape} and {ranges.shape}"
        )
    if not all_ranges(np.asarray(ranges, dtype=float)):
        raise SonarExploreError(
            "a scan's ranges must be finite and not negative; report range_max_m for no echo"
        )
    if not one_way_round(np.asarray(headings, dtype=float), scan.bearings_rad):
        raise SonarExploreError("a scan's headings must be finite and run one way round")
    odometry = scan.pose_robot_in_odometry
    if not all(map(math.isfinite, (odometry.x, odometry.y, odometry.heading))):
        raise SonarExploreError("a scan's odometry must be finite")


def compensated_ranges(scan: Scan) -> Array:
    """Each reading as a range from the robot's centre along its bearing, shape (n,), [m].

    A disc turns with the robot, so its lever along the beam is the same for all its readings.
    """
    x, y, heading = scan.discs.T
    along_beam = x * np.cos(heading) + y * np.sin(heading)
    return np.asarray(scan.ranges_m, dtype=float) + along_beam


def regions_of_constant_depth(scan: Scan, tolerance_m: float) -> tuple[Rcd, ...]:
    """All runs of two readings or more whose depths stay within `tolerance_m` of the run's median.

    The longest run is taken first (ties: the smaller spread, then the nearer) and its readings are used up.
    Measuring against the median, not from reading to reading, keeps a slow drift from chaining on for ever,
    and longest-first does not care where the scan began or which way it turned.
    """
    check_scan(scan)
    n = len(scan.headings_rad)
    rows, runs = np.empty((n, 4)), np.empty((n, 2), dtype=np.int64)
    count = regions(
        scan.bearings_rad,
        np.asarray(scan.ranges_m, dtype=float),
        *scan.levers,
        scan.range_max_m,
        tolerance_m,
        10.0**TIE_DECIMALS,
        rows,
        runs,
    )
    clockwise = bool(scan.bearings_rad[-1] < scan.bearings_rad[0])
    order = list(range(n - 1, -1, -1) if clockwise else range(n)) * 2
    found = [
        Rcd(tuple(order[start : start + length]), *row)
        for row, (start, length) in zip(rows[:count].tolist(), runs[:count].tolist(), strict=True)
    ]
    return tuple(sorted(found, key=lambda region: math.remainder(region.bearing_rad, math.tau)))


@lean_kernel
def all_ranges(ranges):  # type: ignore[no-untyped-def]
    """Whether all are finite and not negative."""
    fine = True
    for value in ranges:
        fine = fine and 0.0 <= value < np.inf
    return fine


@lean_kernel
def one_way_round(headings, bearings):  # type: ignore[no-untyped-def]
    """Whether all headings are finite, and the bearings rise or fall from reading to reading."""
    rising = falling = np.isfinite(headings[0])
    for i in range(1, len(headings)):
        step = bearings[i] - bearings[i - 1]
        rising = rising and step > 0.0 and np.isfinite(headings[i])
        falling = falling and step < 0.0 and np.isfinite(headings[i])
    return rising or falling


@inner_kernel
def nth(values, n):  # type: ignore[no-untyped-def]
    """The value that has n smaller ones before it (Hoare 1961); shuffles `values`."""
    low, high = 0, len(values) - 1
    while low < high:
        pivot, i, j = values[n], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if j < n:
            low = i
        if n < i:
            high = j
    return values[n]


@kernel
def regions(bearings, ranges, lever_m, lever_rad, range_max, tolerance, tie, rows, readings):  # type: ignore[no-untyped-def]
    """First and last bearing, depth and echo of each region into `rows`, its start and length into `readings`.

    The readings are put counter-clockwise, and written twice over so that no run ends at the seam; `joined` tells
    whether each and the next both heard something, one step apart. How many regions.
    """
    n = len(ranges)
    around, rising = np.empty((4, 2 * n)), bearings[0] < bearings[n - 1]
    for i in range(n):
        k = i if rising else n - 1 - i
        around[0, i], around[0, n + i] = bearings[k], bearings[k] + 2.0 * math.pi
        around[1, i], around[2, i], around[3, i] = ranges[k], lever_m[k], lever_rad[k]
        around[1, n + i], around[2, n + i], around[3, n + i] = ranges[k], lever_m[k], lever_rad[k]
    steps, joined = np.empty(2 * n - 1), np.empty(2 * n - 1, dtype=np.bool_)
    least, most = np.inf, 0.0
    for i in range(2 * n - 1):
        steps[i] = around[0, i + 1] - around[0, i]
        least, most = min(least, steps[i]), max(most, steps[i])
    # where none is too far from the least, none is from the median; they are odd in number
    usual = least if 0.0 < most <= LARGEST_GAP_STEPS * least else nth(steps.copy(), n - 1)
    for i in range(2 * n - 1):
        heard = around[1, i] < range_max and around[1, i + 1] < range_max
        joined[i] = heard and 0.0 < steps[i] <= LARGEST_GAP_STEPS * usual
    depths = np.empty((n, 2))
    count = _runs_longest_first(
        around[0], around[1], around[2], around[3], joined, tolerance, tie, readings, depths
    )
    for k in range(count):
        first, last = around[0, readings[k, 0]], around[0, readings[k, 0] + readings[k, 1] - 1]
        turns = 2.0 * math.pi * np.rint(0.5 * (first + last) / (2.0 * math.pi))
        rows[k, 0], rows[k, 1] = first - turns, last - turns
        rows[k, 2], rows[k, 3] = depths[k, 0], depths[k, 1]
    return count


@inner_kernel
def _depth(bearings, ranges, lever_m, lever_rad, start, length, k):  # type: ignore[no-untyped-def]
    """Perpendicular distance from the centre of reading k of a run, [m].

    A wall with normal bearing b is heard at range D - lever . normal: the disc's lever is added back
    along the run's middle bearing.
    """
    normal = 0.5 * (bearings[start] + bearings[start + length - 1])
    i = start + k
    return ranges[i] + lever_m[i] * math.cos(bearings[i] + lever_rad[i] - normal)


@inner_kernel
def _sorted_depths(bearings, ranges, lever_m, lever_rad, start, length, most, rising):  # type: ignore[no-untyped-def]
    """Depths of the readings of a run, rising, into `rising`; False where they are farther apart than `most`."""
    reading = length - 1  # the last one first: it is the one that the run before this did not have
    for k in range(length):
        depth = _depth(bearings, ranges, lever_m, lever_rad, start, length, reading)
        reading = k
        at = k
        while at > 0 and rising[at - 1] > depth:
            rising[at] = rising[at - 1]
            at -= 1
        rising[at] = depth
        if rising[k] - rising[0] > most:
            return False
    return True


@inner_kernel
def _middle(rising, length):  # type: ignore[no-untyped-def]
    return 0.5 * (rising[(length - 1) // 2] + rising[length // 2])


@inner_kernel
def _constant(bearings, ranges, lever_m, lever_rad, start, length, tolerance, tie, rising, run):  # type: ignore[no-untyped-def]
    """Whether a run is constant; its start, spread and median into `run`, these rounded, `tie` steps to the metre, and
    the median as it is."""
    most = 2.0 * tolerance + SLACK_M
    if not _sorted_depths(bearings, ranges, lever_m, lever_rad, start, length, most, rising):
        return False
    median = _middle(rising, length)
    spread = max(median - rising[0], rising[length - 1] - median)
    run[0], run[1], run[2] = start, np.rint(spread * tie) / tie, np.rint(median * tie) / tie
    run[3] = median
    return spread <= tolerance


@inner_kernel
def _lengthened(bearings, ranges, length, together, lever, low, high, tolerance, starts):  # type: ignore[no-untyped-def]
    """Lengthen the run from each start to this length: the starts of those that hang together and have ranges alike
    enough into `starts`, how many, and whether one of them is constant for sure.

    Ranges may differ by twice the tolerance and what the lever makes of it over the run: `lever` is that of the one
    disc [m], how fast it changes at the middle of a run [m/rad], and how much it can change in all [m].
    """
    count, narrowest, last = 0, np.inf, length - 1
    ahead, turned = ranges[last:], bearings[last:]
    metres, slope, in_all = lever[0], lever[1], lever[2]
    for start in range(len(low)):
        low[start] = min(low[start], ahead[start])
        high[start] = max(high[start], ahead[start])
        width = turned[start] - bearings[start]
        swing = min(in_all, metres * (slope + 0.5 * width) * width)
        apart = high[start] - low[start]
        may = together[start] >= length and apart <= 2.0 * tolerance + SLACK_M + swing
        starts[count] = start
        count += may
        narrowest = min(narrowest, apart + swing if may else np.inf)
    return count, narrowest <= tolerance - SLACK_M


@inner_kernel
def _levers(lever_m, lever_rad, lever):  # type: ignore[no-untyped-def]
    """What `_lengthened` wants to know of the levers of a scan, of one disc or of several."""
    longest, one_disc = lever_m[0], True
    for i in range(len(lever_m)):
        longest = max(longest, lever_m[i])
        one_disc = one_disc and lever_m[i] == lever_m[0] and lever_rad[i] == lever_rad[0]
    lever[0], lever[1], lever[2] = lever_m[0], abs(math.sin(lever_rad[0])), FAR_M
    if not one_disc:
        lever[0], lever[1], lever[2] = FAR_M, 1.0, 2.0 * longest


@inner_allocating_kernel
def _runs_longest_first(bearings, ranges, lever_m, lever_rad, joined, tolerance, tie, runs, depths):  # type: ignore[no-untyped-def]
    """Constant runs that share no reading: the longest first, then the flattest, then the nearest: how many.

    None is longer than the first length that no constant run has, less one. Their starts and lengths go into `runs`,
    the medians of their depths and of their ranges into `depths`.
    """
    n = len(ranges) // 2
    starts, many = np.empty((n + 1, n + 1), dtype=np.int64), np.zeros(n + 1, dtype=np.int64)
    low, high, together, lever = ranges[:n].copy(), ranges[:n].copy(), np.empty(n), np.empty(3)
    taken, found, rising = np.zeros(n, dtype=np.bool_), np.empty((n, 4)), np.empty(n)
    _levers(lever_m, lever_rad, lever)
    follow = 1
    for start in range(2 * n - 2, -1, -1):  # readings from each start on that follow one another
        follow = min(n, follow + 1) if joined[start] else 1
        if start < n:
            together[start] = follow
    longest, at = 1, 0
    for length in range(2, n + 1):
        many[length], some = _lengthened(
            bearings, ranges, length, together, lever, low, high, tolerance, starts[length]
        )
        for k in range(many[length]):
            if some:
                break
            start = starts[length, (at + k) % many[length]]
            if _constant(
                bearings, ranges, lever_m, lever_rad, start, length, tolerance, tie, rising, found[0]
            ):
                some, at = True, k
        if not some:
            break
        longest = length
    count = 0
    for length in range(longest, 1, -1):
        left = 0
        for k in range(many[length]):
            # No run taken so far is shorter than this one, so an overlap must cover one of its ends.
            start = starts[length, k]
            if not (taken[start] or taken[_around(start + length - 1, n)]):
                left += _constant(
                    bearings, ranges, lever_m, lever_rad, start, length, tolerance, tie, rising, found[left]
                )
        while True:
            best = -1
            for i in range(left):
                start = int(found[i, 0])
                if taken[start] or taken[_around(start + length - 1, n)]:
                    continue
                flatter = best < 0 or found[i, 1] < found[best, 1]
                if flatter or (found[i, 1] == found[best, 1] and found[i, 2] < found[best, 2]):
                    best = i
            if best < 0:
                break
            start = int(found[best, 0])
            for k in range(length):
                taken[_around(start + k, n)] = True
            runs[count, 0], runs[count, 1] = start, length
            depths[count, 0] = found[best, 3]
            depths[count, 1] = _median(ranges[start : start + length], rising)
            count += 1
    return count


@inner_kernel
def _around(i, n):  # type: ignore[no-untyped-def]
    """i modulo n, for i < 2 n."""
    return i - n if i >= n else i


@inner_kernel
def _median(values, rising):  # type: ignore[no-untyped-def]
    """Of a few numbers, which are sorted into `rising`."""
    for k in range(len(values)):
        at = k
        while at > 0 and rising[at - 1] > values[k]:
            rising[at] = rising[at - 1]
            at -= 1
        rising[at] = values[k]
    return _middle(rising, len(values))
