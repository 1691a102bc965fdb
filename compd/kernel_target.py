"""The processor that kernels are compiled for: a level of x86-64, so that code of one computer runs on others."""

from __future__ import annotations

import hashlib
import platform
import sys
from typing import Any

import llvmlite.binding
import numba
from numba.core import config as numba_config
from numba.core.registry import cpu_target

# numba's types are not complete
_config: Any = numba_config
_cpu_target: Any = cpu_target

_V2 = frozenset({"cx16", "popcnt", "sahf", "sse3", "ssse3", "sse4.1", "sse4.2"})
# What a processor of each level has, by LLVM's names; the best first. Source: x86-64 psABI 1.0, table 3.1.
LEVELS = {
    "x86-64-v3": _V2 | {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"},
    "x86-64-v2": _V2,
}


def choose_target() -> None:
    """Have numba compile for the best level that this processor has.

    It stays with the processor itself where there is no such level, as on another architecture, and with the one that
    NUMBA_CPU_NAME or NUMBA_CPU_FEATURES names.
    """
    if _config.CPU_NAME is not None or _config.CPU_FEATURES is not None:
        return
    present = {name for name, has in llvmlite.binding.get_host_cpu_features().items() if has}
    level = next((level for level, needed in LEVELS.items() if needed <= present), None)
    if level is not None and platform.machine() in ("x86_64", "AMD64"):
        # no feature besides those of the level
        _config.CPU_NAME, _config.CPU_FEATURES = level, ""


def target_name() -> str:
    """What numba compiles for in this process: "x86-64-v3", or a processor with a hash of its instructions.

    Asked of the code generator itself: code that used numba before compd may have set it up for this processor.
    """
    _, name, features = _cpu_target.target_context.codegen().magic_tuple()
    return f"{name}-{hashlib.sha256(features.encode()).hexdigest()[:8]}" if features else str(name)


def compiler_name() -> str:
    """Whose compiled code fits: releases of Python, numba and LLVM, and the target."""
    python = f"py{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-numba{numba.__version__}-llvm{llvm_version()}-{target_name()}"


def llvm_version() -> str:
    """The release of LLVM, e.g. "20.1.8"."""
    return ".".join(map(str, llvmlite.binding.llvm_version_info))
