"""The library: one file per port, one entry per physical cause. Anybody's effects are found the same way as drivers:
by entry point (`compd.effects`), by path, or written as a formula."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from compd.errors import PluginError, Problem
from compd.model.effect import Effect
from compd.model.formula.declaration import formula_effect
from compd.model.library import base_joint, frame, joint, link, platform_joint, reference, scale, tool
from compd.plugins import EFFECTS, load, names

# Along the way of the datum: readings, links, joints, tool, and what the reference instrument adds.
BUNDLED: tuple[Effect, ...] = (
    *scale.EFFECTS,
    *joint.EFFECTS,
    *frame.EFFECTS,
    *link.EFFECTS,
    *base_joint.EFFECTS,
    *platform_joint.EFFECTS,
    *tool.EFFECTS,
    *reference.EFFECTS,
)


def library() -> dict[str, Effect]:
    """Every effect that is installed, by id: the bundled ones, then those of other packages.

    Raises PluginError where a package's effect cannot be loaded, is no Effect, or takes an id that is in use.
    """
    found = {effect.id: effect for effect in BUNDLED}
    for name in names(EFFECTS):
        where = f"entry point {name} in {EFFECTS}"
        effect = _checked(load(EFFECTS, name, where), where)
        if effect.id in found:
            raise PluginError(
                Problem(
                    where=where,
                    what="this id is taken",
                    value=effect.id,
                    allowed="an id of its own",
                    next_step="rename it, or remove the package",
                )
            )
        found[effect.id] = effect
    return found


def find(declaration: str | Mapping[str, Any], where: str) -> Effect:
    """An effect by its id, as /absolute/file.py:NAME, or written out as a formula.

    where : the place in the person's file, for errors.  Raises PluginError, or ConfigurationError for a formula.
    """
    if not isinstance(declaration, str):
        return formula_effect(declaration, where)
    if ":" in declaration:
        return _checked(load(EFFECTS, declaration, where), where)
    known = library()
    if declaration not in known:
        raise PluginError(
            Problem(
                where=where,
                what="no such effect",
                value=declaration,
                allowed=", ".join(known),
                next_step="choose one of these, write /absolute/file.py:NAME, or write a formula",
            )
        )
    return known[declaration]


def _checked(thing: Any, where: str) -> Effect:
    if not isinstance(thing, Effect):
        raise PluginError(
            Problem(
                where=where,
                what="is not an effect",
                value=type(thing).__name__,
                allowed="an object of compd.model.effect.Effect",
            )
        )
    return thing
