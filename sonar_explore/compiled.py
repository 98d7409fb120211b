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
    return _compiled(function)


def lean_kernel(function: F) -> F:
    """A kernel that neither makes nor returns arrays: without reference counts, calls among kernels cost nothing."""
    return _compiled(function, _nrt=False)


def inner_kernel(function: F) -> F:
    """A lean kernel that other kernels call, nobody else: without a way in from Python it compiles sooner."""
    return _compiled(function, _nrt=False, no_cpython_wrapper=True)


def inner_allocating_kernel(function: F) -> F:
    """A kernel that makes arrays, and that other kernels call, nobody else."""
    return _compiled(function, no_cpython_wrapper=True)


def inlined_kernel(function: F) -> F:
    """An inner kernel that its callers take in whole: for those called from loops with many arrays to hand over."""
    return _compiled(function, _nrt=False, no_cpython_wrapper=True, forceinline=True)


def _compiled(function: F, **options: bool) -> F:
    """None is called from C: a way in for that is left out; and tests for division by zero, which none does."""
    if njit is None:
        return function
    compiled: F = njit(cache=True, no_cfunc_wrapper=True, error_model="numpy", **options)(function)
    return compiled
