"""The verdict in a sentence or two, for titles, notebooks and programs.

The words tell a cause from a share and from a description. "What is missing" is said only of effects that bring the
error down to the noise; above it an effect is a share of the error; what a residual follows is no cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from compd.diagnosis.error_fall import error_fall
from compd.diagnosis.phrases import followed_text, rivals_text
from compd.number_text import join_words, number_text

if TYPE_CHECKING:
    from compd.diagnosis.verdict import Diagnosis

CANNOT_KNOW = "how much of it is noise cannot be known"


def summary(diagnosis: Diagnosis) -> str:
    """The verdict in one or two sentences, which claim no more than it does."""
    fall = error_fall(diagnosis)
    before, after = number_text(fall.before, fall.unit), number_text(fall.after, fall.unit)
    noise = f"where {fall.noise_text}" if fall.noise_known else CANNOT_KNOW
    names = join_words([step.effect.id for step in diagnosis.steps])
    match diagnosis.verdict:
        case "adequate":
            but = " but for a constant" if diagnosis.constant else ""
            return f"Nothing is missing{but}: the error is {before}, {noise}."
        case "identified":
            them = "it" if len(diagnosis.steps) == 1 else "them"
            return f"What is missing is {names}: with {them} the error of {before} falls to {after}, {noise}."
        case "ambiguous":
            pairs = "; ".join(rivals_text(step) for step in diagnosis.steps if step.rivals)
            return (
                f"With {names} the error of {before} falls to {after}, {noise}. But these rows cannot tell apart: {pairs}."
            )
        case "not_testable":
            return f"The error is {before}, {noise}. No effect can be tested on this recording."
    first = next((finding for finding in diagnosis.depends_on if not finding.effect), None)
    follows = "" if first is None else followed_text(first)
    if diagnosis.steps:
        verb = "explains" if len(diagnosis.steps) == 1 else "explain"
        rest = f"{fall.noise_text}, so something else acts as well" if fall.noise_known else CANNOT_KNOW
        share = f"{names} {verb} {fall.share_text(fall.after)} ({fall.text(fall.after)}); {rest}."
        return share + (f" The rest follows {follows}." if follows else "")
    if first is None:
        return f"No effect that was tried explains the error of {before}, {noise}. It follows nothing that was measured."
    left = number_text(first.heldout_rms_um, fall.unit)
    return (
        f"No effect that was tried explains the error of {before}. It follows {follows}, a description and no cause, "
        f"which leaves {left}, {noise}."
    )


