"""Compile kernels in a second process while a first run compiles those that it needs next.

With an empty cache most of a run is compilation, which numba does on one core. `kernels.json` names the kernels of
SLAM, mapping, planning and driving with the types of their arguments, in the order in which a run comes to need them,
but for a few long ones at its end. The second process begins at the end and leaves what it makes in numba's cache,
where the run finds it: the two meet somewhere in the middle. What hears is left to the run, which begins with it.
Nothing depends on the second process: a kernel that it does not know, or knows with other types, is compiled when it
is called, as it would be without. It is a fork of the run, so that it need not import everything again, and there is
none where forks are not at home.
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


@contextlib.contextmanager
def compiling_beside() -> Iterator[Beside]:
    """The first kernel that is compiled meanwhile starts the second process, where there is a core for it."""
    beside = Beside()
    if sys.platform != "linux" or usable_cores() < 2:
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
            function = event.data["dispatcher"].py_func
            beside.compiling(f"{function.__module__}:{function.__name__}")

        def on_end(self, event: Any) -> None:
            """numba asks for one."""

    with event.install_listener("numba:compile", Listener()):
        try:
            yield beside
        finally:
            beside.stop()


class Beside:
    """The second process, and what it leaves to the first."""

    def __init__(self) -> None:
        self.kernels: dict[str, str] = json.loads(KERNELS.read_text())
        self.begun = mmap(-1, len(self.kernels))  # a byte for each kernel, seen by both processes
        self.place = {name: n for n, name in enumerate(self.kernels)}
        self.process: BaseProcess | None = None
        self.owner = os.getpid()

    def compiling(self, name: str) -> None:
        """The run compiles this now: the second process need not."""
        if os.getpid() != self.owner or not name.startswith("sonar_explore."):
            return
        if name in self.place:
            self.begun[self.place[name]] = 1
        if self.process is None:
            run = (self.kernels, self.begun, self.owner)
            process = get_context("fork").Process(target=_compile, args=run, daemon=True)
            # no more processes, no more memory: the run is slower, that is all
            with contextlib.suppress(OSError):
                process.start()
                self.process = process

    def stop(self) -> None:
        """What is not done is not needed any more."""
        if self.process is not None:
            self.process.terminate()
            self.process.join()


def _compile(kernels: dict[str, str], begun: mmap, parent: int) -> None:
    """Compile from the last on, quietly, while the parent lives."""
    from numba.core.sigutils import normalize_signature

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    for n, (name, types) in reversed(list(enumerate(kernels.items()))):
        if os.getppid() != parent:
            return
        module, kernel = name.split(":")
        if not begun[n]:
            with contextlib.suppress(Exception):
                getattr(import_module(module), kernel).compile(normalize_signature(types)[0])


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
