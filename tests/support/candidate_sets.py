"""Candidates with columns of noise, so that what explains a residual is known by construction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis import Candidate, Criteria, SubsetLosses
from compd.diagnosis.search.regression import RegressionData, Regressors
from compd.model.library import load_library

ROWS, COORDINATES = 240, 3
BLOCKS, SESSIONS, SECTORS = 24, 4, 5
EFFECT = load_library()["link_expansion"]


def columns(seed: int, count: int = 1) -> FloatArray:
    """(ROWS, COORDINATES, count) unit noise."""
    return np.random.default_rng([seed, 17]).standard_normal((ROWS, COORDINATES, count))


def noise(seed: int, size: float = 1.0) -> FloatArray:
    """(ROWS, COORDINATES) noise."""
    return size * np.random.default_rng([seed, 18]).standard_normal((ROWS, COORDINATES))


def candidate(name: str, values: FloatArray, limit: float = 100.0, **others: Any) -> Candidate:
    """A candidate with columns (ROWS, COORDINATES, P), each number plausible up to the limit; others : its fields."""
    fields: dict[str, Any] = {"searched_parameters": 0, "effect": EFFECT, **others}
    limits = np.tile([-limit, limit], (values.shape[2], 1))
    return Candidate(name=name, columns_um=values, limits=limits, **fields)


def description(name: str, values: FloatArray) -> Candidate:
    """A term that names no cause."""
    return candidate(name, values, np.inf, kind="description")


def subset_losses(
    y: FloatArray,
    candidates: Sequence[Candidate] | Mapping[str, FloatArray],
    criteria: Criteria = Criteria(),
    least_loss: float = 1.0,
    nuisance: FloatArray | None = None,
) -> SubsetLosses:
    """Losses for a residual (ROWS, COORDINATES), whitened, split into sessions and sectors.

    candidates : or columns by name.  least_loss : 1 where the noise is known, else 0.
    """
    rows = np.arange(ROWS)
    splits = (rows * SESSIONS // ROWS, np.random.default_rng(99).integers(0, SECTORS, ROWS))
    beside = np.zeros((ROWS, COORDINATES, 0)) if nuisance is None else nuisance
    data = RegressionData(y, splits, rows * BLOCKS // ROWS, Regressors(beside, np.full(beside.shape[2], np.inf)), rows)
    if isinstance(candidates, Mapping):
        candidates = [candidate(name, values) for name, values in candidates.items()]
    return SubsetLosses(data, candidates, [each.columns_um for each in candidates], criteria, least_loss)


def names(losses: SubsetLosses, members: Sequence[int]) -> set[str]:
    """Names of some candidates."""
    return {losses.name(k) for k in members}
