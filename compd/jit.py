"""How kernels are compiled: ahead, for float64, into NumPy ufuncs that broadcast over leading axes."""

from __future__ import annotations

import fcntl
import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast

from numba import boolean, float64, guvectorize, int64, njit, types
from numba.core import config as numba_config

Kernel: TypeAlias = Callable[..., Any]
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

# numba's types are not complete
_guvectorize: Any = guvectorize
_njit: Any = njit
_config: Any = numba_config

# The types of a kernel's arguments: () and (n) are both one-dimensional inside, as gufuncs want outputs.
SCALAR = float64
VECTOR = float64[:]
MATRIX = float64[:, :]
INTEGERS = int64[:]
INTEGER_ROWS = int64[:, :]
# Of a loop's arguments: contiguous, with the axis of the rows in front where there is one.
NUMBERS = float64[::1]
ROWS = float64[:, ::1]
ROW_MATRICES = float64[:, :, ::1]
INDICES = int64[::1]
INDEX_ROWS = int64[:, ::1]
COUNT = int64
FLAG = boolean


@cache
def kernel_digest() -> str:
    """Hash of the sources of all kernels and helpers, hexadecimal."""
    here = Path(__file__).parent  # kernels and helpers are beside this file, and anywhere below model/
    files = [*sorted(here.glob("*.py")), *sorted((here / "model").rglob("*.py"))]
    texts = [file.read_bytes() for file in files]
    compiled = [
        text
        for text in texts
        if any(mark in text for mark in (b"@helper", b"kernel(", b"@loop", b"structure(", b"_LIMIT = "))
    ]
    return hashlib.sha256(b"".join(compiled)).hexdigest()[:12]


def _cache_directory() -> str:
    """Where compiled code is kept; "" where nothing can be written: then every start compiles anew, in seconds.

    numba knows compiled code as outdated by the kernel's own file alone. The digest makes a change in a helper or a
    limit count as well: no machine runs last version's kernels.
    """
    here = Path(__file__).parent
    user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "compd"
    places = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else [here / "__pycache__", user]
    for place in filter(Path.is_absolute, places):
        directory = place / f"kernels-{kernel_digest()}"
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(directory, os.W_OK):
            return str(directory)
    return ""


CACHE_DIRECTORY = _cache_directory()


@contextmanager
def _kept() -> Iterator[None]:
    """Within, numba keeps what it compiles in our directory; outside, where it always does.

    One process at a time: numba stores a kernel and its wrapper one after the other, and a kernel of one process with
    the wrapper of another crashes whoever loads them.
    """
    if not CACHE_DIRECTORY:
        yield
        return
    before = _config.CACHE_DIR
    with (Path(CACHE_DIRECTORY) / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        _config.CACHE_DIR = CACHE_DIRECTORY
        try:
            yield
        finally:
            _config.CACHE_DIR = before


@contextmanager
def _said(function: Callable[..., Any]) -> Iterator[None]:
    """Within, a line on the terminal that waits says that a kernel is compiled; none where the kernel is kept."""
    if not sys.stderr.isatty() or _is_kept(function):
        yield
        return
    how_often = "once, 1 to 2 min" if CACHE_DIRECTORY else "at every start, as NUMBA_CACHE_DIR cannot be written"
    text = f"compd compiles kernels ({how_often}): {function.__name__}"
    # overwritten by the next, and gone at the end; a line of 80 characters, since one that wraps would stay
    print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
    try:
        yield
    finally:
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _is_kept(function: Callable[..., Any]) -> bool:
    """Whether numba has an index of the compiled code, which it names by module, function and line."""
    name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}-{function.__code__.co_firstlineno}"
    return bool(CACHE_DIRECTORY) and any(Path(CACHE_DIRECTORY).glob(f"*/{name}.*.nbi"))


def helper(function: FunctionT) -> FunctionT:
    """Compile `function` for use inside kernels, which keep it. Division by zero gives inf or nan, as in C.

    It cannot be called from Python: a wrapper for each would be compiled, too.
    """
    return cast(FunctionT, _njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function))


def kernel(arguments: list[Any], layout: str) -> Callable[[Callable[..., None]], Kernel]:
    """Compile a function of one row into a ufunc; `layout` as for numpy.vectorize, e.g. "(n,d),(d)->(n)".

    Compilation (or loading from the cache) happens here, at import, never inside a running loop. The function may be a
    helper, which other kernels use as well.
    """

    def compile_(function: Callable[..., None]) -> Kernel:
        function = getattr(function, "py_func", function)
        with _said(function), _kept():
            compiled = _guvectorize([tuple(arguments)], layout, nopython=True, cache=bool(CACHE_DIRECTORY))(function)
        return cast(Kernel, compiled.ufunc)  # the plain NumPy ufunc: numba's wrapper costs 0.4 us a call

    return compile_


def structure(kind: type, **fields: Any) -> Any:
    """The type of a kernel's argument that is a named tuple of the class `kind`, whose fields have these types."""
    names: tuple[str, ...] = getattr(kind, "_fields")  # noqa: B009  NamedTuple classes have no common base
    tuple_type: Any = types.BaseTuple
    return tuple_type.from_types([fields[name] for name in names], kind)


def loop(arguments: list[Any]) -> Callable[[FunctionT], FunctionT]:
    """Compile a function that goes through rows in their order: a row needs what the rows before it left behind.

    It takes contiguous arrays of exactly the types in `arguments` and broadcasts nothing. Compilation, or loading from
    the cache, happens here as in `kernel`.

    A function with a `structure` among its arguments does not check the types of the arrays in it: numba takes 3 us for
    each structure to do that. Such a function is called from one place, whose test compares the types.
    """

    def compile_(function: FunctionT) -> FunctionT:
        with _said(function), _kept():
            compiled = njit([tuple(arguments)], error_model="numpy", cache=bool(CACHE_DIRECTORY))(function)
        if any(isinstance(argument, types.BaseTuple) for argument in arguments):
            return cast(FunctionT, _unchecked(function, compiled))
        return cast(FunctionT, compiled)

    return compile_


def _unchecked(function: Callable[..., Any], compiled: Any) -> Callable[..., Any]:
    """The compiled code of the only signature, without numba's look at the types of the arguments."""
    ((signature, overload),) = compiled.overloads.items()
    entry = overload.entry_point

    @wraps(function)
    def call(*arguments: Any) -> Any:
        return entry(*arguments)

    # whoever has the function keeps the code, and a test finds the types
    vars(call).update(compiled=compiled, signature=signature)
    return call
