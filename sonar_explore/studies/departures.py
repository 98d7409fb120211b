"""Every departure from the paper, in one place: docs/departures.md and the ablation are made from it.

`python -m sonar_explore.studies.departures` writes the page.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sonar_explore.config import ExplorationConfig
from sonar_explore.slam.association import MAX_END_GAP_M
from sonar_explore.studies.jobs import Variant
from sonar_explore.studies.options import option

PAGE = Path("docs/departures.md")


@dataclass(frozen=True)
class Departure:
    """One option that goes beyond the paper's letter, or chooses where it says nothing."""

    name: str
    """Of the arm that has it off."""
    option: str
    """Dotted, within `ExplorationConfig`."""
    paper: Any
    """The value that keeps the paper's letter."""
    section: str
    """That it departs from."""
    says: str
    """What it does and why, in a sentence."""
    in_literal: bool = False
    """Whether `literal`, which keeps the letter of section III alone, has it as well."""

    @property
    def on(self) -> Any:
        """The value to explore with."""
        return option(ExplorationConfig(), self.option)

    @property
    def off(self) -> Variant:
        """The arm that leaves out this departure alone."""
        return Variant(f"no-{self.name}", changes=((self.option, self.paper),))


DEPARTURES: tuple[Departure, ...] = (
    Departure(
        "beam-check",
        "slam.features.beam_check",
        False,
        "II",
        "A wall must be heard as widely as the beam pattern says a plane is at its distance; edges, columns and "
        "two things that touch are sorted out before they can be associated, not only by the link graph after.",
    ),
    Departure(
        "beam-bearing",
        "slam.features.beam_bearing",
        False,
        "II",
        "Where something nearer hides one end of a region of constant depth, its normal is found from the other "
        "end and the width of the beam, not taken as the middle of what was heard.",
    ),
    Departure(
        "corner-on-wall",
        "slam.features.corner_on_wall",
        False,
        "II",
        "What is heard on the straight continuation of a nearer wall is the corner at its end, though the corner's "
        "other wall was not heard.",
    ),
    Departure(
        "all-discs",
        "slam.agreement.enabled",
        False,
        "IV",
        "All eight discs are recorded while the robot turns, not one: a wall is what at least four of them hear at one "
        "bearing, which eight together know better than one; a point is told from a plane by how its bearing shifts "
        "with the discs; and walls heard early by one and late by another tell the error of the turn itself.",
    ),
    Departure(
        "long-gaps",
        "slam.association.end_gap_max_m",
        MAX_END_GAP_M,
        "III.B",
        "A wall is met again over a gap of 1.2 m, not of 0.5 m: bearings are fine enough to tell that both lie on one "
        "line, and a chain that goes on hands its direction on.",
    ),
    Departure(
        "facing",
        "slam.association.facing",
        False,
        "III.B",
        "A wall is heard from one side: what is heard of its other side, a hand's breadth away, is another wall.",
    ),
    Departure(
        "turning-check",
        "slam.turning.enabled",
        False,
        "III.B",
        "The foot of a wall's normal goes along with the robot, that of an edge or a column stays: an association "
        "whose foot stayed behind is not made.",
    ),
    Departure(
        "min-consensus",
        "slam.localization.min_consensus",
        1,
        "III.F",
        "Where several associations were found and only one survives, nothing is corrected: nobody agrees with it.",
    ),
    Departure(
        "refined-lines",
        "slam.reference.refined",
        False,
        "III.F",
        "Corrections refer to a line through the feet of all links of a chain, not to the root, which keeps the "
        "bearing error of the one scan that saw it.",
    ),
    Departure(
        "odometry-filter",
        "slam.odometry.enabled",
        False,
        "III.F",
        "The odometry has a say in which associations are believable and in how far to correct, and its constant "
        "errors are learned on the way; equations (4) and (5) ask the associations alone.",
    ),
    Departure(
        "joint-estimate",
        "slam.joint.enabled",
        False,
        "III.F",
        "Pose, wheels, the chains' lines and points (edges, corners, columns) are one estimate with all its "
        "correlations: chains that were rooted from one wrong pose are known to be wrong alike, and a merge pulls the "
        "robot and the lines between to where the loop closes. No pose and no link is moved afterwards. It needs the "
        "two options before it.",
    ),
    Departure(
        "legs",
        "planning.leg_m",
        1000.0,
        "I",
        "A long way is driven in legs with a scan after each, though nothing new is to be seen there; the paper says "
        "only that it scans where it arrives.",
        in_literal=True,
    ),
    Departure(
        "close-loops",
        "planning.close_loops",
        False,
        "IV",
        "When nothing is left to explore, the last stretch of a loop that was seen from both its ends is driven too, "
        "and a robot that went round without meeting a wall of its first scan again goes there; the paper's robot "
        "completes its loops, and says nothing of how it knows of them.",
        in_literal=True,
    ),
    Departure(
        "alternate-spin",
        "alternate_spin",
        False,
        "IV",
        "Scans turn left and right in turn, so that a wrong wheel base does not add up scan by scan; the paper does "
        "not say which way it turns.",
        in_literal=True,
    ),
    Departure(
        "ring-in-the-open",
        "ring_in_the_open",
        False,
        "IV",
        "In the middle of a hall, where the last scan heard nothing and no wall is known to be near, the next one is a "
        "ring scan: the robot turns by 70 degrees instead of 360, and its heading goes off by a fifth. The paper's "
        "rooms have no such place.",
        in_literal=True,
    ),
)


def ablation_variants() -> tuple[Variant, ...]:
    """All on, each off alone, and the paper's letter."""
    return (Variant("all-on"), *(d.off for d in DEPARTURES), Variant("literal", slam="literal"))


def departures_page() -> str:
    """docs/departures.md"""
    rows = [
        f"| `{d.option}` | {d.section} | `{d.on}` | `{d.paper}` | {d.says}{' *' if d.in_literal else ''} |"
        for d in DEPARTURES
    ]
    return "\n".join([_HEAD, *rows, "", _FOOT])


_HEAD = """# Departures from the paper

Made by `python -m sonar_explore.studies.departures` from `sonar_explore/studies/departures.py`: edit the list there.

`--slam chain` explores with all of these on, `--slam literal` keeps the letter of section III. Each is an option that
can be turned off alone, in Python by its name in `ExplorationConfig`. What each one brings is measured by
`sonar-explore ablation`; the figures stand in [reproduction.md](reproduction.md).

| option | departs from section | here | the paper's letter | what it does, and why |
|---|---|---|---|---|"""

_FOOT = """\\* no part of section III: `literal` has it as well, and so has `off`.

All arms drive alike, whatever corrects the pose: legs, glances to the left and right in tight places, what the ring has
heard kept until a scan or a later ping knows better, and the nearer way to the unknown. The paper does not say how
its robot avoids walls; [mapping.md](mapping.md) says how ours does. `--slam smoothed` has all of the above and moves
every pose and chain after each scan: [slam.md](slam.md).

What the paper leaves open, and what was chosen there, is no departure: those choices are cited in the code as
*READING*, and [conformance.md](conformance.md) lists them beside the paper's own sentences.
"""


if __name__ == "__main__":
    PAGE.write_text(departures_page(), encoding="utf-8")
