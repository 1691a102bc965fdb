"""Compile every kernel and leave: `python -m compd.compile_kernels`, as a build does for each level of processors."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from compd.jit import kernel_sources


def kernel_modules() -> list[str]:
    """The names of all modules with kernels or helpers."""
    root = Path(__file__).parent.parent
    names = [".".join(file.relative_to(root).with_suffix("").parts) for file in kernel_sources()]
    return [name.removesuffix(".__init__") for name in names]


if __name__ == "__main__":
    for module in kernel_modules():
        import_module(module)
