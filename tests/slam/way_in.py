"""Kernels that kernels alone call have no way in from Python: one for the tests."""

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def way_in(inner: Callable[..., Any]) -> Callable[..., Any]:
    """The same kernel, to be called from Python; without numba it is that already."""
    if not hasattr(inner, "py_func"):
        return inner
    from numba import njit

    def call(*arguments: Any) -> Any:
        return inner(*arguments)

    called: Callable[..., Any] = njit(call, error_model="numpy")
    return called
