"""How kernels are compiled: ahead, for float64, into NumPy ufuncs that broadcast over leading axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numba import float64, guvectorize, int64, njit
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Kernel: TypeAlias = Callable[..., Any]
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

_guvectorize: Any = guvectorize  # numba has no types

# The types of a kernel's arguments: () and (n) are both one-dimensional inside, as gufuncs want outputs.
SCALAR = float64
VECTOR = float64[:]
MATRIX = float64[:, :]
INTEGERS = int64[:]


def _probe() -> None:
    """Stands in this folder, so what numba can cache for it, it can cache for every kernel."""


def _can_cache() -> bool:
    """Whether compiled code can be kept: not in a read-only installation without NUMBA_CACHE_DIR."""
    try:
        njit(cache=True)(_probe)
    except RuntimeError:  # numba: "no locator available", that is, no writable directory
        return False
    return True


CACHE = _can_cache()


def helper(function: FunctionT) -> FunctionT:
    """Compile `function` for use inside kernels. Division by zero gives inf or nan, as in C.

    numba's cache notices a change in a kernel's own file alone: after editing a helper delete `__pycache__`.
    """
    return cast(FunctionT, njit(cache=CACHE, error_model="numpy")(function))


def kernel(arguments: list[Any], layout: str) -> Callable[[Callable[..., None]], Kernel]:
    """Compile a function of one row into a ufunc; `layout` as for numpy.vectorize, e.g. "(n,d),(d)->(n)".

    Compilation (or loading from the cache) happens here, at import, never inside a running loop.
    """

    def compile_(function: Callable[..., None]) -> Kernel:
        compiled = _guvectorize([tuple(arguments)], layout, nopython=True, cache=CACHE)(function)
        return cast(Kernel, compiled.ufunc)  # the plain NumPy ufunc: numba's wrapper costs 0.4 us a call

    return compile_
