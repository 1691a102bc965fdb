"""Phrases of a diagnosis: each fact as a clause, for the sentence, the twelve lines, the terminal and the page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from compd.comparison.compare import Comparison
from compd.diagnosis.findings import ConstantFinding, DiagnosisStep, EmpiricalFinding, GrossRows
from compd.model.effect import Effect
from compd.model.formula.declaration import FormulaDeclaration
from compd.number_text import chance_text, estimate_text, estimates_text, join_words, number_text, percent_text

if TYPE_CHECKING:
    from compd.diagnosis.verdict import Diagnosis

# What a formula says of its physics where the person who wrote it said nothing.
_NO_PHYSICS = FormulaDeclaration.model_fields["physics"].default
# Effects that people know by another name than their id.
_PLAIN_NAMES = {"reference_registration": "the instrument's frame"}
# A parameter that has more values than this is said by its smallest and its largest.
MOST_VALUES = 3
# Single gross rows that are named.
MOST_ROWS = 6

HOW_TO_KNOW_NOISE = "measure one point twice (two rows with the same number in a `visit` column)"


def physics_clause(effect: Effect) -> str:
    """The first clause of what an effect does: "balls flatten where they touch"; of a formula without words, itself."""
    if effect.physics == _NO_PHYSICS:
        return effect.equation
    clause = re.split(r"[,;:.](?:\s|$)", effect.physics.strip(), maxsplit=1)[0]
    return clause if clause[1:2].isupper() else clause[:1].lower() + clause[1:]


def parameter_texts(step: DiagnosisStep, links: int) -> list[str]:
    """Each parameter with its standard error: "a = 1.113 +- 0.021 ppm/K"; one text for what there is one per link.

    An implausible number says so beside the range that its effect calls plausible.
    """
    texts = []
    columns = step.effect.columns(links)
    for parameter in step.effect.parameters:
        values = [
            value for column, value in zip(columns, step.parameters, strict=True) if column.parameter is parameter
        ]
        if not values:
            continue
        numbers = sorted(value.value for value in values)
        std = max(value.std for value in values)
        name = values[0].name if len(values) == 1 else f"{values[0].name} to {values[-1].name}"
        if len(values) == 1:
            text = estimate_text(numbers[0], std, values[0].unit)
        elif len(values) <= MOST_VALUES:
            text = estimates_text([value.value for value in values], std, values[0].unit)
        else:
            text = "between " + estimates_text([numbers[0], numbers[-1]], std, values[0].unit)
        if not all(value.plausible for value in values):
            text += f", IMPLAUSIBLE: {parameter.low:g} to {parameter.high:g} is usual"
        texts.append(f"{name} = {text}")
    return texts


def chance_clause(p_values: Sequence[float]) -> str:
    """How probable the least sure of so many results is by noise alone; "" where it is not known."""
    known = [p_value for p_value in p_values if p_value > 0]
    if not known:
        return ""
    return f"by chance {chance_text(max(known))}" if len(known) == 1 else f"each by chance {chance_text(max(known))} at most"


def followed_text(finding: EmpiricalFinding) -> str:
    """What a residual follows: "temperature_frame_degC (linear) together with humidity_pct"."""
    beside = f" together with {join_words(finding.beside)}" if finding.beside else ""
    return f"{finding.covariate} ({finding.form}){beside}"


def rivals_text(step: DiagnosisStep) -> str:
    """An effect and those that do as well in its place: "link_elasticity or joint_contact (99 % alike)"."""
    names = join_words([step.effect.id, *(rival.name for rival in step.rivals)], "or")
    return f"{names} ({percent_text(max(rival.cosine for rival in step.rivals))} alike)"


def change_text(finding: EmpiricalFinding, diagnosis: Diagnosis) -> str:
    """A change in the middle of a recording: "from 6000 s on (row 410) backlash is larger"."""
    recording = diagnosis.after.aligned.recording
    place = int(np.searchsorted(recording.time_s, finding.time_s))
    row = f" (row {recording.row[place]})" if place < recording.rows else ""
    return f"from {finding.time_s:.0f} s on{row} {finding.effect} {_how_it_changed(finding, diagnosis)}"


def _how_it_changed(finding: EmpiricalFinding, diagnosis: Diagnosis) -> str:
    fitted = next((fitted for fitted in diagnosis.after.fitted if fitted.effect.id == finding.effect), None)
    if fitted is None:
        return "acts, and before it did not"
    change = np.array([value for parameters in finding.parameters for value in parameters.values()])
    if change.shape != fitted.theta.shape or not np.isfinite(change).all():
        return "is another"
    return "is larger" if change @ fitted.theta > 0 else "is smaller"


def constant_text(constant: ConstantFinding, unit: str) -> str:
    """The constant with the effects that may make it: one family, of which these rows tell no member."""
    values = [number_text(value) for value in constant.by_axis_um.values()]
    size = f"({', '.join(values)}) {unit}" if len(values) > 1 else f"{values[0]} {unit}"
    if list(constant.by_axis_um) != ["x", "y", "z"]:
        size += f" in {', '.join(constant.by_axis_um)}"
    names = [_PLAIN_NAMES.get(name, name) for name in constant.effects]
    if not names:
        return f"a constant of {size}: where zero was set; it needs no cause"
    if len(names) == 1:
        return f"a constant of {size}, which {names[0]} can make"
    return f"a constant of {size}: {join_words(names, 'or')}; these rows cannot tell"


def gross_texts(gross: GrossRows, comparison: Comparison, unit: str) -> list[str]:
    """How many rows nothing explains, how far off they are, where they lie, and what to look at."""
    if not gross.rows:
        return []
    recording = comparison.aligned.recording
    size = np.abs(comparison.residual_um[np.isin(recording.row, gross.rows)])
    largest = float(np.nanmax(size)) if np.isfinite(size).any() else float("nan")
    off = f", off by up to {number_text(largest, unit)}" if np.isfinite(largest) else ""
    in_runs = {row for first, last in gross.runs for row in gross.rows if first <= row <= last}
    single = [row for row in gross.rows if row not in in_runs]
    texts = [f"{len(gross.rows)} of {recording.rows} rows do not count{off}"]
    if gross.runs:
        runs = join_words([f"{first} to {last}" for first, last in gross.runs])
        texts.append(f"look at what happened in rows {runs} (a bump, a slipped target, a lost step)")
    if single:
        rows = [str(row) for row in single[:MOST_ROWS]]
        others = [f"{len(single) - MOST_ROWS} more"] if len(single) > MOST_ROWS else []
        texts.append(f"single bad readings in row{'s' if len(single) > 1 else ''} {join_words([*rows, *others])}")
    return texts


def session_count(comparison: Comparison) -> int:
    """In how many sessions the rows that count were measured; 1 without a `session` column."""
    session = comparison.aligned.recording.session
    if session is None:
        return 1
    return len(np.unique(session[comparison.used & (session >= 0)]))


def is_thermal(effect: Effect) -> bool:
    """Whether a temperature, or time as its stand-in, drives the effect."""
    return any(need.startswith("temperature") for need in effect.needs) or effect.needs == ("time",)
