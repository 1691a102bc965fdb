"""Worlds that fail for a known reason, each with the issue that mends it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import yaml

from tests.worlds.watch import Finding

if TYPE_CHECKING:
    from tests.worlds.command import Order

FILE = Path(__file__).with_name("known.yaml")


class Known(NamedTuple):
    """what : name of the invariant. issue : that mends it. seed, rates : of the world; plan : name of a kept plan."""

    what: str
    issue: int
    seed: int | None = None
    rates: str = "campaign"
    plan: str = ""

    @classmethod
    def of(cls, order: Order, finding: Finding, known: Sequence[Self]) -> Self | None:
        """The entry that a finding of a seed belongs to."""
        for entry in known:
            if (entry.seed, entry.rates, entry.what) == (order.seed, order.rates, finding.what):
                return entry
        return None


def known_worlds(path: Path = FILE) -> list[Known]:
    """Every entry of the list."""
    return [Known(**row) for row in yaml.safe_load(path.read_text(encoding="utf-8")) or []]
