"""A diagnosis for a browser: the twelve lines, then the evidence of each effect, in the words of the report."""

from __future__ import annotations

from typing import Any

from compd.diagnosis import Diagnosis, DiagnosisStep, ErrorFall, error_fall, summary_lines
from compd.report.diagnosis_evidence import (
    by_noise_text,
    candidates_table,
    constant_table,
    described_by,
    explains_text,
    findings_table,
    formula_texts,
    next_table,
    plan_command,
    untested_table,
    without_gain,
    wrong_data,
)
from compd.report.page_table import PageTable
from compd.text import estimate_text, fall_text, nan_to_null, number_text, percent_text


def evidence(diagnosis: Diagnosis) -> dict[str, Any]:
    """Plain data: `verdict`, `lines`, `effects`, tables of other findings, and the next measurement.

    A table is `head`, `rows` and `caption`; None if there is nothing to tell.
    """
    fall = error_fall(diagnosis)
    plain: dict[str, Any] = nan_to_null(
        {
            "verdict": diagnosis.verdict,
            "lines": summary_lines(diagnosis, on_page=True),
            "effects": [_effect(number, diagnosis, fall) for number in range(len(diagnosis.steps))],
            "follows": _table(findings_table(diagnosis, fall)),
            "formulas": _formulas(diagnosis),
            "constant": _table(constant_table(diagnosis, fall)),
            "gross": "; ".join(wrong_data(diagnosis, fall)),
            "tried": _table(candidates_table(diagnosis, fall)),
            "without_gain": without_gain(diagnosis),
            "untested": _table(untested_table(diagnosis)),
            "next": _table(next_table(diagnosis)),
        }
    )
    return plain


def _effect(number: int, diagnosis: Diagnosis, fall: ErrorFall) -> dict[str, Any]:
    """A named effect; number : from 0."""
    step = diagnosis.steps[number]
    before = fall.before if number == 0 else fall.steps[number - 1]
    with_all = "with it" if len(diagnosis.steps) == 1 else "with all that is named"
    on_all = fall_text([diagnosis.before.rms_um, diagnosis.after.rms_um], fall.unit)
    return {
        "effect": step.effect.id,
        "physics": step.effect.physics,
        "equation": step.effect.equation,
        "numbers": _numbers(step, diagnosis.after.aligned.rows.links),
        "facts": [
            ["error, rows left out", fall_text([before, step.heldout_rms_um], fall.unit)],
            ["error, all rows", f"{on_all}, {with_all}"],
            ["explains", explains_text(step, fall)],
            ["by noise alone", by_noise_text(step)],
        ],
        "rivals": [{"effect": rival.name, "alike": percent_text(rival.cosine)} for rival in step.rivals],
        "separated_by": step.effect.separated_by,
        "plan_command": plan_command(diagnosis, step) if step.rivals else "",
    }


def _numbers(step: DiagnosisStep, links: int) -> list[dict[str, Any]]:
    """Fitted numbers with standard errors and plausible ranges; searched constants."""
    fitted = [
        {
            "name": estimate.name,
            "text": estimate_text(estimate.value, estimate.std, estimate.unit),
            "range": f"{column.parameter.low:g} to {column.parameter.high:g} {estimate.unit}",
            "plausible": estimate.plausible,
        }
        for column, estimate in zip(step.effect.columns(links), step.parameters, strict=True)
    ]
    units = {constant.name: constant for constant in step.effect.constants}
    searched = [
        {
            "name": name,
            "text": f"{number_text(value, units[name].unit, 3)}, searched",
            "range": f"{units[name].low:g} to {units[name].high:g} {units[name].unit}",
            "plausible": True,
        }
        for name, value in step.fitted.constants.items()
    ]
    return fitted + searched


def _formulas(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The best description of the rest: `declaration` for `add_effect`, and `text` for a file of effects."""
    finding = described_by(diagnosis)
    declarations = () if finding is None else finding.formula_effects
    return [
        {"id": declaration["id"], "declaration": dict(declaration), "text": text}
        for declaration, text in zip(declarations, formula_texts(diagnosis), strict=True)
    ]


def _table(table: PageTable | None) -> dict[str, Any] | None:
    if table is None or not table.rows:
        return None
    return {"head": list(table.head), "rows": [list(row) for row in table.rows], "caption": table.caption}
