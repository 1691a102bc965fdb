"""A family of long tests, of which `make test` runs a sample and `make nightly` all."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from _pytest.mark import ParameterSet


def sampled(values: Iterable[Any], every: int) -> list[Any]:
    """Parameters of which one in `every` is run by `make test`, the first among them; the others are `long`.

    A plain tuple stands for several arguments.
    """
    return [value if k % every == 0 else _long(value) for k, value in enumerate(values)]


def _long(value: Any) -> ParameterSet:
    parameters = ParameterSet.extract_from(value, force_tuple=type(value) is not tuple)
    return pytest.param(*parameters.values, marks=[*parameters.marks, pytest.mark.long], id=parameters.id)
