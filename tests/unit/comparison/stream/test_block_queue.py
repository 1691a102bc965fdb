"""Blocks on several threads: results in order, states from block to block, and no block that waits for ever."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from compd.comparison.stream.block_queue import HandOver, computed_blocks


def running_sum(block: int, hand_over: HandOver[int]) -> int:
    total = hand_over.take() + block
    hand_over.give(total)
    return total


def test_states_go_from_block_to_block_in_order() -> None:
    assert list(computed_blocks(range(50), running_sum, 100))[::10] == [100, 155, 310, 565, 920]


def test_an_error_of_one_block_ends_all() -> None:
    def compute(block: int, hand_over: HandOver[int]) -> int:
        if block == 3:
            raise ValueError("block 3")
        return running_sum(block, hand_over)

    with pytest.raises(ValueError, match="block 3"):
        list(computed_blocks(range(50), compute, 0))


def test_few_blocks_are_read_ahead() -> None:
    read = []

    def blocks() -> Iterator[int]:
        for block in range(100):
            read.append(block)
            yield block

    next(iter(computed_blocks(blocks(), running_sum, 0)))
    assert len(read) < 70
