"""Effects of a YAML list; a formula may be one per axis, `{x: ..., y: ...}`, with parameters that the axes share."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from compd.arrays import FloatArray
from compd.model.effect import ConstantValues, Effect, Memory
from compd.model.library import find_effect
from compd.model.observations import Observations


def effects_of_file(path: Path) -> list[Effect]:
    """Every effect of the file. Raises ConfigurationError for one that is faulty."""
    return [_effect(entry, str(path)) for entry in yaml.safe_load(path.read_text(encoding="utf-8"))]


def _effect(entry: Mapping[str, Any], where: str) -> Effect:
    if not isinstance(entry["formula"], Mapping):
        return find_effect(entry, where)
    parts = []
    for axis, formula in entry["formula"].items():
        used = {name: value for name, value in entry["parameters"].items() if re.search(rf"\b{name}\b", formula)}
        parts.append(find_effect({**entry, "axis": axis, "formula": formula, "parameters": used}, where))
    parameters = {parameter.name: parameter for part in parts for parameter in part.parameters}
    places = [[list(parameters).index(parameter.name) for parameter in part.parameters] for part in parts]

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[FloatArray, Memory]:
        values = [part.basis(rows, constants, None)[0] for part in parts]
        together = np.zeros((*values[0].shape[:2], len(parameters)))
        for value, columns in zip(values, places, strict=True):
            together[:, :, columns] += value
        return together, None

    return replace(
        parts[0],
        equation="; ".join(part.equation for part in parts),
        needs=tuple(dict.fromkeys(need for part in parts for need in part.needs)),
        parameters=tuple(parameters.values()),
        basis=basis,
    )
