"""Compile every kernel and leave, as a build does: `python -m compd.compile_kernels [DIRECTORY]`.

For this processor, in two processes, or into DIRECTORY for each level of x86-64.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

from compd.jit import kernel_sources
from compd.kernel_target import LEVELS


def kernel_modules() -> list[str]:
    """The names of all modules with kernels or helpers."""
    root = Path(__file__).parent.parent
    names = [".".join(file.relative_to(root).with_suffix("").parts) for file in kernel_sources()]
    return [name.removesuffix(".__init__") for name in names]


def compile_all(backwards: bool = False) -> None:
    """Compile all kernels that are not compiled yet, in this process; another one may begin at the other end."""
    names = kernel_modules()
    for name in reversed(names) if backwards else names:
        import_module(name)


def compile_for_levels(directory: str) -> list[str]:
    """Compile all kernels for each level into `directory`, side by side. Returns the levels that failed."""
    environment = {"NUMBA_CACHE_DIR": directory, "NUMBA_CPU_FEATURES": ""}
    started = {level: _started("compile_all()", environment | {"NUMBA_CPU_NAME": level}) for level in LEVELS}
    return [level for level, process in started.items() if process.wait() != 0]


def _started(call: str, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """Another process in which one of these functions is called."""
    code = f"from compd.compile_kernels import *; {call}"
    return subprocess.Popen([sys.executable, "-c", code], env=os.environ | environment)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit(" ".join(f"not compiled for {level}" for level in compile_for_levels(sys.argv[1])) or 0)
    other = _started("compile_all(backwards=True)", {})
    compile_all()
    sys.exit(other.wait())
