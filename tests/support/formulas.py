"""Formula effects for tests, written as a person would."""

from __future__ import annotations

from typing import Any

from compd.model.effects import Effect
from compd.model.formula import formula_effect


def written(formula: str | dict[str, str], port: str = "link", parameters: str = "k", **more: Any) -> Effect:
    """An effect with parameters of one letter each, plausible from 1 to 100."""
    declared = {name: {"unit": "um", "plausible": [1, 100], "source": "notes"} for name in parameters.split()}
    return formula_effect({"id": "mine", "port": port, "formula": formula, "parameters": declared, **more}, "a.yaml:7")
