"""Compile every kernel and leave, as a build does: `python -m compd.compile_kernels [DIRECTORY]`.

For this processor, or into DIRECTORY for each level of x86-64.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from compd.jit import kernel_sources
from compd.kernel_target import LEVELS


def kernel_modules() -> list[str]:
    """The names of all modules with kernels or helpers."""
    root = Path(__file__).parent.parent
    names = [".".join(file.relative_to(root).with_suffix("").parts) for file in kernel_sources()]
    return [name.removesuffix(".__init__") for name in names]


def compile_for_levels(directory: str) -> list[str]:
    """Compile all kernels for each level into `directory`, side by side. Returns the levels that failed."""
    command = [sys.executable, "-m", "compd.compile_kernels"]
    environment = os.environ | {"NUMBA_CACHE_DIR": directory, "NUMBA_CPU_FEATURES": ""}
    started = {level: subprocess.Popen(command, env=environment | {"NUMBA_CPU_NAME": level}) for level in LEVELS}
    return [level for level, process in started.items() if process.wait() != 0]


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit(" ".join(f"not compiled for {level}" for level in compile_for_levels(sys.argv[1])) or 0)
    for module in kernel_modules():
        import_module(module)
