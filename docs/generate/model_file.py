"""The page of the model file and of the declaration of an effect by a formula."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from compd.model.effects import FittedEffect
from compd.model.formula import (
    ANYWHERE,
    FUNCTIONS,
    LAG,
    OF_LINK,
    OF_READING,
    PER_LINK,
    FormulaDeclaration,
    formula_effect,
)
from compd.model.formula.columns import READING_PORTS
from compd.model.formula.keys import FormulaParameter
from compd.model.formula.parser import ALLOWED, DEEPEST, MAX_EXPONENT
from compd.model.library import find_effect
from compd.model_file import ModelFile, ModelStep
from compd.model_file.model_document import EffectEntry, ModelDocument, ParameterEntry
from docs.generate.markdown import code, codes, escape, fence, heading, join, link, table, term
from docs.generate.schema import ModelSchema, default_text

INTRODUCTION = f"""\
The {term("model file")} holds what a machine has beyond its geometry: its effects with their fitted parameters, and
every step by which they came to be. `compd model add`, `remove`, `fit` and `undo` write it; `compd compare --model`,
`compd diagnose --model` and the daemon (`state.model_file`, `compd model adopt`) read it. It is written whole or not at
all.
"""
FORMULA = """\
An effect that the library lacks can be written as a formula, without code, in a YAML file of its own that `compd model
add FILE.yaml` takes, or under `effect:` in the model file. It is linear in what is fitted: every term holds a parameter
as a factor. A parameter in which the formula is not linear becomes a constant, and is searched within its plausible
range.
"""
NAMES = f"""\
Allowed are {escape(ALLOWED)}. A name that is no parameter is a column. A column `reference_...` is refused, because an
effect must never see the answer. A formula nests at most {DEEPEST} levels deep, and an exponent is a number up to
{MAX_EXPONENT:g} or a parameter.
"""
# A formula of a user, checked by `formula_effect` when the page is made.
EXAMPLE = {
    "id": "granite_swelling",
    "port": "link",
    "formula": "k * (humidity_pct - 50)",
    "parameters": {"k": {"unit": "um", "plausible": [-1, 1], "source": "notes on this machine, 2026-11"}},
}
_NESTED: dict[str, tuple[str, str]] = {
    "EffectEntry": ("effects", "model-file-effects"),
    "ParameterEntry": ("parameters", "model-file-parameters"),
    "ModelStep": ("steps", "model-file-steps"),
    "FormulaParameter": ("parameters", "model-file-formula-parameters"),
}


def page() -> str:
    """Markdown, from the models that check both kinds of file."""
    formula_effect(EXAMPLE, "the reference's example")
    columns = [
        [code(name), f"ports {codes(ports)}" if ports else "all ports", escape(meaning)]
        for names, ports in ((ANYWHERE, ()), (OF_LINK, PER_LINK), (OF_READING, READING_PORTS))
        for name, meaning in names.items()
    ]
    columns.append(["`NAME_UNIT`", "all ports", "a measured quantity, such as `humidity_pct`"])
    functions = [(function.call, function.meaning) for function in FUNCTIONS.values()]
    return join(
        "# Model file",
        INTRODUCTION,
        "For example:",
        fence(_example_file(), "yaml"),
        _keys(ModelDocument),
        heading(2, "`effects`", "model-file-effects"),
        _keys(EffectEntry),
        heading(3, "`parameters`", "model-file-parameters"),
        _keys(ParameterEntry),
        heading(2, "`steps`", "model-file-steps"),
        _keys(ModelStep),
        heading(2, "An effect as a formula", "model-file-formula"),
        FORMULA,
        fence(yaml.safe_dump(EXAMPLE, sort_keys=False, default_flow_style=None), "yaml"),
        _keys(FormulaDeclaration),
        heading(3, "Parameters of a formula", "model-file-formula-parameters"),
        _keys(FormulaParameter),
        heading(3, "What a formula may hold"),
        NAMES,
        table(["column", "where", "meaning"], columns),
        table(["function", "meaning"], [[code(call), escape(meaning)] for call, meaning in [*functions, LAG]]),
    )


def _example_file() -> str:
    """A file with one effect, as it is written."""
    sag = FittedEffect(find_effect("link_sag", "the reference's example"), np.array([1.2]), {"n": 3.0})
    file = ModelFile("tripod-cmm", 3, ("link_sag",), (sag,), np.array([[0.01]]), geometry="9f3a61c0b2d4e875")
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "model.yaml"
        file.write(path)
        return path.read_text(encoding="utf-8")


def _keys(kind: Any) -> str:
    keys = ModelSchema(kind, lambda model: link(*_NESTED[model])).keys()
    return table(
        ["key", "value", "default", "meaning"],
        [[code(key.name), key.type_text, default_text(key), key.meaning] for key in keys],
    )
