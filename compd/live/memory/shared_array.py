"""Numbers in memory that forked processes share."""

from __future__ import annotations

import mmap

import numpy as np
import numpy.typing as npt


def shared_memory(size: int) -> mmap.mmap:
    """`size` bytes, zero at first, which every process that is forked from now on has in common.

    The memory has no name: nothing is left behind when the processes end, however they end.
    """
    return mmap.mmap(-1, size)


def shared_floats(count: int) -> npt.NDArray[np.float64]:
    """`count` numbers, 0.0 at first. Each is written and read whole: it is 8 bytes, aligned."""
    return np.frombuffer(shared_memory(8 * count), dtype=np.float64)


def shared_counters(count: int) -> memoryview:
    """`count` whole numbers from 0 to 2**64 - 1, 0 at first. Each is written and read whole: it is 8 bytes, aligned."""
    return memoryview(shared_memory(8 * count)).cast("Q")
