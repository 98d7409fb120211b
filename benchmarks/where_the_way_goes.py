"""Where the metres of exploring go, in tours with the map known (sonar_explore/studies/plans/tour.py).

`python benchmarks/where_the_way_goes.py smoothed 200 224` explores the generated worlds 200 to 223, as `explore-plans`
counts them, and prints for each what was driven until 90, 97 and 99 % were explored and in all, and for all together
what was driven for which reason.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from itertools import islice, pairwise
from typing import Any

import numpy as np

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.load import load_world
from sonar_explore.episodes.record import EpisodeRecord
from sonar_explore.episodes.run import run_episode
from sonar_explore.planning.offers import Offers
from sonar_explore.studies.plans.buildings import generated
from sonar_explore.studies.plans.tour import tour_of

SHARES = (0.9, 0.97, 0.99)
OFFERS = {
    "_safe": "safe",
    "_dared": "dared",
    "_doubted_walls": "doubted",
    "_second_chance": "second chance",
    "_close_a_loop": "loop",
}


def noted(reasons: list[str]) -> None:
    """Let the offers say which of them was taken."""
    for name, says in OFFERS.items():
        offer: Callable[..., Any] = getattr(Offers, name)

        def saying(self: Offers, *args: Any, _offer: Any = offer, _says: str = says) -> Any:
            found = _offer(self, *args)
            if found:
                reasons.append(_says)
            return found

        setattr(Offers, name, saying)


def way_until(record: EpisodeRecord, share: float) -> float:
    """[m]; all of it where so much was never explored."""
    for step in record.steps:
        if step.explored_fraction >= share:
            return step.path_length_m
    return record.summary.path_length_m


def main(slam: str, first: int, last: int) -> None:
    """Run and print."""
    reasons: list[str] = []
    noted(reasons)
    config = ExplorationConfig(max_scans=4000)
    ways: list[list[float]] = []
    driven: Counter[str] = Counter()
    for building in islice(generated(last), first, None):
        began = time.process_time()
        tour_m = tour_of(load_world(building.world)).length_m
        reasons.clear()
        record = run_episode(building.world, slam=slam, noise="paper", config=config)
        s = record.summary
        for reason, (a, b) in zip(reasons, pairwise(record.steps), strict=True):
            driven[reason] += (b.path_length_m - a.path_length_m) / tour_m
            nothing = b.explored_fraction == a.explored_fraction
            driven["nothing seen" if nothing else "something seen"] += (
                b.path_length_m - a.path_length_m
            ) / tour_m
        ways.append([*(way_until(record, share) / tour_m for share in SHARES), s.path_length_m / tour_m])
        print(
            f"{building.name:28s} {100 * s.explored_fraction:5.1f} % {s.end_reason:8s} {s.contacts} contacts "
            f"{s.scans:4d} scans {s.path_length_m:6.1f} m, tour {tour_m:5.1f} m:",
            *(f"{way:5.2f}" for way in ways[-1]),
            f" {s.position_error_m.mean:.2f} m {time.process_time() - began:5.1f} s",
            flush=True,
        )
    print("median until 90, 97, 99 %, all:", np.median(ways, axis=0).round(2))
    print("mean until 90, 97, 99 %, all:  ", np.mean(ways, axis=0).round(2))
    for reason, way in driven.most_common():
        print(f"{reason:16s} {way / len(ways):5.2f} tours")


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:4]))
