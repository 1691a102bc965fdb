"""One case measured and diagnosed: its pages, and what the gallery says about it."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import compd
from compd.cli.app import app
from compd.configuration import shipped_configuration
from compd.diagnosis import Diagnosis, evaluate_holdouts
from compd.report import write_comparison_page, write_diagnosis_page
from docs.gallery.cases import Case


@dataclass(frozen=True)
class Result:
    """What is known of a case when its diagnosis is done and the answer file has been opened.

    summary : the verdict in words.  floor_um, before_um, after_um : noise and error on the rows of other days, rms per
    coordinate, without and with what was learned: the effects that were named, or where none was named
    (`described`) the formulas that were proposed.
    answer : the contents of the answer file.
    """

    case: Case
    verdict: str
    summary: str
    described: bool
    floor_um: float
    before_um: float
    after_um: float
    answer: dict[str, Any]


def run_case(case: Case, directory: Path) -> Result:
    """Measure and diagnose a case; write CASE-comparison.html and CASE-diagnosis.html to `directory`.

    Raises RuntimeError where the verdict is of another kind than the case is described for.
    """
    with _working_directory(case.name):
        _compd(case.campaign_command)
        _compd(case.other_days_command)
        learn, other = compd.open_recording("learn.csv"), compd.open_recording("other.csv")
        diagnosis = compd.diagnose(learn)
        diagnosis, (holdout,) = evaluate_holdouts(diagnosis, [other])
        write_comparison_page(directory / f"{case.name}-comparison.html", [diagnosis.before], shared_script=True)
        write_diagnosis_page(directory / f"{case.name}-diagnosis.html", diagnosis, [holdout], shared_script=True)
        formulas = _formulas(diagnosis)
        after_um = _rms_with(formulas) if formulas else holdout.after.rms_um
        # opened last, when nothing can be changed any more
        answer = json.loads(Path("learn.answer.json").read_text(encoding="utf-8"))
    if diagnosis.verdict != case.verdict:
        raise RuntimeError(f"{case.name} is described as {case.verdict}, but the verdict is: {diagnosis.summary}")
    return Result(
        case=case,
        verdict=diagnosis.verdict,
        summary=diagnosis.summary,
        described=bool(formulas),
        floor_um=holdout.before.floor.um,
        before_um=holdout.before.rms_um,
        after_um=after_um,
        answer=answer,
    )


@contextmanager
def _working_directory(name: str) -> Iterator[None]:
    """A temporary directory of that name, which pages show, with config/: commands run in it as they are printed."""
    with tempfile.TemporaryDirectory(prefix="compd-gallery-") as temporary:
        directory = Path(temporary) / name
        shutil.copytree(shipped_configuration("hexapod.yaml").parent, directory / "config")
        previous = Path.cwd()
        os.chdir(directory)
        try:
            yield
        finally:
            os.chdir(previous)


def _compd(arguments: Sequence[str]) -> None:
    """Run `compd` with these arguments, in this process to save its start."""
    with redirect_stdout(StringIO()):
        app(arguments, standalone_mode=False)


def _formulas(diagnosis: Diagnosis) -> Sequence[dict[str, Any]]:
    """What the diagnosis proposes where it names no effect, as declarations of effects."""
    return () if diagnosis.steps or not diagnosis.depends_on else diagnosis.depends_on[0].formula_effects


def _rms_with(formulas: Sequence[dict[str, Any]]) -> float:
    """Error on other days with the formulas, fitted on the rows to learn from."""
    model = None
    for formula in formulas:
        model = compd.add_effect(model, formula, "learn.csv")
    return compd.compare("other.csv", model).rms_um
