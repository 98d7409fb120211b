"""Hashes of a fixed set of episodes, wall time removed: a speed-up must leave every one as it was.

`python benchmarks/same_episodes.py before.txt` writes them where there is no such file, and else compares.
"""

from __future__ import annotations

import hashlib
import sys
import time
from pathlib import Path

import msgspec

from sonar_explore.episodes.run import run_episode

WORLDS = ("rooms", "corridor", "bend", "loop", "open-loop")
RUNS = [("chain", f"paper/{world}", seed) for seed in (1, 2) for world in WORLDS]
RUNS += [("smoothed", "paper/corridor", 1), ("smoothed", "paper/bend", 1), ("truth", "paper/corridor", 1)]
RUNS += [("chain", "generated/home-4", 1)]


def episode_hash(slam: str, world: str, seed: int) -> str:
    """SHA-256 of the record as JSON, shortened."""
    record = run_episode(world, slam=slam, seed=seed)
    summary = msgspec.structs.replace(record.summary, wall_time_s=0.0)
    content = msgspec.json.encode(msgspec.structs.replace(record, summary=summary))
    return hashlib.sha256(content).hexdigest()[:16]


def main(path: Path) -> int:
    """Write or compare; 1 where an episode differs."""
    known = dict(line.rsplit(" ", 1) for line in path.read_text().splitlines()) if path.exists() else None
    lines, differ = [], 0
    for run in RUNS:
        name, began = " ".join(map(str, run)), time.process_time()
        found = episode_hash(*run)
        lines.append(f"{name} {found}")
        different = known is not None and known.get(name) != found
        differ += different
        print(
            lines[-1], f"{time.process_time() - began:.2f} s CPU", "DIFFERS" * different, sep="  ", flush=True
        )
    if known is None:
        path.write_text("\n".join(lines) + "\n")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
