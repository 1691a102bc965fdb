"""One case of the scoreboard: the diagnosis of a prepared recording, and the other recording with its result."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import compare
from compd.comparison.open import open_recording
from compd.comparison.shape_search import search_constants
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.diagnose import diagnose
from compd.diagnosis.holdout import evaluate_holdout
from compd.errors import CompdError
from compd.model.effect import Effect, FittedEffect
from compd.model.library import load_library
from tests.scoreboard.two_axes import effects_of_file

ANSWER = "answer.json"


def prepared(campaigns: Path) -> list[Path]:
    """Directories of the cases that are on disk, in the order of their names."""
    return sorted(path.parent for path in campaigns.glob(f"*/{ANSWER}"))


def read_answer(directory: Path) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads((directory / ANSWER).read_text(encoding="utf-8"))
    return answer


def run(directory: Path, criteria: Criteria = Criteria()) -> dict[str, Any]:
    """One result: the diagnosis of the case in this directory beside its answer, which is opened afterwards."""
    begin_s = time.perf_counter()
    verdict, times_s, ratios = _diagnose(directory, criteria)
    took_s = time.perf_counter() - begin_s
    answer = read_answer(directory)
    return {
        "case": answer["case"],
        "family": answer["family"],
        "directory": str(directory),
        "verdict": verdict,
        "took_s": round(took_s, 3),
        "times_s": times_s,
        **ratios,
        "expected": answer["expected"],
        "answer": answer,
    }


def _diagnose(directory: Path, criteria: Criteria) -> tuple[dict[str, Any], list[float], dict[str, float | None]]:
    """Verdict as JSON, the times of the rows, and the floor ratios of the other recording, before and after."""
    machine = directory / "machine.yaml"
    opened = [
        open_recording(path, machine if machine.exists() else None)
        for name in ("train", "other")
        if (path := directory / f"{name}.csv").exists()
    ]
    effects = _effects(directory)
    known, covariance = _known(directory, opened[0], effects, criteria)
    diagnosis = diagnose(opened[0], known, covariance, effects, criteria=criteria)
    ratios: dict[str, float | None] = {}
    for other in opened[1:]:
        try:
            holdout = evaluate_holdout(diagnosis, other)
            ratios = {"other_before": holdout.before.floor_ratio, "other_floor_ratio": holdout.after.floor_ratio}
        except CompdError:
            ratios = {"other_before": None, "other_floor_ratio": None}
    return diagnosis.as_json(), opened[0].rows.time_s.tolist(), ratios


def _effects(directory: Path) -> Sequence[Effect]:
    """The library, and the effects of effects.yaml beside the recording."""
    own = directory / "effects.yaml"
    return [*load_library().values(), *(effects_of_file(own) if own.exists() else ())]


def _known(
    directory: Path, aligned: AlignedRecording, effects: Sequence[Effect], criteria: Criteria
) -> tuple[tuple[FittedEffect, ...], FloatArray | None]:
    """The effects that the model has already (known.json), fitted on the recording, with their covariance."""
    path = directory / "known.json"
    fitted: tuple[FittedEffect, ...] = ()
    covariance: FloatArray | None = None
    for name in json.loads(path.read_text(encoding="utf-8")) if path.exists() else ():
        effect = next(effect for effect in effects if effect.id == name)
        sigma_um = compare(aligned, fitted, covariance, criteria.comparison).floor.by_axis_um
        result = search_constants(aligned, fitted, effect, sigma_um, criteria.comparison)
        fitted, covariance = result.fitted, result.covariance
    return fitted, covariance
