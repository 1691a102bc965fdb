"""What to do after a diagnosis: what would change the verdict, and what may be done with it as it is."""

from __future__ import annotations

from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.error_fall import ErrorFall
from compd.diagnosis.words.phrases import (
    best_description,
    is_best_a_change,
    moment_text,
    thermal_in_one_session,
    untested_here,
)
from compd.model.formula import FormulaDeclaration
from compd.parameter_ranges import TOLERANCE_KEY
from compd.text import join_words

# What a formula says of telling it from others where the person who wrote it said nothing.
NO_WORDS = FormulaDeclaration.model_fields["separated_by"].default
MEASURE_TWICE = "measure one point twice (two rows with the same number in a `visit` column)"


def advice(diagnosis: Diagnosis, fall: ErrorFall, on_page: bool = False) -> list[str]:
    """Clauses, the most urgent first.  on_page : by the buttons of the page, not by command lines."""
    if any(fault.consequence == "mend the column" for fault in diagnosis.after.faults):
        return ["mend the column first, then diagnose again: all numbers here rest on it"]
    clauses = [] if fall.noise_known else [MEASURE_TWICE]
    changes = [moment_text(finding, diagnosis) for finding in diagnosis.depends_on if finding.is_change]
    clauses += [f"find out what changed from {moment}" for moment in changes[:1]]
    match diagnosis.verdict:
        case "identified" | "likely":
            return [*clauses, *_how_to_add(diagnosis, on_page)]
        case "ambiguous":
            still = "change nothing on the machine yet: what mends one does not mend its rival"
            return [*clauses, still, *_how_to_tell(diagnosis, on_page)]
        case "partial":
            return [
                *clauses,
                *_what_to_state(diagnosis),
                *_how_to_tell(diagnosis, on_page),
                *_what_to_measure(diagnosis),
                *_what_may_be_added(diagnosis, on_page),
            ]
        case "adequate":
            constant = diagnosis.constant
            if constant is not None and (rows := _planned_rows(diagnosis)):
                clauses.append(f"measure the {rows} rows below, which tell where the constant is from")
            elif constant is not None and constant.separated_by:
                clauses.append(f"to tell where the constant is from: {constant.separated_by}")
            return [*clauses, "nothing to mend or to add; other loads, temperatures or speeds may show more"]
        case "not_testable":
            vary = "vary one thing after the other: place, direction, load, temperature"
            return [*clauses, *(_proposed(diagnosis) or [vary])]
    clauses += ["change nothing on the machine yet", *_what_to_state(diagnosis), *_what_to_measure(diagnosis)]
    described = best_description(diagnosis)
    if described is not None and described.formula_effects:
        clauses.append("until the cause is known, the formulas below lower the error")
    return clauses


def _what_to_state(diagnosis: Diagnosis) -> list[str]:
    """How to state the range of what is asked about."""
    if (asked := diagnosis.asked) is None:
        return []
    key = f"{TOLERANCE_KEY} or " if asked.parameter.source.startswith(TOLERANCE_KEY) else ""
    return [f"if that can be, state it: {key}--range {asked.effect}.{asked.parameter.name}=LOW..HIGH"]


def _how_to_add(diagnosis: Diagnosis, on_page: bool) -> list[str]:
    """The buttons or commands that add what was found, and try it elsewhere."""
    ids = [step.effect.id for step in diagnosis.steps]
    recording = diagnosis.before.aligned.recording.path.name
    first = ["measure on another day first"] if thermal_in_one_session(diagnosis) else []
    if on_page:
        return [*first, "add it: Add … below", "try it on another day's recording: open that with this model"]
    more = f", then {join_words(ids[1:])}" if len(ids) > 1 else ""
    add = f"add it: compd model add {ids[0]} --recording {recording} --model FILE{more}"
    return [*first, add, "try it on another day's recording: compd compare OTHER.csv --model FILE"]


def _what_may_be_added(diagnosis: Diagnosis, on_page: bool) -> list[str]:
    """Shares of the error may be corrected too, but for those that are something else in disguise."""
    doubtful = [step.effect.id for step in diagnosis.steps if not all(number.plausible for number in step.parameters)]
    if doubtful:
        return [f"do not add {join_words(doubtful)}: something else looks like it"]
    if any(step.rivals for step in diagnosis.steps):
        return []
    how = "Add … below" if on_page else "compd model add"
    return [f"what was found may be added ({how}): it lowers the error, the rest stays"]


def _how_to_tell(diagnosis: Diagnosis, on_page: bool) -> list[str]:
    """What tells the effects that have rivals from these: planned rows, else words."""
    first = next((step for step in diagnosis.steps if step.rivals), None)
    if first is None:
        return []
    if rows := _planned_rows(diagnosis):
        return [f"measure the {rows} rows below, which tell the rivals apart"]
    words = next(iter(_in_words(diagnosis)), first.effect.separated_by)
    if words != NO_WORDS:
        return [f"to tell {first.effect.id}: {words}"]
    if on_page:
        return ["Plan the measurement that tells them apart says what to measure"]
    recording = diagnosis.before.aligned.recording.path.name
    names = ",".join([first.effect.id, *(rival.name for rival in first.rivals)])
    return [f"compd plan {recording} --rivals {names} says what tells them apart"]


def _what_to_measure(diagnosis: Diagnosis) -> list[str]:
    """What an effect lacks that may be behind it; else what to vary; else what to record."""
    likely = [effect for effect in untested_here(diagnosis) if effect.likely][:1]
    if likely:
        return [f"{effect.effect} {effect.why.partition('; ')[0]}: record it" for effect in likely]
    finding = best_description(diagnosis)
    if finding is not None and finding.covariate == "time_s":
        return ["measure again on another day, in another order: time itself drives nothing"]
    if is_best_a_change(diagnosis):
        return ["diagnose the rows before and after it apart"]
    what = "the rest" if diagnosis.steps else "it"
    return _proposed(diagnosis) or [f"record what may drive {what}: temperatures, loads, directions"]


def _proposed(diagnosis: Diagnosis) -> list[str]:
    """What was proposed, but for rivals and for noise that is not known: of these is said elsewhere."""
    if any(step.rivals for step in diagnosis.steps) or diagnosis.before.floor.source == "estimate":
        return []
    if rows := _planned_rows(diagnosis):
        return [f"measure the {rows} rows below"]
    return _in_words(diagnosis)


def _planned_rows(diagnosis: Diagnosis) -> int:
    return sum("measure" not in row for row in diagnosis.next_measurement)


def _in_words(diagnosis: Diagnosis) -> list[str]:
    """The first of the measurements that are proposed in words."""
    return [str(row["measure"]) for row in diagnosis.next_measurement if "measure" in row][:1]
