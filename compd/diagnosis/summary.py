"""The verdict in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from compd.diagnosis.verdict import Diagnosis


def summary(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences."""
    floor = in_um(diagnosis.before.floor.um)
    noise = f"where noise alone is {floor}"
    before, after = in_um(diagnosis.before.rms_um), in_um(diagnosis.after.rms_um)
    error = f"the error of {before}"
    names = _joined([step.effect.id for step in diagnosis.steps])
    match diagnosis.verdict:
        case "adequate":
            return f"Nothing is missing: {error} is the measurement's own noise ({floor})."
        case "identified":
            with_them = "with it" if len(diagnosis.steps) == 1 else "with them"
            return f"What is missing is {names}: {with_them} {error} falls to {after}, {noise}."
        case "ambiguous":
            pairs = "; ".join(
                f"{step.effect.id} or {_joined([rival.name for rival in step.rivals], 'or')}"
                for step in diagnosis.steps
                if step.rivals
            )
            return (
                f"With {names} {error} falls to {after}, {noise}. But this recording cannot tell apart: "
                f"{pairs}. The rows under 'next' can."
            )
        case "not_testable":
            return f"{_capitalized(error)} is above the noise of {floor}, but no effect can be tested on it."
    if diagnosis.steps:
        subject = f"{_capitalized(names)} explains a part ({before} -> {after}). The rest"
    else:
        subject = _capitalized(error)
    if not diagnosis.depends_on:
        return (
            f"{subject} has no cause in the library and follows nothing that was measured: {after} are left, {noise}."
        )
    first = diagnosis.depends_on[0]
    follows = _joined([first.covariate, *first.beside])
    left = in_um(first.heldout_rms_um)
    return f"{subject} has no cause in the library. It follows {follows}: to describe that leaves {left}, {noise}."


def in_um(value: float) -> str:
    """A length with two figures and without powers of ten: "0.12 um"."""
    return f"{value:.0f} um" if value >= 100 else f"{value:.2g} um"


def _joined(names: Sequence[str], word: str = "and") -> str:
    return f" {word} ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]
