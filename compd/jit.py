"""How kernels are compiled: ahead, for float64, into NumPy ufuncs that broadcast over leading axes."""

from __future__ import annotations

import fcntl
import hashlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cache, wraps
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast

from numba import boolean, float64, guvectorize, int64, njit, types
from numba.core import config as numba_config
from numba.core.caching import Cache, CacheImpl
from numba.core.cpu import CPUContext
from numba.core.runtime.nrt import rtsys

from compd.kernel_target import choose_target, compiler_name

Kernel: TypeAlias = Callable[..., Any]
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

# numba's types are not complete
_guvectorize: Any = guvectorize
_njit: Any = njit
_config: Any = numba_config
_CacheImpl: Any = CacheImpl
_Cache: Any = Cache
_CPUContext: Any = CPUContext
_make_function: Any = import_module("numba._dynfunc").make_function
_rtsys: Any = rtsys

_NOT_KEPT = "at every start, as NUMBA_CACHE_DIR cannot be written"

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


# Where an installation has kernels that were compiled when it was built, below this directory.
BUILT = "compiled_kernels"

choose_target()


def kernel_sources() -> list[Path]:
    """The sources of all kernels and helpers: beside this file, below model/, and in two packages of live/."""
    here = Path(__file__).parent
    files = [here.glob("*.py"), (here / "model").rglob("*.py")]
    files += [(here / "live" / package).glob("*.py") for package in ("machine", "memory")]
    return _with_kernels(chain.from_iterable(files))


def truth_kernel_sources() -> list[Path]:
    """The sources of the simulated machine's kernels, on which no setpoint depends."""
    return _with_kernels((Path(__file__).parent / "simulation" / "truth").glob("*.py"))


def _with_kernels(files: Iterable[Path]) -> list[Path]:
    marks = (b"@helper", b"kernel(", b"@loop", b"structure(", b"_LIMIT = ")
    return [file for file in sorted(files) if any(mark in file.read_bytes() for mark in marks)]


@cache
def kernel_digest() -> str:
    """Hash of the sources of all kernels and helpers, hexadecimal."""
    return hashlib.sha256(b"".join(file.read_bytes() for file in kernel_sources())).hexdigest()[:12]


def _directory_name() -> str:
    return f"kernels-{kernel_digest()}-{compiler_name()}"


def _cache_directory() -> str:
    """Where compiled code is kept; "" where nothing can be written: then every start compiles anew, in seconds.

    Its name says from which sources the code was compiled, with what, and for what.
    """
    here = Path(__file__).parent
    user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "compd"
    places = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else [here / "__pycache__", user]
    for place in filter(Path.is_absolute, places):
        directory = place / _directory_name()
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(directory, os.W_OK):
            return str(directory)
    return ""


CACHE_DIRECTORY = _cache_directory()


class KernelLocator:
    """Tells numba's cache where the code of a function is, by names and contents: neither by paths nor by times.

    So it fits wherever the installation is copied to.
    """

    def __init__(self, directory: Path, function: Callable[..., Any]):
        self._code, self._path = function.__code__, directory / function.__module__
        name = f"{Path(self._code.co_filename).stem}.{function.__qualname__}".replace("<", "").replace(">", "")
        self.index = self._path / f"{name}-{self._code.co_firstlineno}.py{sys.version_info[0]}{sys.version_info[1]}.nbi"

    def from_function(self, function: Callable[..., Any], file: str) -> KernelLocator:
        """numba asks so for a locator: this one, of the only function that is compiled meanwhile."""
        return self

    def get_cache_path(self) -> str:
        """The directory of the function's module."""
        return str(self._path)

    def get_source_stamp(self) -> tuple[str, str]:
        """What must be the same: all kernels and helpers, and the function's own file, which may be somebody else's."""
        return kernel_digest(), hashlib.sha256(Path(self._code.co_filename).read_bytes()).hexdigest()

    def get_disambiguator(self) -> str:
        """What distinguishes functions of the same name in a file: their lines."""
        return str(self._code.co_firstlineno)

    def ensure_cache_path(self) -> None:
        """Called before something is written."""
        self._path.mkdir(parents=True, exist_ok=True)


@contextmanager
def _kept(function: Callable[..., Any]) -> Iterator[bool]:
    """Within, numba takes the code of `function` from the installation or our directory, and keeps it there.

    Gives whether it is kept at all. One process at a time compiles a function: numba stores a kernel and its wrapper
    one after the other, and a kernel of one process with the wrapper of another crashes whoever loads them.
    """
    built = KernelLocator(Path(__file__).parent / BUILT / _directory_name(), function)
    if built.index.is_file():
        with _located(built):
            yield True
        return
    if not CACHE_DIRECTORY:
        with _said(function), _alone(function):
            yield False
        return
    locator = KernelLocator(Path(CACHE_DIRECTORY), function)
    locator.ensure_cache_path()
    with locator.index.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with _located(locator), nullcontext() if locator.index.is_file() else _said(function), _alone(function):
            yield True


@contextmanager
def _located(locator: KernelLocator) -> Iterator[None]:
    before = _CacheImpl._locator_classes, _Cache.load_overload
    _CacheImpl._locator_classes, _Cache.load_overload = [locator], _load_overload
    try:
        yield
    finally:
        _CacheImpl._locator_classes, _Cache.load_overload = before


def _load_overload(kept: Any, signature: Any, context: Any) -> Any:
    """numba's own, which fills the registries of its compiler first: a sixth of a second, and loading needs none.

    A compilation fills them itself.
    """
    _rtsys.initialize(context)
    return kept._load_overload(signature, context)


@contextmanager
def _alone(function: Callable[..., Any]) -> Iterator[None]:
    """Within, numba makes machine code of `function` alone, which halves the time.

    Of the helpers in it numba would make machine code, too, though no one calls them but compiled code. They are linked
    as they are, and what they are part of is optimized as a whole.
    """
    whole = _CPUContext.get_executable

    def executable(context: Any, library: Any, descriptor: Any, environment: Any) -> Any:
        if (descriptor.modname, descriptor.qualname) == (function.__module__, function.__qualname__):
            return whole(context, library, descriptor, environment)
        for part in dict.fromkeys(library._linking_libraries):
            library._reload_init.update(part._reload_init)
            library._final_module.link_in(part._get_module_for_linking(), preserve=True)
        library._finalized = True
        no_address = 0
        return _make_function(descriptor.lookup_module(), descriptor.qualname, "", no_address, environment, (library,))

    _CPUContext.get_executable = executable
    try:
        yield
    finally:
        _CPUContext.get_executable = whole


@cache
def _say_once() -> None:
    """One line where nobody watches a terminal, as in a log."""
    where = f"kept in {CACHE_DIRECTORY}" if CACHE_DIRECTORY else _NOT_KEPT
    print(f"compd compiles kernels (about 1 min): none fit {compiler_name()}; {where}", file=sys.stderr, flush=True)


@contextmanager
def _said(function: Callable[..., Any]) -> Iterator[None]:
    """Within, a line says that kernels are compiled; on a terminal it names this one, and is gone at the end."""
    if not sys.stderr.isatty():
        _say_once()
        yield
        return
    how_often = "once, about 1 min" if CACHE_DIRECTORY else _NOT_KEPT
    text = f"compd compiles kernels ({how_often}): {function.__name__}"
    # overwritten by the next, and gone at the end; a line of 80 characters, since one that wraps would stay
    print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
    try:
        yield
    finally:
        print("\r\033[K", end="", file=sys.stderr, flush=True)


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
        with _kept(function) as kept:
            compiled = _guvectorize([tuple(arguments)], layout, nopython=True, cache=kept)(function)
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
        with _kept(function) as kept:
            compiled = njit([tuple(arguments)], error_model="numpy", cache=kept)(function)
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
