"""Machine code for hot numerical kernels, kept between runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays when it is first called.

    The machine code is kept beside the source, or in the user's cache where that folder cannot be written; where
    neither can, it lasts as long as the process. Division by zero gives inf or nan, as in numpy.
    """
    try:
        fast: Callable[P, R] = njit(cache=True, error_model="numpy")(kernel)
    except RuntimeError:  # numba found no folder for its cache
        fast = njit(error_model="numpy")(kernel)
    return fast
