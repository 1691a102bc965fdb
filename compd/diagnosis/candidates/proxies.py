"""Effects whose thermometer is missing, tried with every thermometer that there is in its place.

Such an effect cannot be named: its own temperature was not measured. But parts of one machine warm up together, and
what it does would else be taken for another effect that is driven by the neighbour's temperature.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.candidates import Candidate, searched_parameters, variant
from compd.model.effects import Effect, needed_quantities, unmet_needs

_PREFIX = "temperature_"
ZERO_DEGC_K = 273.15


@dataclass(frozen=True, eq=False)
class ProxyCandidate(Candidate):
    """An effect computed from another part's temperature.

    quantity : the column that stands for the missing ones.  missing : these.
    """

    quantity: str = ""
    missing: tuple[str, ...] = ()


def proxy_candidates(
    aligned: AlignedRecording,
    effects: Sequence[Effect],
    present: Collection[str],
    criteria: CandidateCriteria = CandidateCriteria(),
) -> tuple[ProxyCandidate, ...]:
    """Every effect that lacks nothing but thermometers, with each thermometer of the recording in their place.

    present : ids of the model's effects, which are left out.
    """
    rows, usable = aligned.gaps_filled.rows, aligned.usable.mask
    zero_of = {
        name: offset
        for name, values in rows.quantities.items()
        if (rows.quantities_at_zero is None or name in rows.quantities_at_zero)
        and np.isfinite(values[usable]).all()
        and np.ptp(values[usable]) > 0
        and (offset := _zero_degC(name, values[usable], criteria)) is not None
    }
    candidates: list[ProxyCandidate] = []
    for effect in effects:
        missing = tuple(name for name in needed_quantities(effect, rows.links) if name not in rows.quantities)
        at_zero = rows.quantities_at_zero
        known_at_zero = None if at_zero is None else {*at_zero, *missing}
        lacks = unmet_needs(effect, rows.available | set(missing), rows.links, known_at_zero)
        if effect.id in present or lacks or not missing or not all(name.startswith(_PREFIX) for name in missing):
            continue
        for thermometer, zero in zero_of.items():
            measured = rows.quantities[thermometer] - zero
            quantities = {**rows.quantities, **dict.fromkeys(missing, measured)}
            if at_zero is not None:
                at_zero = {**at_zero, **dict.fromkeys(missing, at_zero[thermometer] - zero)}
            substituted = replace(aligned, rows=replace(rows, quantities=quantities, quantities_at_zero=at_zero))
            grid = effect.constant_grid(rows)
            searched = searched_parameters(effect, grid, criteria) + criteria.searched_constant
            for constants in grid:
                candidate = variant(effect, constants, substituted, searched)
                candidates.append(
                    ProxyCandidate(
                        f"{effect.id} by proxy",
                        effect,
                        candidate.columns_um,
                        candidate.limits,
                        searched,
                        constants,
                        "proxy",
                        thermometer,
                        missing,
                    )
                )
    return tuple(candidates)


def _zero_degC(name: str, values: FloatArray, criteria: CandidateCriteria) -> float | None:
    """What a thermometer's column shows at 0 degC, by its unit; None for a column that is no thermometer's."""
    if name.startswith(_PREFIX) or name.endswith("_degC"):
        return 0.0
    return ZERO_DEGC_K if name.endswith("_K") and values.min() >= criteria.coldest_K else None
