"""Machine code for hot numerical kernels, kept between runs."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Final, ParamSpec, TypeVar, final

from numba import njit
from numba.core import event

P = ParamSpec("P")
R = TypeVar("R")

# Division by zero gives inf or nan, as in numpy. No kernel is called from C.
_OPTIONS: Final = {"error_model": "numpy", "no_cfunc_wrapper": True}


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays when it is first called.

    The machine code is kept beside the source, or in the user's cache where that folder cannot be written; where
    neither can, it lasts as long as the process. Division by zero gives inf or nan, as in numpy.
    """
    try:
        fast: Callable[P, R] = njit(cache=True, **_OPTIONS)(kernel)
    except RuntimeError:  # numba found no folder for its cache
        fast = njit(**_OPTIONS)(kernel)
    return fast


@final
class _Pause(event.Listener):  # type: ignore[misc]  # numba gives no types
    """Collects no garbage while numba compiles: it makes millions of objects that stay, which costs a sixth."""

    def __init__(self) -> None:
        self.depth = 0
        self.enabled = False

    def on_start(self, event: event.Event) -> None:  # noqa: ARG002 - numba's signature
        if self.depth == 0:
            self.enabled = gc.isenabled()
            gc.disable()
        self.depth += 1

    def on_end(self, event: event.Event) -> None:  # noqa: ARG002 - numba's signature
        self.depth -= 1
        if self.depth == 0 and self.enabled:
            gc.enable()


event.register("numba:compile", _Pause())
