"""The library of effects: one file per port, one entry in its EFFECTS per physical cause.

To add an effect, write its entry into the file of its port (PORT.py, a new one where it has none yet), a test of its
physics (tests/unit/library/test_physics.py), and a hidden cause of the same id in compd/simulation/causes; nothing else
names it. Effects of other people are found as drivers are, by entry point (`compd.effects`) or by path, or written as
formulas (`effects_file.py`).
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from compd.errors import PluginError
from compd.model.effects import PORTS, Effect
from compd.model.formula import formula_effect
from compd.model.library.drawing import DRAWN
from compd.plugins import EFFECTS, OWN_CODE, Code, load, names

_PORT_FILES = {module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)])}

# In the order of the kinematics: readings, links, joints, tool, and what the reference instrument adds.
BUNDLED: tuple[Effect, ...] = tuple(
    effect for port in PORTS if port in _PORT_FILES for effect in import_module(f"{__package__}.{port}").EFFECTS
)


def load_library() -> dict[str, Effect]:
    """Every effect that is installed, by id: the bundled ones, then those of other packages.

    Raises PluginError where a package's effect cannot be loaded, is no Effect, or takes an id that is in use.
    """
    effects = {effect.id: effect for effect in BUNDLED}
    for name in names(EFFECTS):
        where = f"entry point {name} in {EFFECTS}"
        effect = _require_effect(load(EFFECTS, name, where), where)
        if effect.id in effects:
            raise PluginError.of(
                where,
                "this id is taken",
                value=effect.id,
                allowed="an id of its own",
                next_step="rename it, or remove the package",
            )
        effects[effect.id] = effect
    return effects


def find_effect(
    declaration: str | Mapping[str, Any],
    where: str,
    given: Mapping[str, Effect] | None = None,
    code: Code = OWN_CODE,
) -> Effect:
    """An effect by its id, as /absolute/file.py:NAME, or written out as a formula.

    where : the place in the person's file, for errors.  given : effects beside those of the library, by id.
    code : which Python files may be executed; by default a person's own.
    Raises PluginError, or ConfigurationError for a formula.
    """
    if not isinstance(declaration, str):
        return formula_effect(declaration, where)
    if ":" in declaration:
        effect = _require_effect(load(EFFECTS, declaration, where, code), where)
        return effect if effect.declared else replace(effect, declared=declaration)
    effects = {**{effect.id: effect for effect in DRAWN}, **load_library(), **(given or {})}
    if declaration not in effects:
        raise PluginError.of(
            where,
            "no such effect",
            value=declaration,
            allowed=", ".join(effects),
            next_step="choose one of these, name a file of your own (FILE.yaml:ID), or write a formula",
        )
    return effects[declaration]


def _require_effect(thing: Any, where: str) -> Effect:
    """The loaded object, if it is an Effect; else PluginError."""
    if not isinstance(thing, Effect):
        raise PluginError.of(
            where,
            "is not an effect",
            value=type(thing).__name__,
            allowed="an object of compd.model.effects.effect.Effect",
        )
    return thing
