"""Regions of constant depth: headings over which a sonar hears one thing (section II, READING section 4).

While a flat wall's normal lies inside the beam, the first echo comes from the foot of that normal,
whatever the heading: the depth is the perpendicular distance, and it stays constant for about a beam width.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array
from sonar_explore.measurement import Scan

LARGEST_GAP_STEPS = 2.0  # headings farther apart than this many usual steps do not follow one another
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


@dataclass(frozen=True, eq=False)
class _Sweep:
    """A scan's readings put counter-clockwise, written twice over so that no run ends at the seam."""

    order: NDArray[np.intp]
    """Index into the scan's readings, shape (2 n,)."""
    bearings: Array
    """Direction of the beam in the robot frame, rising, shape (2 n,), [rad]."""
    ranges: Array
    """From the disc, shape (2 n,), [m]."""
    joined: NDArray[np.bool_]
    """Whether each reading and the next both heard something, one step apart, shape (2 n - 1,)."""
    lever_m: Array
    """Distance of each reading's disc from the robot's centre, shape (2 n,), [m]."""
    lever_rad: Array
    """Direction of that lever, relative to the beam, shape (2 n,), [rad]."""


def check_scan(scan: Scan) -> None:
    """Raise a one-line error where a scan cannot be one."""
    headings, ranges = np.asarray(scan.headings_rad), np.asarray(scan.ranges_m)
    if headings.ndim != 1 or headings.shape != ranges.shape or headings.size < 3:
        raise SonarExploreError(
            f"a scan needs headings and ranges of one shape (n,), n >= 3; "
            f"got {headings.shape} and {ranges.shape}"
        )
    if not np.isfinite(ranges).all() or (ranges < 0.0).any():
        raise SonarExploreError(
            "a scan's ranges must be finite and not negative; report range_max_m for no echo"
        )
    steps = np.diff(scan.bearings_rad)
    if not np.isfinite(headings).all() or not ((steps > 0.0).all() or (steps < 0.0).all()):
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
    sweep = _sweep(scan)
    n = len(sweep.order) // 2
    runs, depths = np.empty((n, 2), dtype=np.int64), np.empty((n, 2))
    count = _runs_longest_first(
        sweep.bearings,
        sweep.ranges,
        sweep.lever_m,
        sweep.lever_rad,
        sweep.joined,
        tolerance_m,
        10.0**TIE_DECIMALS,
        runs,
        depths,
    )
    regions = _regions(sweep, runs[:count].tolist(), depths[:count].tolist())
    return tuple(sorted(regions, key=lambda region: math.remainder(region.bearing_rad, math.tau)))


def _sweep(scan: Scan) -> _Sweep:
    order = np.arange(len(scan.headings_rad))
    if scan.bearings_rad[-1] < scan.bearings_rad[0]:
        order = order[::-1]
    once = scan.bearings_rad[order]
    x, y, heading = np.tile(scan.discs[order].T, 2)
    bearings = np.concatenate([once, once + math.tau])
    ranges = np.tile(np.asarray(scan.ranges_m, dtype=float)[order], 2)
    steps, heard = np.diff(bearings), ranges < scan.range_max_m
    close = (steps > 0.0) & (steps <= LARGEST_GAP_STEPS * np.median(steps))
    return _Sweep(
        order=np.tile(order, 2),
        bearings=bearings,
        ranges=ranges,
        joined=close & heard[:-1] & heard[1:],
        lever_m=np.hypot(x, y),
        lever_rad=np.arctan2(y, x) - heading,
    )


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
def _sorted_depths(bearings, ranges, lever_m, lever_rad, start, length, rising):  # type: ignore[no-untyped-def]
    """Depths of the readings of a run, rising, into `rising`."""
    for k in range(length):
        depth = _depth(bearings, ranges, lever_m, lever_rad, start, length, k)
        at = k
        while at > 0 and rising[at - 1] > depth:
            rising[at] = rising[at - 1]
            at -= 1
        rising[at] = depth


@inner_kernel
def _middle(rising, length):  # type: ignore[no-untyped-def]
    return 0.5 * (rising[(length - 1) // 2] + rising[length // 2])


@kernel
def _constant_runs(bearings, ranges, lever_m, lever_rad, joined, tolerance, tie, rows):  # type: ignore[no-untyped-def]
    """(start, length, spread, median) of each constant run, the shortest first, into `rows`: how many.

    Ends at a length that none has; spreads and medians are rounded, `tie` steps to the metre.
    """
    n = len(ranges) // 2
    together = np.empty(n, dtype=np.int64)  # readings from each start on that follow one another
    for start in range(n):
        k = 1
        while k < n and joined[start + k - 1]:
            k += 1
        together[start] = k
    rising = np.empty(n)
    count = 0
    for length in range(2, n + 1):
        before = count
        for start in range(n):
            if together[start] < length:
                continue
            _sorted_depths(bearings, ranges, lever_m, lever_rad, start, length, rising)
            median = _middle(rising, length)
            spread = max(median - rising[0], rising[length - 1] - median)
            if spread <= tolerance:
                rows[count, 0], rows[count, 1] = start, length
                rows[count, 2], rows[count, 3] = np.rint(spread * tie) / tie, np.rint(median * tie) / tie
                count += 1
        if count == before:
            break
    return count


@kernel
def _runs_longest_first(bearings, ranges, lever_m, lever_rad, joined, tolerance, tie, runs, depths):  # type: ignore[no-untyped-def]
    """Constant runs that share no reading: the longest first, then the flattest, then the nearest: how many.

    Their starts and lengths go into `runs`, the medians of their depths and of their ranges into `depths`.
    """
    n = len(ranges) // 2
    rows = np.empty((n * n, 4))
    left = _constant_runs(bearings, ranges, lever_m, lever_rad, joined, tolerance, tie, rows)
    taken = np.zeros(n, dtype=np.bool_)
    rising = np.empty(n)
    count = 0
    while left > 0:
        length = int(rows[left - 1, 1])
        first = left
        while first > 0 and rows[first - 1, 1] == length:
            first -= 1
        while True:
            best = -1
            for i in range(first, left):
                start = int(rows[i, 0])
                # No run taken so far is shorter than this one, so an overlap must cover one of its ends.
                if taken[start] or taken[(start + length - 1) % n]:
                    continue
                flatter = best < 0 or rows[i, 2] < rows[best, 2]
                if flatter or (rows[i, 2] == rows[best, 2] and rows[i, 3] < rows[best, 3]):
                    best = i
            if best < 0:
                break
            start = int(rows[best, 0])
            for k in range(length):
                taken[(start + k) % n] = True
            runs[count, 0], runs[count, 1] = start, length
            _sorted_depths(bearings, ranges, lever_m, lever_rad, start, length, rising)
            depths[count, 0] = _middle(rising, length)
            for k in range(length):
                echo = ranges[start + k]
                at = k
                while at > 0 and rising[at - 1] > echo:
                    rising[at] = rising[at - 1]
                    at -= 1
                rising[at] = echo
            depths[count, 1] = _middle(rising, length)
            count += 1
        left = first
    return count


def _regions(sweep: _Sweep, runs: list[list[int]], depths: list[list[float]]) -> list[Rcd]:
    bearings, order = sweep.bearings.tolist(), sweep.order.tolist()
    regions = []
    for (start, length), (depth, echo) in zip(runs, depths, strict=True):
        first, last = bearings[start], bearings[start + length - 1]
        turns = math.tau * round(0.5 * (first + last) / math.tau)
        readings = tuple(order[start : start + length])
        regions.append(Rcd(readings, first - turns, last - turns, depth, echo))
    return regions
