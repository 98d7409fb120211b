"""Compile kernels in other processes while a first run compiles those that it needs next.

With an empty cache most of a run is compilation, which numba does on one core. `kernels.json` names the kernels of
SLAM, mapping, planning and driving with the types of their arguments, in the order in which a run comes to need them,
but for a few long ones at its end. The other processes, one for each core that is left but no more than two, begin
at the end and leave what they make in numba's cache, where the run finds it: they meet somewhere in the middle. What
hears is left to the run, which begins with it. Nothing depends on the others: a kernel that they do not know, or know
with other types, is compiled when it is called, as it would be without. They are forks of the run, so that they need
not import everything again, and there are none where forks are not at home.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
from collections.abc import Iterator
from importlib import import_module
from mmap import mmap
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from sonar_explore.cores import usable_cores

KERNELS = Path(__file__).with_name("kernels.json")
MOST = 2
"""Other processes, of some 300 MB each: a third one would save the run a twentieth."""
HEARS = "sonar_explore.envs.pings.fire:fire_all"
HAS_IT_WITHIN = "sonar_explore.envs.leg:drive"
"""Would have to compile what hears once more while the run is at it: it waits."""


@contextlib.contextmanager
def compiling_beside() -> Iterator[Beside]:
    """The first kernel that is compiled meanwhile starts the other processes, where there are cores for them."""
    beside = Beside(min(usable_cores() - 1, MOST))
    if sys.platform != "linux" or beside.most < 1:
        yield beside
        return
    try:
        from numba.core import event
    except ImportError:
        yield beside
        return

    class Listener(event.Listener):
        """Told of every function that numba compiles."""

        def on_start(self, event: Any) -> None:
            """Before numba compiles."""
            beside.compiling(_name(event))

        def on_end(self, event: Any) -> None:
            """When it has compiled."""
            beside.compiled(_name(event))

    with event.install_listener("numba:compile", Listener()):
        try:
            yield beside
        finally:
            beside.stop()


def _name(event: Any) -> str:
    function = event.data["dispatcher"].py_func
    return f"{function.__module__}:{function.__name__}"


class Beside:
    """The other processes, and what they leave to the first."""

    def __init__(self, most: int) -> None:
        self.kernels: dict[str, str] = json.loads(KERNELS.read_text())
        self.most = most
        # a byte for each kernel, and one for `HEARS`, seen by all processes
        self.begun = mmap(-1, len(self.kernels) + 1)
        self.place = {name: n for n, name in enumerate(self.kernels)}
        self.processes: list[BaseProcess] = []
        self.owner = os.getpid()

    def compiling(self, name: str) -> None:
        """The run compiles this now: the others need not."""
        if os.getpid() != self.owner or not name.startswith("sonar_explore."):
            return
        if name in self.place:
            self.begun[self.place[name]] = 1
        run = (self.kernels, self.begun, self.owner)
        for _ in range(self.most - len(self.processes)):
            process = get_context("fork").Process(target=_compile, args=run, daemon=True)
            try:
                process.start()
            except OSError:  # no more processes, no more memory: the run is slower, that is all
                return
            self.processes.append(process)

    def compiled(self, name: str) -> None:
        """The run has compiled this: what contains it may be begun."""
        if os.getpid() == self.owner and name == HEARS:
            self.begun[len(self.kernels)] = 1

    def stop(self) -> None:
        """What is not done is not needed any more."""
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            process.join()


def _compile(kernels: dict[str, str], begun: mmap, parent: int) -> None:
    """Compile from the last on, quietly, while the parent lives."""
    from numba.core.sigutils import normalize_signature

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    while (name := _next(list(kernels), begun)) and os.getppid() == parent:
        module, kernel = name.split(":")
        with contextlib.suppress(Exception):
            getattr(import_module(module), kernel).compile(normalize_signature(kernels[name])[0])


def _next(kernels: list[str], begun: mmap) -> str | None:
    """The last that nobody has begun, begun from now on; what must wait comes after all others."""
    left = [n for n in range(len(kernels)) if not begun[n]]
    if not left:
        return None
    n = left[-1]
    if kernels[n] == HAS_IT_WITHIN and not begun[len(kernels)] and len(left) > 1:
        n = left[-2]
    begun[n] = 1
    return kernels[n]


def spelled(types: tuple[Any, ...]) -> str:
    """Types of arguments, `(float64[:,::1], int64)` for a table in rows and a whole number."""
    return "(" + ", ".join(map(_spelled, types)) + ")"


def _spelled(kind: Any) -> str:
    from numba import types

    if isinstance(kind, types.Array):
        return f"{kind.dtype}[{':,' * (kind.ndim - 1)}::1]"
    if isinstance(kind, types.UniTuple):
        return f"UniTuple({_spelled(kind.dtype)}, {kind.count})"
    if isinstance(kind, types.Tuple):
        return f"Tuple({spelled(tuple(kind))})"
    return "npy_rng" if isinstance(kind, types.NumPyRandomGeneratorType) else str(kind)
