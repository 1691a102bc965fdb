"""All kernels of effects behind one function, so that a model's effects are data: which ones, with which numbers.

Compiled code needs to know every function that it calls. So the kernels of `compd.model.kernels.effects` are compiled
together, once for an installation, and adopting a model compiles nothing.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module
from typing import Any

from compd.jit import helper
from compd.model.kernels import effects
from compd.model.kernels.formula import set_formula_basis

FORMULA = 0


def _kernels() -> list[Any]:
    """The public helpers of all files of `compd.model.kernels.effects` that are defined there."""
    modules = [import_module(f"{effects.__name__}.{file.name}") for file in pkgutil.iter_modules(effects.__path__)]
    return [
        function
        for module in modules
        for name, function in vars(module).items()
        if getattr(function, "__module__", "") == module.__name__ and hasattr(function, "py_func") and name[0] != "_"
    ]


_KERNELS = _kernels()


def kernel_number(kernel: Any) -> int:
    """By which number `set_basis` knows a kernel of `compd.model.kernels.effects`."""
    return 1 + _KERNELS.index(kernel)


def _dispatcher() -> Any:
    """A function that calls the kernel of a number. Its text is written here, since a kernel cannot be looked up in a
    list of kernels: numba gives each function a type of its own."""
    text = [
        "def set_basis(number, row, machine, quantities, code, numbers, memory, basis):",
        "    if number == FORMULA:",
    ]
    text.append("        set_formula_basis(row, machine, quantities, code, numbers, memory, basis)")
    for kernel in _KERNELS:
        number = kernel_number(kernel)
        text += [
            f"    elif number == {number}:",
            f"        kernel_{number}(row, machine, quantities, numbers, memory, basis)",
        ]
    names = {f"kernel_{kernel_number(kernel)}": kernel for kernel in _KERNELS}
    scope: dict[str, Any] = {"FORMULA": FORMULA, "set_formula_basis": set_formula_basis, **names}
    exec("\n".join(text), scope)
    return helper(scope["set_basis"])


set_basis = _dispatcher()
