"""Garbage collection during the loading of modules."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

# Objects above those of all modules: the daemon's make 240,000, compiling the kernels makes a million, mostly garbage.
_MORE_THAN_MODULES_MAKE = 400_000


@contextmanager
def loading() -> Iterator[None]:
    """A block with permanent objects, which the garbage collector skips in the block and later.

    That takes a fifth of a second of the start of `compd run`.
    """
    thresholds, collections = gc.get_threshold(), _collections()
    gc.set_threshold(_MORE_THAN_MODULES_MAKE)
    try:
        yield
    finally:
        if _collections() > collections:
            gc.collect()
        gc.freeze()
        gc.set_threshold(*thresholds)


def _collections() -> int:
    """Number of runs of the collector."""
    return sum(generation["collections"] for generation in gc.get_stats())
