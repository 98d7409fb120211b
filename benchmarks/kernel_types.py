"""Write `sonar_explore/kernels.json`: kernels called from Python, in the order of first need, with their types.

`python benchmarks/kernel_types.py`, after a kernel, or what it is handed, has changed: tests/test_compiled.py says so.
It compiles everything in a cache of its own, which takes most of a minute.
"""

from __future__ import annotations

import json
import os
import tempfile
from typing import Any

from sonar_explore.compile_beside import KERNELS, spelled

LEFT_TO_THE_RUN = "sonar_explore.envs.pings."
BEGUN_WITH = (
    "sonar_explore.slam.rcd:regions",
    "sonar_explore.slam.joint.joint_steps:",
    "sonar_explore.slam.kalman:spread",
    "sonar_explore.envs.",
)
"""What the second process compiles first, so what stands last: a third of the longest of all, which the run needs soon;
steps that are made of the same kernels; how the covariance spreads; and the leg, made of the kernels of the pings, that
are there by then."""


def main() -> None:
    with tempfile.TemporaryDirectory() as cache:
        os.environ["NUMBA_CACHE_DIR"] = cache
        needed = compiled_in_order()
    first = [name for begin in BEGUN_WITH for name in needed if name.startswith(begin)]
    names = [name for name in needed if name not in first] + first[::-1]
    KERNELS.write_text(json.dumps({name: needed[name] for name in names}, indent=0) + "\n")


def compiled_in_order() -> dict[str, str]:
    from numba.core import event

    from sonar_explore.episodes.run import run_episode

    class Recorder(event.Listener):
        depth, needed = 0, {}

        def on_start(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            name = f"{function.__module__}:{function.__name__}"
            wanted = self.depth == 0 and not name.startswith(LEFT_TO_THE_RUN)
            if wanted or name == BEGUN_WITH[0]:
                self.needed[name] = spelled(event.data["args"])
            self.depth += 1

        def on_end(self, event: Any) -> None:
            self.depth -= 1

    with event.install_listener("numba:compile", Recorder()) as recorder:
        run_episode("paper/rooms", seed=0)
    return recorder.needed


if __name__ == "__main__":
    main()
