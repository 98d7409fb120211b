"""The ends of a region of constant depth, judged by the beam pattern (beyond the paper).

The robot knows how widely its sonar hears a plane (`sonar_explore.beam`). An RCD that ends because the next
beam hears nothing nearer ends where the pattern says; one that ends because something nearer answers first
is cut short, and its middle is not the wall's normal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from sonar_explore.beam import Beam
from sonar_explore.measurement import Scan
from sonar_explore.slam.rcd import Rcd

SLACK_RAD = math.radians(0.5)


@dataclass(frozen=True)
class Ends:
    """Which ends of an RCD are hidden by something nearer, and how fine the lattice of headings is."""

    first_hidden: bool
    last_hidden: bool
    step_rad: float
    """Between two readings, [rad]."""
    room_rad: float
    """From the reading before to the first, and from the last to the reading after, together, [rad]."""
    beam: Beam = field(default_factory=Beam)
    """What the sonar hears how widely."""

    @staticmethod
    def of(region: Rcd, scan: Scan, jump_m: float, beam: Beam | None = None) -> Ends:
        """Look at the readings just outside."""
        before, after = neighbours(region.readings, len(scan.ranges_m))
        bearings, ranges = scan.bearings_rad, scan.ranges_m
        first, last = float(bearings[region.readings[0]]), float(bearings[region.readings[-1]])
        room = (first - float(bearings[before])) % math.tau + (float(bearings[after]) - last) % math.tau
        nearer = region.echo_m - jump_m
        hidden = bool(ranges[before] < nearer), bool(ranges[after] < nearer)
        return Ends(*hidden, scan.step_rad, room, beam or Beam())

    def like_a_plane(self, region: Rcd) -> bool:
        """Whether its width is what a plane's would be: the readings fit into the pattern's width, and no more do."""
        full = self._plane_width_rad(region)
        if region.width_rad > full + SLACK_RAD:
            return False
        if self.first_hidden or self.last_hidden:
            return region.width_rad >= 0.5 * full - self.step_rad
        return region.width_rad > full - self.room_rad - SLACK_RAD

    def centred(self, region: Rcd) -> Rcd:
        """The region with a hidden end put where the pattern says it would be, from the other end."""
        if self.first_hidden == self.last_hidden:
            return region
        # the true end lies up to a step beyond the last reading: half a step on average, at both ends
        width = self._plane_width_rad(region) - self.step_rad
        if self.first_hidden:
            return replace(region, first_rad=region.last_rad - width)
        return replace(region, last_rad=region.first_rad + width)

    def _plane_width_rad(self, region: Rcd) -> float:
        return 2.0 * self.beam.plane_half_angle_rad(max(region.echo_m, 0.05))


def neighbours(readings: Sequence[int], n: int) -> tuple[int, int]:
    """The readings just before and just after a run, which may run either way round."""
    step = 1 if (readings[1] - readings[0]) % n == 1 else -1
    return (readings[0] - step) % n, (readings[-1] + step) % n
