"""The steps of a model file as a table, for a terminal and for the page."""

from __future__ import annotations

from compd.model_file import StoredModel
from compd.text import number_text

LEDGER_HEAD = ("", "step", "fitted on", "before", "after", "floor", "unit", "date")


def ledger_rows(model: StoredModel) -> list[list[str]]:
    """One line per step."""
    return [
        [
            str(k),
            f"{step.kind} {step.effect}".rstrip() + (" (undone)" if step.undone else ""),
            step.recording,
            number_text(step.rms_before_um, digits=3),
            number_text(step.rms_after_um, digits=3),
            number_text(step.noise_floor_um, digits=3),
            step.unit,
            step.date[:10],
        ]
        for k, step in enumerate(model.steps, start=1)
    ]
