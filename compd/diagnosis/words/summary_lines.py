"""The twelve lines that a person reads first: what was found, how much it explains, what is left, how sure that is,
what else it could be, and what to do next."""

from __future__ import annotations

import math

from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.advice import advice
from compd.diagnosis.words.error_fall import CANNOT_KNOW, ErrorFall, error_fall
from compd.diagnosis.words.phrases import (
    IMPLAUSIBLE,
    NOT_DETERMINED,
    best_description,
    chance_clause,
    change_text,
    constant_text,
    doubts,
    fault_texts,
    followed_text,
    gross_texts,
    is_best_a_change,
    little_clause,
    named_with_place,
    parameter_texts,
    physics_clause,
    probability_clause,
    rivals_text,
    shown_by,
    thermal_in_one_session,
    too_small,
    untested_here,
    was_any_tried,
)
from compd.diagnosis.words.summary import question
from compd.recording import sigma_key
from compd.text import LabelledText, fall_text, fit_lines, join_words, number_text, percent_text

# What a terminal shows without scrolling, and its usual width.
MAX_LINES = 12
WIDTH = 80
# Effects, rivals and untested effects that are said here.
MAX_NAMED = 3
NO_RIVAL = "no other effect that was tried does as well"
# Faults of the data that are said here.
MAX_FAULTS = 2
# A probability above this is said before the numbers.
DOUBTFUL = 0.01
# What is left takes so many lines with the limits of another day, and with both numbers of a contradicted declaration.
WITH_LIMITS, CONTRADICTED = 2, 3
# With so many other texts the one is left out that says nothing.
CROWDED = 8


def summary_lines(diagnosis: Diagnosis, on_page: bool = False) -> list[str]:
    """The verdict in at most 12 lines of at most 80 columns.

    on_page : advise by the buttons of the page, not by command lines.

    A heading, then lines with labels; a label that has nothing to say is left out. What has no room is in the evidence.
    """
    fall = error_fall(diagnosis)
    found = tuple(_found(diagnosis, fall))
    names = tuple(clause.partition(": ")[0] for clause in found)
    others = [
        LabelledText("Data", tuple(fault_texts(diagnosis.after, MAX_FAULTS))),
        LabelledText("Changed", tuple(_changed(diagnosis, fall))),
        LabelledText("Asked", tuple(question(diagnosis))),
        LabelledText("Explains", tuple(_explains(diagnosis, fall))),
        LabelledText("Follows", tuple(_follows(diagnosis, fall))),
        LabelledText("Start", tuple(_start(diagnosis, fall))),
        LabelledText("Left", tuple(_left(diagnosis, fall)), least=_left_lines(diagnosis, fall)),
        LabelledText("Gross", tuple(gross_texts(diagnosis.gross, diagnosis.after, fall.unit))),
        LabelledText("Right", tuple(probability_clause(diagnosis))),
        LabelledText("Sure", tuple(_sure(diagnosis))),
        LabelledText("Or else", tuple(_or_else(diagnosis))),
        LabelledText("Besides", tuple(_constant(diagnosis, fall))),
        LabelledText("Next", tuple(advice(diagnosis, fall, on_page))),
    ]
    others = [text for text in others if text.clauses]
    if len(others) >= CROWDED:
        others = [text for text in others if text.clauses != (NO_RIVAL,)]
    room = MAX_LINES - 1 - sum(text.least for text in others)
    label = "Shares" if diagnosis.verdict in ("partial", "unexplained") else "Found"
    texts = [LabelledText(label, found, names, least=min(len(found), MAX_NAMED, room))] if found else []
    return [_heading(diagnosis, fall), *fit_lines([*texts, *others], MAX_LINES - 1, WIDTH)]


def _heading(diagnosis: Diagnosis, fall: ErrorFall) -> str:
    """The verdict's word and what it means here, on one line; effects are counted where their names are too long."""
    ids = [step.effect.id for step in diagnosis.steps]
    count = f"{len(ids)} effects" if len(ids) > 1 else "one effect"
    be = "is" if len(ids) == 1 else "are"
    match diagnosis.verdict:
        case "adequate" if fall.noise_known and diagnosis.constant is not None:
            near = "" if too_small(diagnosis) is None else "near the "
            text = f"nothing is missing but a constant; what varies is {near}noise"
        case "adequate" if fall.noise_known:
            error, only_noise = number_text(fall.before, fall.unit), too_small(diagnosis) is None
            rest = (
                f"; the error of {error} is noise" if only_noise else f" that could be named; {error} is near the noise"
            )
            text = f"nothing is missing{shown_by(diagnosis)}{rest}"
        case "identified":
            text = f"What is missing is {{}}: {fall.text(fall.after)}"
        case "likely":
            why = "seen in one warm-up only" if thermal_in_one_session(diagnosis) else "one more recording decides"
            text = f"{{}} {be} missing, {why}: {fall.text(fall.after)}"
        case "ambiguous":
            ids = [
                join_words([step.effect.id, *(rival.name for rival in step.rivals)], "or") for step in diagnosis.steps
            ]
            count += " or rivals" if len(ids) > 1 else " or a rival"
            text = f"{{}} {be} missing; these rows cannot tell"
        case "adequate" | "not_testable" if was_any_tried(diagnosis):
            text = "no effect that was tried surely lowers the error; the noise is not known"
        case "not_testable":
            text = "no effect can be tested; nothing that drives one was varied"
        case _:
            text = _above_the_noise(diagnosis, fall)
    if diagnosis.verdict != "ambiguous" and doubts(diagnosis):
        text = f"{text.partition(';')[0]}; see what speaks against its numbers"
    texts = [text.format(join_words(ids)), text.format(count)]
    if diagnosis.verdict != "ambiguous":
        texts.insert(0, text.format(join_words([named_with_place(step) for step in diagnosis.steps])))
    if (asked := diagnosis.asked) is not None:
        takes = f"would take {percent_text(fall.share_of(asked.heldout_rms_um))}, with an implausible number"
        texts = [f"{asked.effect} {takes}", f"an effect {takes}"]
    if wrong := [fault for fault in diagnosis.after.faults if fault.consequence == "mend the column"]:
        texts = [wrong[0].what.partition(":")[0], "columns of the recording seem wrong"]
    headings = [f"{diagnosis.verdict}: {text}" for text in texts]
    return next((heading for heading in headings if len(heading) <= WIDTH), headings[-1])


def _above_the_noise(diagnosis: Diagnosis, fall: ErrorFall) -> str:
    """What `partial` and `unexplained` mean, with {} for the names of the effects."""
    before = number_text(fall.before, fall.unit)
    if not diagnosis.steps:
        if is_best_a_change(diagnosis):
            return f"the error of {before} goes with a change in time"
        return f"no effect that was tried explains the error of {before}"
    verb = "explains" if len(diagnosis.steps) == 1 else "explain"
    if is_best_a_change(diagnosis):
        rest = "something changed in time"
    elif diagnosis.verdict == "unexplained":
        rest = "the rest has no known cause"
    else:
        rest = "something else acts as well" if fall.noise_known else "the noise is not known"
    return f"{{}} {verb} {percent_text(fall.share_of(fall.after))}; {rest}"


def _found(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """Each effect, how far the error falls with it where there are several, and what it does."""
    errors = [fall.before, *fall.steps]
    clauses = []
    for number, step in enumerate(diagnosis.steps):
        step_fall = f" ({fall_text(errors[number : number + 2], fall.unit)})" if len(diagnosis.steps) > 1 else ""
        rivals = "".join(f"; or {rival.name}" for rival in step.rivals[:1])
        clauses.append(f"{step.effect.id}{step_fall}: {physics_clause(step.effect)}{rivals}")
    return clauses


def _changed(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    changes = [finding for finding in diagnosis.depends_on if finding.is_change]
    clauses = [f"{change_text(finding, diagnosis)}: something happened then" for finding in changes[:MAX_NAMED]]
    return [
        *clauses,
        *(f"with it {fall_text([fall.after, finding.heldout_rms_um], fall.unit)}" for finding in changes[:1]),
    ]


def _follows(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    finding = best_description(diagnosis)
    if finding is None:
        nothing = diagnosis.verdict == "unexplained" and not diagnosis.depends_on
        return ["the error follows nothing that was measured"] if nothing else []
    what = "the rest follows " if diagnosis.steps else ""
    errors = fall_text([fall.after, finding.heldout_rms_um], fall.unit)
    return [f"{what}{followed_text(finding)}: {errors}", "a description, no cause"]


def _explains(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    rows = ", rows left out" if fall.left_out else ""
    return [f"{fall.share_text(fall.after)}: {fall.text(fall.after)}{rows}"] if diagnosis.steps else []


def _start(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """What is fitted along of a lag that was out of equilibrium when sessions began."""
    if (start := diagnosis.start) is None:
        return []
    errors = fall_text([start.before_um, start.after_um], fall.unit)
    return [f"{start.effect} was not in equilibrium at first: {start.numbers} numbers more ({errors}), no cause"]


def _left(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """The error that is left beside the noise, and what the difference means."""
    described = next(iter(diagnosis.depends_on), None) if not diagnosis.steps else None
    contradiction = diagnosis.before.floor.contradiction
    remarks = [contradiction] if contradiction else []
    left = fall.after if described is None else described.heldout_rms_um
    text = number_text(left, fall.unit) + (" with it" if described else _on_another_day(diagnosis, fall))
    if not fall.noise_known:
        given_up = not math.isnan(diagnosis.before.floor.declared_um)
        check = f"check `{sigma_key(fall.unit)}`"
        return [f"{text}; {fall.unknown}", *([check] if given_up else remarks)]
    at_floor = left**2 <= diagnosis.criteria.most_at_floor * fall.noise**2
    if diagnosis.verdict == "adequate" and (small := too_small(diagnosis)) is not None:
        meaning = f"{small.effect} may act, too little for a name"
    elif diagnosis.verdict in ("adequate", "identified", "likely", "ambiguous") or at_floor:
        meaning = "only noise is left"
    elif diagnosis.steps and is_best_a_change(diagnosis):
        meaning = "some of it goes with the change"
    elif diagnosis.steps or described:
        meaning = "something else acts as well"
    else:
        meaning = "these rows do not show what acts"
    return [f"{text}; noise {number_text(fall.noise, fall.unit)} ({fall.source}): {meaning}", *remarks]


def _left_lines(diagnosis: Diagnosis, fall: ErrorFall) -> int:
    """How many lines it takes to say what is left."""
    if fall.unknown != CANNOT_KNOW:
        return CONTRADICTED
    return 1 if math.isnan(diagnosis.left_interval_um[0]) else WITH_LIMITS


def _on_another_day(diagnosis: Diagnosis, fall: ErrorFall) -> str:
    """Within which limits the error on another day lies, in brackets; "" where they are not known."""
    low, high = diagnosis.left_interval_um
    if math.isnan(low):
        return ""
    confidence = percent_text(diagnosis.criteria.left_confidence)
    return f" (another day: {number_text(low)} to {number_text(high, fall.unit)} with {confidence})"


def _sure(diagnosis: Diagnosis) -> list[str]:
    """First what is doubtful: implausible numbers, chance, a single session. Then the other numbers."""
    links = diagnosis.after.aligned.rows.links
    steps, finding = diagnosis.steps, best_description(diagnosis)
    numbers = [
        f"{step.effect.id} {name} = {text}" if len(steps) > 1 else f"{name} = {text}"
        for step in steps
        for name, text in parameter_texts(step, links).items()
    ]
    implausible = [text for text in numbers if any(word in text for word in (IMPLAUSIBLE, NOT_DETERMINED, "outside:"))]
    names = thermal_in_one_session(diagnosis)
    session = [f"{join_words(names)} seen in one session only: measure on another day"] if names else []
    session += [clause for clause in (little_clause(diagnosis),) if clause and diagnosis.verdict == "likely"]
    p_values = [step.p_value for step in steps] or ([] if finding is None else [finding.p_value])
    chance = [clause for clause in (chance_clause(p_values),) if clause]
    implausible += [f"{step.effect.id}: {remark}" for step in steps for remark in step.effect.remarks]
    doubtful = chance if max(p_values, default=0.0) > DOUBTFUL else []
    others = [text for text in numbers if text not in implausible]
    return [*implausible, *doubtful, *session, *others, *(chance if not doubtful else [])]


def _or_else(diagnosis: Diagnosis) -> list[str]:
    """Rivals, then effects that could not be tried and are likely; where there are none, that there are none."""
    clauses = [f"{rivals_text(step)}: these rows cannot tell" for step in diagnosis.steps if step.rivals]
    untested = untested_here(diagnosis)
    likely = [effect for effect in untested if effect.likely]
    clauses += [f"{effect.effect} may be behind it, and could not be tried" for effect in likely[:MAX_NAMED]]
    if not clauses and diagnosis.steps:
        clauses.append(NO_RIVAL)
    others = [effect.effect for effect in untested if not effect.likely]
    if diagnosis.verdict == "not_testable":
        clauses += [f"{effect.effect} {effect.why}" for effect in untested if not effect.likely][:MAX_NAMED]
    elif others:
        shown = others[:MAX_NAMED] + ([f"{len(others) - MAX_NAMED} more"] if len(others) > MAX_NAMED else [])
        clauses.append(f"not testable here: {join_words(shown)}")
    return clauses


def _constant(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    return [] if diagnosis.constant is None else [constant_text(diagnosis.constant, fall.unit)]
