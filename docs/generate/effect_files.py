"""The page of the files of effects that come with compd for machines whose kinematics it does not know."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

from compd.configuration import shipped_effects
from compd.model.effects import Constant, Effect, Parameter
from compd.model.library import load_effects
from docs.generate.markdown import code, escape, fence, heading, join, link, sentence, table, target

PAGE = "effect-files"
INTRODUCTION = """\
The effects of a machine whose kinematics compd does not know (`machine: external` in its recordings) stand in files, as
formulas in columns of the recording. These files come with compd: `--effects NAME` gives one to `compd diagnose`,
`effect` and `plan`. [Diagnose a telescope](../how-to/diagnose-a-telescope.md),
[a linear axis](../how-to/diagnose-a-linear-axis.md) and [a drilled plate](../how-to/diagnose-a-drilled-plate.md) show
their use. For a file of your own, copy one from `config/effects/` of the source, change it and give it as
`--effects FILE.yaml`; [Model file](model-file.md) has every key.

A formula is what its effect adds to the prediction, in um. Each parameter is fitted, in its own unit; one that is no
factor of a term, such as a period or a time constant, is searched.
"""


def page() -> str:
    """Markdown, from the files."""
    return join("# Effects for other machines", INTRODUCTION, *map(_file, shipped_effects().values()))


def _file(path: Path) -> str:
    """One file: its own introduction, and its effects."""
    effects = load_effects(path).values()
    return join(
        heading(2, code(path.stem), target(PAGE, path.stem)), fence(_introduction(path)), *map(_effect, effects)
    )


def _introduction(path: Path) -> str:
    """The comment at the top of a file, as text."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return "\n".join(line[1:].removeprefix(" ") for line in takewhile(lambda line: line.startswith("#"), lines))


def _effect(effect: Effect) -> str:
    mistaken_for = ", ".join(link(code(other), target(PAGE, other)) for other in effect.mistaken_for)
    return join(
        heading(3, code(effect.id), target(PAGE, effect.id)),
        escape(effect.physics),
        code(effect.equation),
        table(
            ["parameter", "unit", "plausible", "where the range comes from"],
            map(_number, (*effect.parameters, *effect.constants)),
        ),
        f"- **Mistaken for:** {mistaken_for}\n- **Separated by:** {escape(sentence(effect.separated_by))}",
    )


def _number(number: Parameter | Constant) -> list[str]:
    searched = " It is searched." if isinstance(number, Constant) else ""
    plausible = f"{number.low:g} to {number.high:g}"
    return [code(number.name), escape(number.unit), plausible, escape(sentence(number.source)) + searched]
