"""Regions of constant depth: headings over which a sonar hears one thing (section II, READING section 4).

While a flat wall's normal lies inside the beam, the first echo comes from the foot of that normal,
whatever the heading: the depth is the perpendicular distance, and it stays constant for about a beam width.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    taken = [False] * n
    regions = []
    for start, length in _runs_longest_first(sweep, tolerance_m):
        # No run taken so far is shorter than this one, so an overlap must cover one of its ends.
        if taken[start] or taken[(start + length - 1) % n]:
            continue
        for reading in range(start, start + length):
            taken[reading % n] = True
        regions.append(_region(sweep, start, length))
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


def _depths(sweep: _Sweep, starts: NDArray[np.intp], length: int) -> Array:
    """Perpendicular distance from the centre of the runs of this length, shape (len(starts), length), [m].

    A wall with normal bearing b is heard at range D - lever . normal: the disc's lever is added back
    along the run's middle bearing.
    """
    run = starts[:, None] + np.arange(length)
    bearings = sweep.bearings[run]
    normals = 0.5 * (bearings[:, :1] + bearings[:, -1:])
    return sweep.ranges[run] + sweep.lever_m[run] * np.cos(bearings + sweep.lever_rad[run] - normals)


def _runs_longest_first(sweep: _Sweep, tolerance_m: float) -> list[tuple[int, int]]:
    """(start, length) of every run that is constant, longest first, then flattest, then nearest."""
    n = len(sweep.order) // 2
    breaks = np.concatenate([[0], np.cumsum(~sweep.joined)])
    found = [np.empty((0, 4))]
    for length in range(2, n + 1):
        whole = np.flatnonzero(breaks[length - 1 : length - 1 + n] == breaks[:n])
        depths = np.sort(_depths(sweep, whole, length), axis=1)
        medians = 0.5 * (depths[:, (length - 1) // 2] + depths[:, length // 2])
        spreads = np.maximum(medians - depths[:, 0], depths[:, -1] - medians)
        constant = np.flatnonzero(spreads <= tolerance_m)
        if not constant.size:
            break
        rows = np.empty((constant.size, 4))
        rows[:, 0], rows[:, 1] = whole[constant], length
        rows[:, 2], rows[:, 3] = spreads[constant].round(TIE_DECIMALS), medians[constant].round(TIE_DECIMALS)
        found.append(rows)
    starts, lengths, spreads, medians = np.concatenate(found).T
    order = np.lexsort((starts, medians, spreads, -lengths))
    return list(zip(starts[order].astype(int).tolist(), lengths[order].astype(int).tolist(), strict=True))


def _region(sweep: _Sweep, start: int, length: int) -> Rcd:
    run = slice(start, start + length)
    turns = math.tau * round((0.5 * (sweep.bearings[run][0] + sweep.bearings[run][-1])) / math.tau)
    first, last = sweep.bearings[start] - turns, sweep.bearings[start + length - 1] - turns
    off_normal = sweep.bearings[run] - turns + sweep.lever_rad[run] - 0.5 * (first + last)
    lever = sweep.lever_m[run] * np.cos(off_normal)
    return Rcd(
        readings=tuple(sweep.order[run].tolist()),
        first_rad=float(first),
        last_rad=float(last),
        depth_m=_median(sweep.ranges[run] + lever),
        echo_m=_median(sweep.ranges[run]),
    )


def _median(values: Array) -> float:
    """As `np.median`, of a handful."""
    rising = sorted(values.tolist())
    n = len(rising)
    return float(0.5 * (rising[(n - 1) // 2] + rising[n // 2]))
