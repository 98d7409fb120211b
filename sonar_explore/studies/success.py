"""What counts as success, and for what causes an episode has none."""

from __future__ import annotations

from enum import StrEnum

from sonar_explore.episodes.record import Summary

LEAST_EXPLORED = 0.97  # share of the reachable area
LARGEST_WALL_ERROR_M = 0.15
GOAL = 0.99  # 99 of 100 with SLAM, in every world


class Cause(StrEnum):
    """Why an episode is no success; one episode can have several."""

    UNEXPLORED = "unexplored"
    """Less than 97 % of the reachable area was seen."""
    CONTACT = "contact"
    """The body touched a wall."""
    LOOP = "loop"
    """The world has a loop and it was not closed."""
    WALL_ERROR = "wall error"
    """The map's walls are more than 0.15 m off in the mean, or there are none."""
    EXCEPTION = "exception"
    """The episode ended with an error of the program."""


def causes_of_failure(summary: Summary | None) -> tuple[Cause, ...]:
    """Empty for a success; None stands for an episode that raised."""
    if summary is None:
        return (Cause.EXCEPTION,)
    wall_error = summary.wall_error_m
    failed = {
        Cause.UNEXPLORED: summary.explored_fraction < LEAST_EXPLORED,
        Cause.CONTACT: summary.contacts > 0,
        Cause.LOOP: summary.loop_closed is False,
        Cause.WALL_ERROR: wall_error is None or wall_error > LARGEST_WALL_ERROR_M,
    }
    return tuple(cause for cause, missed in failed.items() if missed)
