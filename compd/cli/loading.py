"""The time in which modules are loaded."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

# All modules of the daemon make 240,000 objects; to compile the kernels makes a million, most of them garbage.
_MORE_THAN_MODULES_MAKE = 400_000


@contextmanager
def loading() -> Iterator[None]:
    """A block whose objects stay, so that the garbage collector need not look through them, in the block or later.

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
    """How often the collector has run."""
    return sum(generation["collections"] for generation in gc.get_stats())
