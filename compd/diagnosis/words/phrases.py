"""Phrases of a diagnosis: each fact as a clause, for the sentence, the twelve lines, the terminal and the page."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from compd.comparison import Comparison
from compd.diagnosis.findings import (
    CandidateResult,
    ConstantFinding,
    DiagnosisStep,
    EmpiricalFinding,
    GrossRows,
    ImplausibleEffect,
    ParameterEstimate,
    UntestedEffect,
)
from compd.diagnosis.little_effects import little_effects
from compd.diagnosis.thermal_evidence import seen_once
from compd.diagnosis.verdict import Diagnosis
from compd.model.effects import Effect
from compd.model.formula import FormulaDeclaration
from compd.model.library import BUNDLED
from compd.parameter_ranges import TOLERANCE_KEY
from compd.text import chance_text, clock_text, estimate_text, estimates_text, join_words, number_text, percent_text

# The link or joint of a fitted number: 4 of k_4, 2 of d_2x.
_NUMBERED = re.compile(r"_(\d+)[xyz]?$")
# An effect acts at one of so many places if its numbers there are sure, and those elsewhere a small share of them.
MIN_PLACES, SURE_SIGMAS, OTHERS_SHARE = 3, 3.0, 0.35
# What a formula says of its physics where the person who wrote it said nothing.
_NO_PHYSICS = FormulaDeclaration.model_fields["physics"].default
_BUNDLED = frozenset(effect.id for effect in BUNDLED)
# Effects that people know by another name than their id.
_PLAIN_NAMES = {"reference_registration": "the instrument's frame"}
# A parameter that has more values than this is said by its smallest and its largest.
MAX_VALUES = 3
# Rivals of one effect that are named.
MAX_RIVALS = 3
# Single gross rows that are named.
MAX_ROWS = 4

# A probability is said as no less than this, and as no nearer to 1.
LEAST = 0.01

IMPLAUSIBLE = "IMPLAUSIBLE"
NOT_DETERMINED = "NOT DETERMINED"
# An effect that does so many times more than the error was is taken back by others.
CANCELLING = 10.0
# Numbers that a sentence of doubt names.
MAX_DOUBTS = 2


def physics_clause(effect: Effect) -> str:
    """The first clause of what an effect does: "balls flatten where they touch"; of a formula without words, itself."""
    if effect.physics == _NO_PHYSICS:
        return effect.equation
    clause = re.split(r"[;:.](?:\s|$)|,\s(?!but\b)", effect.physics.strip(), maxsplit=1)[0]
    return clause if clause[1:2].isupper() else clause[:1].lower() + clause[1:]


def parameter_texts(step: DiagnosisStep, links: int) -> dict[str, str]:
    """Name -> number with its standard error: "a" -> "1.113 +- 0.021 ppm/K"; one entry for what there is one per link.

    An implausible number says so beside the range that its effect calls plausible; a searched constant, that it was.
    """
    texts = {}
    columns = step.effect.columns(links)
    for parameter in step.effect.parameters:
        values = [
            value for column, value in zip(columns, step.parameters, strict=True) if column.parameter is parameter
        ]
        if not values:
            continue
        numbers, std = [value.value for value in values], max(value.std for value in values)
        name = values[0].name if len(values) == 1 else f"{values[0].name} to {values[-1].name}"
        if len(values) == 1:
            text = estimate_text(numbers[0], std, values[0].unit)
        elif len(values) <= MAX_VALUES:
            text = estimates_text(numbers, std, values[0].unit)
        else:
            text = estimates_text([min(numbers), max(numbers)], std, values[0].unit, " to ")
        usual = f"{parameter.low:g} to {parameter.high:g} is usual"
        if not all(value.plausible for value in values):
            text += f", {IMPLAUSIBLE}: {usual}"
        elif not all(value.determined for value in values):
            text += f", {NOT_DETERMINED} by these rows: {usual}"
        elif any(value.outside for value in values):
            text += f", outside: {usual}"
        texts[name] = text
    units = {constant.name: constant.unit for constant in step.effect.constants}
    for name, value in step.fitted.constants.items():
        texts[name] = f"{number_text(value, units.get(name, ''), 3)}, searched"
    return texts


def named_with_place(step: DiagnosisStep) -> str:
    """An effect with the link or joint where it acts, if it acts at one: "scale_gain (scale 4: +28 ppm)"."""
    place = where_it_acts(step)
    return f"{step.effect.id} ({place})" if place else step.effect.id


def where_it_acts(step: DiagnosisStep) -> str:
    """The link or joint whose numbers stand out: "scale 4: +28 ppm", "base joint 2"; "" where several do."""
    numbers: dict[str, list[ParameterEstimate]] = {}
    for number in step.parameters:
        if match := _NUMBERED.search(number.name):
            numbers.setdefault(match[1], []).append(number)
    if len(numbers) < MIN_PLACES:
        return ""
    sizes = {place: math.hypot(*(number.value for number in group)) for place, group in numbers.items()}
    first, second = sorted(sizes, key=lambda place: -sizes[place])[:2]
    sure = any(abs(number.value) > SURE_SIGMAS * number.std for number in numbers[first])
    if not sure or sizes[second] > OTHERS_SHARE * sizes[first]:
        return ""
    place = f"{step.effect.ports[0].replace('_', ' ')} {first}"
    if len(numbers[first]) > 1:
        return place
    number = numbers[first][0]
    return f"{place}: {'+' if number.value > 0 else ''}{number_text(number.value, number.unit, 2)}"


def doubts(diagnosis: Diagnosis) -> list[str]:
    """What speaks against the numbers of the effects that were found: outside their ranges, or not determined."""
    outside, undetermined = [], []
    for step in diagnosis.steps:
        for number in step.parameters:
            name = number.name if number.name == step.effect.id else f"{number.name} of {step.effect.id}"
            if not number.determined:
                undetermined.append(name)
            elif number.outside:
                value = estimate_text(number.value, number.std, number.unit)
                outside.append(f"{name} is {value}, and {number.low:g} to {number.high:g} is usual")
    clauses = [_some(outside, "; ")] if outside else []
    clauses += [text for text in (_cancelling_text(diagnosis),) if text]
    return [*clauses, *([f"these rows do not determine {_some(undetermined, ', ')}"] if undetermined else [])]


def _cancelling_text(diagnosis: Diagnosis) -> str:
    """Which effects do many times more than the whole error was, so that others or the constant take it back."""
    before, after = diagnosis.before, diagnosis.after
    named = [step.effect.id for step in diagnosis.steps if step.effect.id in after.contributions]
    sizes = {name: after.contributions[name].share_rms_um for name in named}
    large = [name for name, size in sizes.items() if size > CANCELLING * before.rms_um]
    if not large:
        return ""
    unit = before.aligned.unit
    moved = join_words([f"{name} ({number_text(sizes[name], unit)})" for name in large])
    takes = "others or the constant take" if len(large) == 1 else "they, others or the constant take"
    return f"of what {moved} would do, {takes} back all but {number_text(before.rms_um, unit)}: the numbers go together"


def _some(texts: Sequence[str], between: str) -> str:
    more = f" and {len(texts) - MAX_DOUBTS} more" if len(texts) > MAX_DOUBTS else ""
    return between.join(texts[:MAX_DOUBTS]) + more


def chance_clause(p_values: Sequence[float]) -> str:
    """How often noise alone would do as well as the least sure of some results; "" where it is not known."""
    known = [p_value for p_value in p_values if p_value > 0]
    if not known:
        return ""
    each = " each at most" if len(known) > 1 else " this"
    return f"noise alone does{each} {chance_text(max(known))}"


def short_name(finding: EmpiricalFinding) -> str:
    """A finding by a name, for tables and bars: its covariates, or the effect that changes or that it stands for."""
    if finding.is_change:
        return f"a change of {finding.effect}" if finding.effect else "a step in time"
    names = " with ".join([finding.covariate, *finding.beside])
    return f"{names}, as {finding.effect}" if finding.effect else names


def followed_text(finding: EmpiricalFinding) -> str:
    """What a residual follows: "temperature_frame_degC (linear) together with humidity_pct".

    Of a thermometer that stands for another's: "temperature_room_degC, as link_expansion would".
    """
    if finding.form == "proxy":
        return f"{finding.covariate}, as {finding.effect} would, whose own temperature was not measured"
    beside = f" together with {join_words(finding.beside)}" if finding.beside else ""
    return f"{finding.covariate} ({finding.form}){beside}"


def rivals_text(step: DiagnosisStep) -> str:
    """An effect and those that do as well in its place: "link_elasticity or joint_contact (99 % alike)"."""
    rivals = [rival.name for rival in step.rivals[:MAX_RIVALS]]
    others = [f"{len(step.rivals) - MAX_RIVALS} more"] if len(step.rivals) > MAX_RIVALS else []
    names = join_words([step.effect.id, *rivals, *others], "or")
    return f"{names} ({percent_text(max(rival.cosine for rival in step.rivals))} alike)"


def change_text(finding: EmpiricalFinding, diagnosis: Diagnosis) -> str:
    """A change in the middle of a recording: "from 6000 s on (row 410) backlash is larger"."""
    moment = moment_text(finding, diagnosis)
    if not finding.effect:
        return f"from {moment} every row is shifted alike"
    return f"from {moment} {finding.effect} {_how_it_changed(finding, diagnosis)}"


def question_text(asked: ImplausibleEffect, share: str, tolerance_mm: float) -> str:
    """An effect that explains much with an implausible number, and the question that only the owner can answer.

    share : what it takes, in words.  tolerance_mm : to which the machine is stated to be made.
    """
    number, parameter = asked.number, asked.parameter
    value = estimate_text(number.value, number.std, number.unit)
    found = f"{asked.effect} would take {share}, with {number.name} = {value}"
    if parameter.source.startswith(TOLERANCE_KEY):
        return f"{found}; this machine is declared good to {tolerance_mm:g} mm. Is it?"
    return f"{found}; {parameter.low:g} to {parameter.high:g} is usual. Can that be?"


def moment_text(finding: EmpiricalFinding, diagnosis: Diagnosis) -> str:
    """When something changed: "6000 s on (row 410)", or a date."""
    recording = diagnosis.after.aligned.recording
    row = recording.row[min(int(np.searchsorted(recording.time_s, finding.time_s)), recording.rows - 1)]
    return f"{clock_text(finding.time_s)} on (row {row})"


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


def gross_texts(gross: GrossRows, comparison: Comparison, unit: str, most_rows: int = MAX_ROWS) -> list[str]:
    """How many rows nothing explains, how far off they are, where they lie, and what to look at.

    most_rows : single rows that are named. Rows of which more is known are told by `fault_texts`.
    """
    told = {row for fault in comparison.named_faults for row in fault.rows}
    if not set(gross.rows) - told:
        return []
    gross = GrossRows(
        tuple(row for row in gross.rows if row not in told),
        tuple(run for run in gross.runs if not told & set(range(run[0], run[1] + 1))),
    )
    recording = comparison.aligned.recording
    size = np.abs(comparison.residual_um[np.isin(recording.row, gross.rows)])
    largest = float(np.nanmax(size)) if np.isfinite(size).any() else float("nan")
    off = f" (up to {number_text(largest, unit)} off)" if np.isfinite(largest) else ""
    in_runs = {row for first, last in gross.runs for row in gross.rows if first <= row <= last}
    single = [str(row) for row in gross.rows if row not in in_runs]
    if len(single) > most_rows:
        single = [*single[: most_rows - 1], f"{len(single) - most_rows + 1} more"]
    rows = join_words(single)
    count = f"{len(gross.rows)} of {recording.rows} rows do not count{off}"
    if not gross.runs:
        return [f"{count}: {rows}"]
    runs = join_words([f"{first} to {last}" for first, last in gross.runs])
    share = float(np.nansum(size[[row in in_runs for row in recording.row[np.isin(recording.row, gross.rows)]]] ** 2))
    share /= max(float(np.nansum(comparison.residual_um**2)), 1e-300)
    held = f" with {percent_text(share)} of the squared error" if np.isfinite(share) else ""
    texts = [count, f"look at what happened in rows {runs}{held} (a bump, a slipped target, a lost step)"]
    return [*texts, f"single bad readings: {rows}"] if single else texts


def fault_texts(comparison: Comparison, most: int | None = None) -> list[str]:
    """What is wrong with the data, in the words of `compd recording check`.  most : how many are told; None for all."""
    texts = [fault.text for fault in comparison.named_faults]
    return texts if most is None or len(texts) <= most else [*texts[:most], f"{len(texts) - most} more"]


def data_texts(diagnosis: Diagnosis, unit: str, most_rows: int = MAX_ROWS) -> list[str]:
    """All that is wrong with the data, then the rows of which nothing more is known than that nothing explains them."""
    return [*fault_texts(diagnosis.after), *gross_texts(diagnosis.gross, diagnosis.after, unit, most_rows)]


def untested_here(diagnosis: Diagnosis) -> list[UntestedEffect]:
    """Effects that could not be tried and that concern this machine, first those that may be behind what was found.

    The library's effects are nothing to a machine with a model of its own, but where its links were measured.
    """
    aligned = diagnosis.before.aligned
    external = aligned.model is None and not aligned.of_links
    concerning = [
        effect for effect in diagnosis.untested if effect.likely or not (external and effect.effect in _BUNDLED)
    ]
    return sorted(concerning, key=lambda effect: not effect.likely)


def shown_by(diagnosis: Diagnosis) -> str:
    """What a reference at fixed places can show at all, behind "nothing is missing"; "" for others."""
    ends = diagnosis.before.aligned.ends
    if ends is None:
        return ""
    return " that lengths can show" if ends.of_lengths else " that pins can show"


def too_small(diagnosis: Diagnosis) -> CandidateResult | None:
    """The effect that surely acts and takes too little for a name, the one that takes most; None without any."""
    small = [candidate for candidate in diagnosis.candidates if candidate.status == "too_small"]
    return min(small, key=lambda candidate: candidate.heldout_rms_um, default=None)


def little_clause(diagnosis: Diagnosis) -> str:
    """Which effects take so little that others may be behind them, and what tells that; "" where none does."""
    names = little_effects(diagnosis.steps, diagnosis.criteria)
    take, it, does = ("takes", "it", "does") if len(names) == 1 else ("take", "they", "do")
    doubt = f"{join_words(names)} {take} less than the noise and may be something else"
    return f"{doubt}: measure where {it} {does} more" if names else ""


def was_any_tried(diagnosis: Diagnosis) -> bool:
    """Whether the recording tests any effect of the library."""
    return any(candidate.status != "not_testable" for candidate in diagnosis.candidates)


def best_description(diagnosis: Diagnosis) -> EmpiricalFinding | None:
    """What the rest follows best; None where nothing or a change describes it better than anything it follows."""
    if not diagnosis.depends_on or is_best_a_change(diagnosis):
        return None
    return diagnosis.depends_on[0]


def is_best_a_change(diagnosis: Diagnosis) -> bool:
    """Whether a change in time describes the rest better than anything that it follows."""
    return any(finding.is_change for finding in diagnosis.depends_on[:1])


def probability_clause(diagnosis: Diagnosis) -> list[str]:
    """How probable it is that the named set is right; empty where that cannot be stated."""
    probability = diagnosis.probability
    if math.isnan(probability):
        return []
    what = "what is named is all, and all of it acts" if diagnosis.steps else "no effect of the library has to be named"
    return [f"{min(max(probability, LEAST), 1.0 - LEAST):.2f} is the probability that {what}"]


def thermal_in_one_session(diagnosis: Diagnosis) -> list[str]:
    """Thermal effects that were found, or where none was what the error follows, where all rows are of one session.

    All that warms up in a session rises together, and with time: one session alone proves no thermal cause.
    """
    finding = best_description(diagnosis)
    if diagnosis.steps or finding is None:
        effects = [step.effect for step in diagnosis.steps]
        return seen_once(diagnosis.after.aligned, diagnosis.after.used, effects, diagnosis.criteria)
    session = diagnosis.after.aligned.recording.session
    if session is not None and len(np.unique(session[diagnosis.after.used & (session >= 0)])) > 1:
        return []
    return [name for name in (finding.covariate, *finding.beside) if name.startswith(("temperature", "time"))]
