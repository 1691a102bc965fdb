"""Compile every kernel and leave, as a build does: `python -m compd.compile_kernels [DIRECTORY]`.

For this processor, in two processes, or into DIRECTORY for each level of x86-64.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from compd import jit
from compd.kernel_target import LEVELS


def kernel_modules() -> list[str]:
    """The names of all modules with kernels or helpers."""
    root = Path(__file__).parent.parent
    sources = [*jit.kernel_sources(), *jit.truth_kernel_sources()]
    names = [".".join(file.relative_to(root).with_suffix("").parts) for file in sources]
    return [name.removesuffix(".__init__") for name in names]


def compile_all(claims: str = "", smallest_first: bool = False) -> None:
    """Compile all kernels, those of the largest modules first.

    claims : a directory in which processes that share the work mark what they take. One of them begins with the
    largest, which takes half of the time, and the other with the smallest.
    """
    declared = _declared()
    for name, compile_ in reversed(declared) if smallest_first else declared:
        if claims:
            try:
                (Path(claims) / name).mkdir()
            except FileExistsError:
                continue
        compile_()


def _declared() -> list[tuple[str, Callable[[], Any]]]:
    """Every kernel by name, with what compiles it: modules are imported without compiling anything."""
    declared: list[tuple[int, str, Callable[[], Any]]] = []

    def postponed(maker: Callable[..., Any]) -> Callable[..., Any]:
        def declare(*declaration: Any) -> Callable[..., Any]:
            def keep(function: Any) -> Any:
                python = getattr(function, "py_func", function)
                size = Path(python.__code__.co_filename).stat().st_size
                name = f"{python.__module__}.{python.__qualname__}"
                declared.append((size, name, partial(maker(*declaration), function)))
                return function

            return keep

        return declare

    jit.kernel, jit.loop = postponed(jit.kernel), postponed(jit.loop)
    for module in kernel_modules():
        import_module(module)
    return [(name, compile_) for _, name, compile_ in sorted(declared, key=lambda kernel: kernel[:2], reverse=True)]


def compile_for_levels(directory: str) -> list[str]:
    """Compile all kernels for each level into `directory`, side by side. Returns the levels that failed."""
    environment = {"NUMBA_CACHE_DIR": directory, "NUMBA_CPU_FEATURES": ""}
    started = {level: _started("compile_all()", environment | {"NUMBA_CPU_NAME": level}) for level in LEVELS}
    return [level for level, process in started.items() if process.wait() != 0]


def _started(call: str, environment: Mapping[str, str], stderr: int | None = None) -> subprocess.Popen[bytes]:
    """Another process in which one of these functions is called."""
    code = f"from compd.compile_kernels import *; {call}"
    return subprocess.Popen([sys.executable, "-c", code], env=os.environ | environment, stderr=stderr)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit(" ".join(f"not compiled for {level}" for level in compile_for_levels(sys.argv[1])) or 0)
    with tempfile.TemporaryDirectory(prefix="compd-kernels-") as claims:
        other = _started(f"compile_all({claims!r}, smallest_first=True)", {}, stderr=subprocess.PIPE)
        compile_all(claims)
        _, said = other.communicate()
        # that it compiles has been said once
        sys.exit(said.decode() if other.returncode else 0)
