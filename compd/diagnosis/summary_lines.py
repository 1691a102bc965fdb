"""The twelve lines that a person reads first: what was found, how much it explains, what is left, how sure that is,
what else it could be, and what to do next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.diagnosis.error_fall import ErrorFall, error_fall
from compd.diagnosis.findings import EmpiricalFinding
from compd.diagnosis.phrases import (
    HOW_TO_KNOW_NOISE,
    IMPLAUSIBLE,
    chance_clause,
    change_text,
    constant_text,
    followed_text,
    gross_texts,
    is_thermal,
    parameter_texts,
    physics_clause,
    rivals_text,
    session_count,
    untested_here,
)
from compd.diagnosis.summary import CANNOT_KNOW
from compd.labelled_lines import LabelledText, fit_lines
from compd.number_text import fall_text, join_words, number_text, percent_text

if TYPE_CHECKING:
    from compd.diagnosis.verdict import Diagnosis

# What a terminal shows without scrolling, and its usual width.
MOST_LINES = 12
WIDTH = 80
# Effects, rivals and untested effects that are said here.
MOST_NAMED = 3
# A mean square up to so many times that of the noise is called noise.
NOISE_RATIO = 1.25
NO_RIVAL = "no other effect that was tried does as well"
# With so many other texts the one is left out that says nothing.
CROWDED = 7


def summary_lines(diagnosis: Diagnosis) -> list[str]:
    """The verdict in at most 12 lines of at most 80 columns.

    A heading, then lines with labels; a label that has nothing to say is left out. What has no room is in the evidence.
    """
    fall = error_fall(diagnosis)
    found = tuple(_found(diagnosis, fall))
    names = tuple(step.effect.id for step in diagnosis.steps)
    others = [
        LabelledText("Changed", tuple(_changed(diagnosis))),
        LabelledText("Explains", tuple(_explains(diagnosis, fall))),
        LabelledText("Follows", tuple(_follows(diagnosis, fall))),
        LabelledText("Left", tuple(_left(diagnosis, fall))),
        LabelledText("Gross", tuple(gross_texts(diagnosis.gross, diagnosis.after, fall.unit))),
        LabelledText("Sure", tuple(_sure(diagnosis))),
        LabelledText("Or else", tuple(_or_else(diagnosis))),
        LabelledText("Besides", tuple(_constant(diagnosis, fall))),
        LabelledText("Next", tuple(_next(diagnosis, fall))),
    ]
    others = [text for text in others if text.clauses]
    if len(others) >= CROWDED:
        others = [text for text in others if text.clauses != (NO_RIVAL,)]
    room = MOST_LINES - 1 - len(others)
    label = "Shares" if diagnosis.verdict in ("partial", "unexplained") else "Found"
    texts = [LabelledText(label, found, names, least=min(len(found), MOST_NAMED, room))] if found else []
    return [_heading(diagnosis, fall), *fit_lines([*texts, *others], MOST_LINES - 1, WIDTH)]


def _heading(diagnosis: Diagnosis, fall: ErrorFall) -> str:
    """The verdict's word and what it means here, on one line; effects are counted where their names are too long."""
    ids = [step.effect.id for step in diagnosis.steps]
    verb, be = ("explains", "is") if len(ids) == 1 else ("explain", "are")
    before, share = number_text(fall.before, fall.unit), percent_text(fall.share_of(fall.after))
    match diagnosis.verdict:
        case "adequate" if diagnosis.constant is not None:
            text = "nothing is missing but a constant; what varies is noise"
        case "adequate":
            text = f"nothing is missing; the error of {before} is noise"
        case "identified":
            text = f"What is missing is {{}}: {fall.text(fall.after)}"
        case "ambiguous":
            ids = [
                join_words([step.effect.id, *(rival.name for rival in step.rivals)], "or") for step in diagnosis.steps
            ]
            text = f"{{}} {be} missing; these rows cannot tell"
        case "partial" if fall.noise_known:
            text = f"{{}} {verb} {share}; something else acts as well"
        case "partial":
            text = f"{{}} {verb} {share}; the noise is not known"
        case "not_testable":
            text = "no effect can be tested; nothing that drives one was varied"
        case _ if ids:
            text = f"{{}} {verb} {share}; the rest has no known cause"
        case _:
            text = f"no effect that was tried explains the error of {before}"
    count = f"{len(ids)} effects" if len(ids) > 1 else "one effect"
    if diagnosis.verdict == "ambiguous":
        count = f"{count} or {'rivals' if len(ids) > 1 else 'a rival'}"
    headings = [f"{diagnosis.verdict}: {text.format(names)}" for names in (join_words(ids), count)]
    return headings[len(headings[0]) > WIDTH]


def _found(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """Each effect, how far the error falls with it where there are several, and what it does."""
    errors = [fall.before, *fall.steps]
    clauses = []
    for number, step in enumerate(diagnosis.steps):
        step_fall = f" ({fall_text(errors[number : number + 2], fall.unit)})" if len(diagnosis.steps) > 1 else ""
        rivals = "".join(f"; or {rival.name}" for rival in step.rivals[:1])
        clauses.append(f"{step.effect.id}{step_fall}: {physics_clause(step.effect)}{rivals}")
    return clauses


def _changed(diagnosis: Diagnosis) -> list[str]:
    changes = [finding for finding in diagnosis.depends_on if finding.effect]
    happened = ["something happened then: look for it in the machine's log"] if changes else []
    return [*(change_text(finding, diagnosis) for finding in changes[:MOST_NAMED]), *happened]


def _description(diagnosis: Diagnosis) -> EmpiricalFinding | None:
    """What the rest follows best, a change apart."""
    return next((finding for finding in diagnosis.depends_on if not finding.effect), None)


def _follows(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    finding = _description(diagnosis)
    if finding is None:
        nothing = diagnosis.verdict == "unexplained" and not diagnosis.depends_on
        return ["the error follows nothing that was measured"] if nothing else []
    what = "the rest follows " if diagnosis.steps else ""
    errors = fall_text([fall.after, finding.heldout_rms_um], fall.unit)
    return [f"{what}{followed_text(finding)}: {errors}", "a description, no cause"]


def _explains(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    rows = ", rows left out" if fall.left_out else ""
    return [f"{fall.share_text(fall.after)}: {fall.text(fall.after)}{rows}"] if diagnosis.steps else []


def _left(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """The error that is left beside the noise, and what the difference means."""
    described = None if diagnosis.steps else _description(diagnosis)
    contradiction = getattr(diagnosis.before.floor, "contradiction", "")
    remarks = [contradiction] if contradiction else []
    left = fall.after if described is None else described.heldout_rms_um
    text = number_text(left, fall.unit) + (" with it" if described else "")
    if not fall.noise_known:
        return [f"{text}; {CANNOT_KNOW}", *remarks]
    if diagnosis.verdict in ("adequate", "identified", "ambiguous") or left**2 <= NOISE_RATIO * fall.noise**2:
        meaning = "only noise is left"
    elif diagnosis.steps or described:
        meaning = "something else acts as well"
    else:
        meaning = "these rows do not show what acts"
    return [f"{text}; noise {number_text(fall.noise, fall.unit)} ({fall.source}): {meaning}", *remarks]


def _sure(diagnosis: Diagnosis) -> list[str]:
    """Implausible numbers first, whether one session is all that there is, then chance and the other numbers."""
    links = diagnosis.after.aligned.rows.links
    steps, finding = diagnosis.steps, _description(diagnosis)
    numbers = [
        f"{step.effect.id} {name} = {text}" if len(steps) > 1 else f"{name} = {text}"
        for step in steps
        for name, text in parameter_texts(step, links).items()
    ]
    implausible = [text for text in numbers if IMPLAUSIBLE in text]
    names = _of_one_session(diagnosis)
    session = [f"{join_words(names)} seen in one session only: measure on another day"] if names else []
    chance = chance_clause([step.p_value for step in steps] or ([] if finding is None else [finding.p_value]))
    return [
        *implausible,
        *session,
        *([chance] if chance else []),
        *(text for text in numbers if text not in implausible),
    ]


def _of_one_session(diagnosis: Diagnosis) -> list[str]:
    """Thermal effects, or where none is named what the error follows, that rest on one session.

    All that warms up in a session rises together, so one session alone proves no thermal cause.
    """
    if session_count(diagnosis.after) > 1:
        return []
    finding = _description(diagnosis)
    if diagnosis.steps or finding is None:
        return [step.effect.id for step in diagnosis.steps if is_thermal(step.effect)]
    return [name for name in (finding.covariate, *finding.beside) if name.startswith(("temperature", "time"))]


def _or_else(diagnosis: Diagnosis) -> list[str]:
    """Rivals, then effects that could not be tried and are likely; where there are none, that there are none."""
    clauses = [f"{rivals_text(step)}: these rows cannot tell" for step in diagnosis.steps if step.rivals]
    untested = untested_here(diagnosis)
    likely = [effect for effect in untested if effect.likely]
    clauses += [f"{effect.effect} may be behind it and could not be tried: {effect.why}" for effect in likely]
    if not clauses and diagnosis.steps:
        clauses.append(NO_RIVAL)
    others = [effect.effect for effect in untested if not effect.likely]
    if diagnosis.verdict == "not_testable":
        clauses += [f"{effect.effect} {effect.why}" for effect in untested if not effect.likely][:MOST_NAMED]
    elif others:
        shown = others[:MOST_NAMED] + ([f"{len(others) - MOST_NAMED} more"] if len(others) > MOST_NAMED else [])
        clauses.append(f"could not be tried: {join_words(shown)}")
    return clauses


def _constant(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    return [] if diagnosis.constant is None else [constant_text(diagnosis.constant, fall.unit)]


def _next(diagnosis: Diagnosis, fall: ErrorFall) -> list[str]:
    """What to do: first what would change the verdict, then what may be done with it as it is."""
    ids = [step.effect.id for step in diagnosis.steps]
    recording = diagnosis.before.aligned.recording.path.name
    described = _description(diagnosis)
    to_vary = [str(row["measure"]) for row in diagnosis.next_measurement if "measure" in row][:1]
    if described is not None and described.covariate.startswith("time"):
        to_vary = ["measure again on another day, in another order: time alone is no driver"]
    changes = [finding.time_s for finding in diagnosis.depends_on if finding.effect]
    clauses = [] if fall.noise_known else [HOW_TO_KNOW_NOISE]
    clauses += [
        f"find out what happened at {time_s:.0f} s: the machine was another one before" for time_s in changes[:1]
    ]
    match diagnosis.verdict:
        case "identified":
            clauses += ["measure on another day first"] if _of_one_session(diagnosis) else []
            more = f", then {join_words(ids[1:])}" if len(ids) > 1 else ""
            clauses.append(f"add it: compd effect add {ids[0]} --recording {recording} --model FILE{more}")
            clauses.append("try it on another day's recording: compd compare OTHER.csv --model FILE")
        case "ambiguous":
            clauses.append("change nothing on the machine yet: what mends one does not mend its rival")
            clauses += _how_to_tell(diagnosis)
        case "partial":
            clauses += _how_to_tell(diagnosis)
            clauses += to_vary or ["record what may drive the rest: temperatures, loads, directions"]
            doubtful = [step.effect.id for step in diagnosis.steps if not all(n.plausible for n in step.parameters)]
            if doubtful:
                clauses.append(f"do not add {join_words(doubtful)}: something else looks like it")
            else:
                clauses.append("what was found may be added (compd effect add): it lowers the error, the rest stays")
        case "adequate":
            if diagnosis.constant is not None and diagnosis.constant.separated_by:
                clauses.append(f"to tell where the constant is from: {diagnosis.constant.separated_by}")
            clauses.append("nothing to mend or to add; other loads, temperatures or speeds may show more")
        case "not_testable":
            clauses += to_vary or ["vary one thing after the other: place, direction, load, temperature"]
        case _:
            clauses.append("change nothing on the machine yet")
            clauses += to_vary or ["record what may drive it: temperatures, loads, directions, humidity"]
            clauses += ["until the cause is known, the formulas below lower the error"] if described else []
    return clauses


def _how_to_tell(diagnosis: Diagnosis) -> list[str]:
    """What tells the effects that have rivals from these: planned rows, else the effects' own words."""
    rows = sum("measure" not in row for row in diagnosis.next_measurement)
    if rows:
        return [f"measure the {rows} rows below, which tell the rivals apart"]
    return [f"to tell {step.effect.id}: {step.effect.separated_by}" for step in diagnosis.steps if step.rivals]
