"""How many processes are worth starting, and how often each looks for garbage."""

import os

COLLECT_EVERY = (
    100_000  # new objects; oftener makes a first run, which compiles, slower, and whole buildings by 4 %
)


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
