"""The verdict in a sentence or two, for titles, notebooks and programs.

The words tell a cause from a share and from a description. "What is missing" is said only of effects that bring the
error down to the noise; above it an effect is a share of the error; what a residual follows is no cause.
"""

from __future__ import annotations

from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.error_fall import error_fall
from compd.diagnosis.words.phrases import (
    change_text,
    doubts,
    followed_text,
    little_clause,
    named_with_place,
    question_text,
    rivals_text,
    shown_by,
    thermal_in_one_session,
    too_small,
    was_any_tried,
)
from compd.text import join_words, number_text

# What confirms a thermal cause.
CONFIRM = "measure on another day, or let it cool down and warm up again"
# What decides between sets of effects.
DECIDE = "measure again under other conditions, and seal a part of the rows"


def summary(diagnosis: Diagnosis) -> str:
    """The verdict in a few sentences, which claim no more than it does."""
    against = doubts(diagnosis)
    return f"{_verdict(diagnosis)} But {'; '.join(against)}." if against else _verdict(diagnosis)


def _verdict(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences."""
    fall = error_fall(diagnosis)
    before, after = number_text(fall.before, fall.unit), number_text(fall.after, fall.unit)
    noise = f"where {fall.noise_text}" if fall.noise_known else fall.unknown
    names = join_words([named_with_place(step) for step in diagnosis.steps])
    match diagnosis.verdict:
        case "adequate" if fall.noise_known:
            but = " but for a constant" if diagnosis.constant else ""
            own, nothing = number_text(fall.noise, fall.unit), f"Nothing is missing{shown_by(diagnosis)}{but}"
            if (small := too_small(diagnosis)) is not None:
                return (
                    f"{nothing} that could be named: the error of {before} is little above the noise ({own}). "
                    f"{small.effect} may act: {small.why}."
                )
            if diagnosis.before.at_floor:
                return f"{nothing}: the error of {before} is the measurement's own noise ({own})."
            return f"{nothing} that could be named: the error of {before} is so little above the noise ({own})."
        case "identified":
            them = "it" if len(diagnosis.steps) == 1 else "them"
            return f"What is missing is {names}: with {them} the error of {before} falls to {after}, {noise}."
        case "likely":
            them, be = ("it", "is") if len(diagnosis.steps) == 1 else ("them", "are")
            falls = f"{names} {be} likely what is missing: with {them} the error of {before} falls to {after}, {noise}."
            if thermal_in_one_session(diagnosis):
                return f"{falls} One warm-up proves no cause: {CONFIRM}."
            if little := little_clause(diagnosis):
                return f"{falls} But {little}."
            return f"{falls} Another set may be as good (probability {diagnosis.probability:.2f}): {DECIDE}."
        case "ambiguous":
            pairs = "; ".join(rivals_text(step) for step in diagnosis.steps if step.rivals)
            falls = f"With {names} the error of {before} falls to {after}, {noise}."
            return f"{falls} But these rows cannot tell apart: {pairs}."
        case "adequate" | "not_testable":
            tried = "that was tried surely lowers it" if was_any_tried(diagnosis) else "can be tested on this recording"
            return " ".join([f"The error is {before}, {noise}. No effect {tried}.", *question(diagnosis)])
    if diagnosis.steps:
        verb = "explains" if len(diagnosis.steps) == 1 else "explain"
        remains = f"{fall.noise_text}, so something else acts as well" if fall.noise_known else fall.unknown
        share = f"{names} {verb} {fall.share_text(fall.after)} ({fall.text(fall.after)}); {remains}."
        return " ".join([share, *question(diagnosis), *_rest(diagnosis, "The rest")])
    unexplained = f"No effect that was tried explains the error of {before}, {noise}."
    asked = question(diagnosis)
    rest = [] if asked else ["It follows nothing that was measured."]
    return " ".join([unexplained, *asked, *(_rest(diagnosis, "It") or rest)])


def question(diagnosis: Diagnosis) -> list[str]:
    """What is asked about an implausible effect that explains much; empty where none does."""
    if (asked := diagnosis.asked) is None:
        return []
    share = error_fall(diagnosis).share_text(asked.heldout_rms_um)
    return [question_text(asked, share, diagnosis.before.aligned.rows.constants.tolerance_mm)]


def _rest(diagnosis: Diagnosis, what: str) -> list[str]:
    """What follows or changes, as a sentence; empty where nothing does.  what : its subject."""
    if not diagnosis.depends_on:
        return []
    fall, finding = error_fall(diagnosis), diagnosis.depends_on[0]
    left = f"to describe that leaves {number_text(finding.heldout_rms_um, fall.unit)}, and names no cause"
    if finding.is_change:
        return [f"Something changed: {change_text(finding, diagnosis)}; {left}."]
    return [f"{what} follows {followed_text(finding)}: {left}."]
