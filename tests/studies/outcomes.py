"""Outcomes made up for tests: no episode is run."""

from sonar_explore.episodes.record import Stats, Summary
from sonar_explore.studies.jobs import Outcome

GOOD = Summary(
    world="paper/loop",
    agent="frontier",
    slam="chain",
    noise="paper",
    sensor="amigobot",
    scan="turn",
    seed=0,
    end_reason="explored",
    scans=40,
    decisions=39,
    path_length_m=30.0,
    sim_time_s=600.0,
    wall_time_s=3.0,
    explored_fraction=0.99,
    wall_recall=0.8,
    wall_error_m=0.05,
    false_free_fraction=0.02,
    contacts=0,
    loop_closed=True,
    position_error_m=Stats(0.05, 0.2, 0.04),
    heading_error_deg=Stats(1.0, 2.0, 0.5),
    chains=10,
    dangling_chains=0,
    merges=1,
)


def outcome(seed: int = 0, variant: str = "chain", summary: Summary | None = GOOD, **changes) -> Outcome:
    return Outcome("paper/loop", variant, seed, "f", "0", summary, None, **changes)
