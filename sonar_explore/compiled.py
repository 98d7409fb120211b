"""`@kernel`: compile a loop with numba where it is installed, leave it as it is where not.

Both ways run the same lines and give the same numbers; numba (`pip install "sonar-explore[fast]"`)
only makes them faster. Kernels take arrays and scalars alone and live in few, small files, which
`import sonar_explore` does not touch: numba is imported when the first simulator is made.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

njit: Any = None
with contextlib.suppress(ImportError):
    from numba import njit


def kernel(function: F) -> F:
    """Mark a kernel: compiled at its first call and cached on disk; no fast-math, so no change of results."""
    if njit is None:
        return function
    compiled: F = njit(cache=True)(function)
    return compiled


def inner_kernel(function: F) -> F:
    """A kernel that neither makes nor returns arrays: without reference counts, calls among kernels cost nothing."""
    if njit is None:
        return function
    compiled: F = njit(cache=True, _nrt=False)(function)
    return compiled


def inlined_kernel(function: F) -> F:
    """An inner kernel that its callers take in whole: for those called from loops with many arrays to hand over."""
    if njit is None:
        return function
    compiled: F = njit(cache=True, _nrt=False, forceinline=True)(function)
    return compiled
