"""The evidence of a diagnosis as tables and text, the same on the page and in the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import yaml

from compd.diagnosis import (
    Diagnosis,
    DiagnosisStep,
    EmpiricalFinding,
    ErrorFall,
    change_text,
    data_texts,
    parameter_texts,
    short_name,
    untested_here,
)
from compd.plan_file import PURPOSE_COLUMN
from compd.report.page_table import PageTable
from compd.text import chance_text, estimate_text, fall_text, number_text, percent_text

Row = Mapping[str, Any]

_APPROACH = "approach_"
# Suffixes of columns that are units, the longer ones first.
_UNITS = ("mm_per_s", "degC", "deg", "rad", "pct", "mm", "um", "N", "s")


def planned_rows_table(rows: Sequence[Row]) -> PageTable:
    """The rows of a plan with their numbers of repeats; the caption has the constant columns."""
    counted = _counted([_with_one_approach(row) for row in rows])
    names = list(dict.fromkeys(name for row, _ in counted for name in row))
    texts = {name: _column_texts([row.get(name, "") for row, _ in counted]) for name in names}
    constant = [name for name in names if len(set(texts[name])) == 1 and name != PURPOSE_COLUMN]
    changing = [name for name in names if name not in constant]
    head = [_head(name) for name in changing]
    columns = [texts[name] for name in changing]
    if any(count > 1 for _, count in counted):
        head.append("times")
        columns.append([str(count) for _, count in counted])
    # a time of 0 everywhere is omitted: no row waits for another
    held = [f"{_head(name)} {texts[name][0]}" for name in constant if (name, texts[name][0]) != ("time_s", "0")]
    caption = f"The same in every row: {'; '.join(held)}." if held else ""
    return PageTable(head, list(zip(*columns, strict=True)), caption)


def _with_one_approach(row: Row) -> dict[str, Any]:
    """The row without its number, and with the directions of all links in one cell."""
    kept = {name: value for name, value in row.items() if name != "row" and not name.startswith(_APPROACH)}
    signs = [f"{int(value):+d}" if value else "0" for name, value in row.items() if name.startswith(_APPROACH)]
    if signs:
        kept["approach"] = " ".join(signs)
    return kept


def _counted(rows: Sequence[dict[str, Any]]) -> list[tuple[dict[str, Any], int]]:
    """Each row with its count: in any order if no row waits for another, else in sequence."""
    if any(row.get("time_s", 0) for row in rows):
        return [(row, len(list(same))) for row, same in groupby(rows)]
    different: list[dict[str, Any]] = []
    for row in rows:
        if row not in different:
            different.append(row)
    return [(row, rows.count(row)) for row in different]


def _column_texts(values: Sequence[Any]) -> list[str]:
    """Numbers of one column with equal decimals, as many as the finest needs."""
    if any(isinstance(value, str) for value in values):
        return [str(value) for value in values]
    decimals = max(len(f"{value:.3f}".rstrip("0").partition(".")[2]) for value in values)
    return [f"{value + 0.0:.{decimals}f}" for value in values]


def _head(name: str) -> str:
    """A column's name as people write it: "tip x, mm"."""
    unit = next((unit for unit in _UNITS if name.endswith(f"_{unit}")), "")
    stem = name.removesuffix(f"_{unit}") if unit else name
    return f"{stem.replace('_', ' ')}, {unit.replace('_per_', '/')}" if unit else name


# Width (columns) of the YAML in a page and a terminal: unbroken lines can be copied.
YAML_WIDTH = 76
# Most gross rows in the list.
GROSS_ROWS = 40
# Digits of a nonlinear constant; a period is searched to better than a thousandth.
CONSTANT_DIGITS = 4


def step_rows(number: int, diagnosis: Diagnosis, fall: ErrorFall) -> list[tuple[str, str]]:
    """An effect's equation, numbers, share and rivals; number : of the step, from 0."""
    step = diagnosis.steps[number]
    links = diagnosis.after.aligned.rows.links
    before = fall.before if number == 0 else fall.steps[number - 1]
    rows = [("equation", step.effect.equation)]
    rows += parameter_texts(step, links).items()
    rows += [
        ("error, rows left out", fall_text([before, step.heldout_rms_um], fall.unit)),
        ("explains", explains_text(step, fall)),
        ("by noise alone", by_noise_text(step)),
        ("rivals", _rivals(step)),
        ("told apart by", step.effect.separated_by),
    ]
    return rows


def explains_text(step: DiagnosisStep, fall: ErrorFall) -> str:
    """The share of the error that an effect takes away of what those before it left."""
    above = " above noise" if fall.noise_known else ""
    return f"{percent_text(step.explained_fraction)} of the squared error that was left{above}"


def by_noise_text(step: DiagnosisStep) -> str:
    """Probability that noise alone does as well as an effect."""
    return f"{chance_text(step.p_value) or 'not known'}, corrected for every effect that was tried"


def _rivals(step: DiagnosisStep) -> str:
    shown = [f"{rival.name} ({percent_text(rival.cosine)} alike on these rows)" for rival in step.rivals]
    return ", ".join(shown) or "none"


def constant_table(diagnosis: Diagnosis, fall: ErrorFall) -> PageTable | None:
    """The constant of each coordinate with its standard error; None without a constant."""
    constant = diagnosis.constant
    if constant is None:
        return None
    rows = [
        (axis, estimate_text(value, constant.std_um.get(axis, math.nan), fall.unit))
        for axis, value in constant.by_axis_um.items()
    ]
    rows.append(("may come from", ", ".join(constant.effects) or "where zero was set"))
    if constant.separated_by:
        rows.append(("told apart by", constant.separated_by))
    return PageTable(("", "a constant in every row"), rows)


def wrong_data(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """What is wrong with the data; number and list of unexplained rows."""
    return data_texts(diagnosis, fall.unit, GROSS_ROWS)


def findings_table(diagnosis: Diagnosis, fall: ErrorFall) -> PageTable:
    """Covariates of the rest, and changes in time, the strongest first."""
    rows = [
        (
            change_text(finding, diagnosis) if finding.is_change else short_name(finding),
            _form(finding),
            finding.port,
            percent_text(finding.explained_fraction),
            number_text(finding.heldout_rms_um),
            chance_text(finding.p_value) or "-",
        )
        for finding in diagnosis.depends_on
    ]
    return PageTable(("follows", "form", "port", "explains", f"left, {fall.unit}", "by noise alone"), rows)


def _form(finding: EmpiricalFinding) -> str:
    """The form with its nonlinear constants: "periodic, period = 1.37 mm"; of another covariate, with its name."""
    texts = [finding.form]
    for constant in finding.constants:
        whose = "" if constant.covariate == finding.covariate else f" of {constant.covariate}"
        texts.append(f"{constant.name} = {number_text(constant.value, constant.unit, CONSTANT_DIGITS)}{whose}")
    return ", ".join(texts)


def candidates_table(diagnosis: Diagnosis, fall: ErrorFall) -> PageTable:
    """The effects that explain something, each tried alone on rows left out."""
    rows = [
        (
            result.effect,
            result.status,
            percent_text(result.explained_fraction) if math.isfinite(result.explained_fraction) else "-",
            number_text(result.heldout_rms_um) if math.isfinite(result.heldout_rms_um) else "-",
            result.why,
        )
        for result in diagnosis.candidates
        if result.status in ("explains", "partial", "too_small")
    ]
    return PageTable(("effect", "status", "explains", f"left, {fall.unit}", "why"), rows)


def without_gain(diagnosis: Diagnosis) -> list[str]:
    """Ids of tried effects with a negligible gain."""
    return [result.effect for result in diagnosis.candidates if result.status == "no_gain"]


def untested_table(diagnosis: Diagnosis) -> PageTable:
    """The effects that these rows cannot test, with the reason; first those that may be behind what was found."""
    behind = "; it may be behind what was found"
    rows = {effect.effect: effect.why + behind * effect.likely for effect in untested_here(diagnosis)}
    named = {effect.effect for effect in diagnosis.untested}
    of_the_constant = set(diagnosis.constant.effects) if diagnosis.constant is not None else set()
    for result in diagnosis.candidates:
        if result.status == "not_testable" and result.effect not in named | of_the_constant:
            rows.setdefault(result.effect, result.why)
    return PageTable(("effect", "why, and what to measure"), list(rows.items()))


def formula_list(diagnosis: Diagnosis) -> str:
    """The best description of the rest as a file of effects (a YAML list); "" without one."""
    return "".join(formula_texts(diagnosis))


def formula_texts(diagnosis: Diagnosis) -> list[str]:
    """Each formula of `formula_list` as an entry of its own; its fitted numbers stand behind it as comments."""
    finding = described_by(diagnosis)
    if finding is None:
        return []
    blocks = []
    for effect, fitted in zip(finding.formula_effects, finding.parameters, strict=True):
        text = yaml.safe_dump([_plain(effect)], sort_keys=False, default_flow_style=None, width=YAML_WIDTH)
        numbers = ", ".join(f"{name} = {value:.4g}" for name, value in fitted.items())
        blocks.append(f"{text}  # fitted: {numbers}\n")
    return blocks


def described_by(diagnosis: Diagnosis) -> EmpiricalFinding | None:
    """The first finding that comes with formulas."""
    return next((finding for finding in diagnosis.depends_on if finding.formula_effects), None)


def _plain(effect: Mapping[str, Any]) -> dict[str, Any]:
    """A declaration with short numbers: 301.0 becomes 301."""
    parameters = {
        name: {**keys, "plausible": [int(end) if float(end).is_integer() else end for end in keys["plausible"]]}
        for name, keys in effect["parameters"].items()
    }
    return {**effect, "parameters": parameters}


def next_table(diagnosis: Diagnosis) -> PageTable | None:
    """Rows to measure, or quantities to vary with the reason; None without a proposal."""
    rows = diagnosis.next_measurement
    if not rows:
        return None
    if all("measure" in row for row in rows):
        return PageTable(("measure", "why"), [(str(row["measure"]), str(row.get("why", ""))) for row in rows])
    return planned_rows_table(rows)


def plan_command(diagnosis: Diagnosis, step: DiagnosisStep) -> str:
    """The command that plans the rows which tell a step from all its rivals."""
    names = ",".join([step.effect.id, *(rival.name for rival in step.rivals)])
    return f"compd plan {diagnosis.before.aligned.recording.path} --rivals {names} --rows 40 --out next.csv"
