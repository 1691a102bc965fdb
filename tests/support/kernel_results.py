"""Every compiled kernel at work: prints, for each, a hash of all that it was given and gave.

`python -m tests.support.kernel_results` in two installations of the same sources tells whether their kernels give the
same to the last bit.
"""

from __future__ import annotations

import hashlib
import importlib
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from compd import jit

_hashes: dict[str, Any] = {}
_calls: Counter[str] = Counter()


def _take(name: str, part: Any) -> None:
    """Add arrays and numbers to the kernel's hash; named tuples part by part."""
    if isinstance(part, tuple):
        for inner in part:
            _take(name, inner)
    else:
        _hashes[name].update(np.ascontiguousarray(part).tobytes())


def _watched(name: str, compiled: Callable[..., Any]) -> Callable[..., Any]:
    """The compiled function, whose arguments are taken as they are afterwards: loops write into them."""
    _hashes[name] = hashlib.sha256()

    def call(*arguments: Any, **options: Any) -> Any:
        result = compiled(*arguments, **options)
        _calls[name] += 1
        _take(name, arguments)
        if result is not None:
            _take(name, result)
        return result

    return call


def _watch(maker: Callable[..., Any]) -> Callable[..., Any]:
    """`jit.kernel` or `jit.loop`, whose functions are watched."""

    def declared(*declaration: Any) -> Callable[..., Any]:
        def compile_(function: Callable[..., Any]) -> Callable[..., Any]:
            plain = getattr(function, "py_func", function)
            return _watched(f"{plain.__module__}.{plain.__qualname__}", maker(*declaration)(function))

        return compile_

    return declared


def main() -> None:
    """Use everything, and print a line for each kernel: its name, its calls, its hash."""
    jit.kernel, jit.loop = _watch(jit.kernel), _watch(jit.loop)
    from compd.compile_kernels import kernel_modules

    for module in kernel_modules():
        importlib.import_module(module)
    # kernels get arrays whose contents do not matter: they are compiled now, so that these may be all zero
    vars(np).update(empty=np.zeros)
    from tests.support.kernel_uses import use_all_kernels

    use_all_kernels()
    for name, made in sorted(_hashes.items()):
        print(name, _calls[name], made.hexdigest()[:16])


if __name__ == "__main__":
    main()
