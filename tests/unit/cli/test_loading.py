"""While modules load the collector lets them be; afterwards it is as before."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from compd.cli.loading import loading


@pytest.fixture(autouse=True)
def thawed() -> Iterator[None]:
    yield
    gc.unfreeze()


class Cyclic:
    """An object that only the collector frees; `freed` counts."""

    freed = 0

    def __init__(self) -> None:
        self.itself = self

    def __del__(self) -> None:
        Cyclic.freed += 1


def test_the_collector_is_as_before_also_after_a_module_that_cannot_be_loaded():
    before = gc.get_threshold()
    with loading():
        assert gc.get_threshold() != before
    assert gc.get_threshold() == before
    with pytest.raises(ImportError), loading():
        raise ImportError
    assert gc.get_threshold() == before


def test_what_is_loaded_is_looked_through_neither_then_nor_later():
    gc.collect()  # so that none is due
    collections = gc.get_stats()
    with loading():
        loaded = [[] for _ in range(50_000)]
    assert gc.get_stats() == collections
    assert gc.get_freeze_count() >= len(loaded)


@pytest.mark.long
def test_garbage_of_a_compilation_is_not_kept():
    Cyclic.freed = 0
    with loading():
        for _ in range(900_000):
            Cyclic()
    assert Cyclic.freed == 900_000
