"""Blocks computed on all cores, in threads: kernels and NumPy let others run; results come in the order of the blocks.

What a block needs of the one before it (memories of effects) is handed over from block to block.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

BlockT = TypeVar("BlockT")
ResultT = TypeVar("ResultT")
StateT = TypeVar("StateT")


class HandOver(Generic[StateT]):
    """What goes from one block to the next.

    Blocks begin in their order, so that whoever waits here waits for a block that is being computed.
    """

    def __init__(self, before: Future[StateT], after: Future[StateT]) -> None:
        self._before, self._after = before, after

    def take(self) -> StateT:
        """What the block before has given; waits for it."""
        return self._before.result()

    def give(self, state: StateT) -> None:
        """For the next block."""
        self._after.set_result(state)

    def fail(self, error: BaseException) -> None:
        """No block after this one is to wait for ever."""
        if not self._after.done():
            self._after.set_exception(error)


def computed_blocks(
    blocks: Iterable[BlockT], compute: Callable[[BlockT, HandOver[StateT]], ResultT], first: StateT
) -> Iterator[ResultT]:
    """The result of each block, in order; at most two blocks more than cores are in memory.

    compute : of a block; calls `take` and then `give` of its hand-over once.  first : what the first block takes.
    """
    cores = len(os.sched_getaffinity(0))
    before: Future[StateT] = Future()
    before.set_result(first)
    running: deque[Future[ResultT]] = deque()
    with ThreadPoolExecutor(cores, thread_name_prefix="block") as pool:
        for block in blocks:
            after: Future[StateT] = Future()
            running.append(pool.submit(_computed, compute, block, HandOver(before, after)))
            before = after
            if len(running) > cores:
                yield running.popleft().result()
        while running:
            yield running.popleft().result()


def _computed(
    compute: Callable[[BlockT, HandOver[StateT]], ResultT], block: BlockT, hand_over: HandOver[StateT]
) -> ResultT:
    try:
        return compute(block, hand_over)
    except BaseException as error:
        hand_over.fail(error)
        raise
