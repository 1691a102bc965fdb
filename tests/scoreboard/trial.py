"""One case of the scoreboard: the diagnosis of a prepared recording, and the other recording with its result."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording, compare, open_recording, search_constants
from compd.diagnosis import Criteria, Diagnosis, Holdout, diagnose, evaluate_holdouts
from compd.errors import CompdError
from compd.model.effects import Effect, FittedEffect
from compd.model.library import load_effects, load_library
from tests.scoreboard.commit import commit

ANSWER = "answer.json"
# The family for which it is computed what the true effects, fitted, leave on the other recording: a bound, set by the
# disturbances and by heat that no thermometer sees.
BOUNDED = "library"


def prepared(campaigns: Path) -> list[Path]:
    """Directories of the cases that are on disk, in the order of their names."""
    return sorted(path.parent for path in campaigns.glob(f"*/{ANSWER}"))


def read_answer(directory: Path) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads((directory / ANSWER).read_text(encoding="utf-8"))
    return answer


def run(directory: Path, criteria: Criteria = Criteria()) -> dict[str, Any]:
    """One result: the diagnosis of the case in this directory beside its answer, which is opened afterwards."""
    diagnosis, took_s = diagnose_case(directory, criteria)
    train, other = diagnosis.before.aligned, _open(directory, "other")
    answer = read_answer(directory)
    expected = answer["expected"]
    bounded = answer["family"] == BOUNDED
    holdout = _on_other_day(diagnosis, other)
    true_effects = _fitted(answer["answers"], train, _effects(directory))[0] if bounded else ()
    return {
        "case": answer["case"],
        "family": answer["family"],
        "directory": directory.name,
        "verdict": diagnosis.as_json(),
        "commit": commit(),
        "took_s": round(took_s, 3),
        "other_day": None if holdout is None else holdout.as_json(),
        "other_floor_ratio": None if holdout is None else holdout.after.floor_ratio,
        "true_floor_ratio": _floor_ratio(other, true_effects) if bounded else None,
        "times_s": train.rows.time_s.tolist() if "change" in expected else [],
        "expected": expected,
        "answer": answer,
    }


def diagnose_case(directory: Path, criteria: Criteria = Criteria()) -> tuple[Diagnosis, float]:
    """The diagnosis of train.csv, and the processor time that it took, s; the answer is not looked at."""
    train = _open(directory, "train")
    if train is None:
        raise FileNotFoundError(directory / "train.csv")
    effects = _effects(directory)
    known, covariance = _known(directory, train, effects)
    begin_s = time.process_time()
    diagnosis = diagnose(train, known, covariance, effects, criteria=criteria)
    return diagnosis, time.process_time() - begin_s


def _open(directory: Path, name: str) -> AlignedRecording | None:
    """A recording of the case; None where there is none."""
    path, machine = directory / f"{name}.csv", directory / "machine.yaml"
    return open_recording(path, machine if machine.exists() else None) if path.exists() else None


def _on_other_day(diagnosis: Diagnosis, other: AlignedRecording | None) -> Holdout | None:
    """The other recording with what was found; None without one, or where it lacks what this needs."""
    try:
        return None if other is None else evaluate_holdouts(diagnosis, [other])[1][0]
    except CompdError:
        return None


def _floor_ratio(other: AlignedRecording | None, fitted: Sequence[FittedEffect]) -> float | None:
    """Floor ratio of the other recording with these effects; None without one, or where it lacks what they need."""
    if other is None:
        return None
    try:
        return compare(other, fitted).floor_ratio
    except CompdError:
        return None


def _effects(directory: Path) -> Sequence[Effect]:
    """The library, and the effects of effects.yaml beside the recording."""
    own = directory / "effects.yaml"
    return [*load_library().values(), *(load_effects(own).values() if own.exists() else ())]


def _known(
    directory: Path, aligned: AlignedRecording, effects: Sequence[Effect]
) -> tuple[tuple[FittedEffect, ...], FloatArray | None]:
    """The effects that the model has already (known.json), fitted on the recording."""
    path = directory / "known.json"
    names = json.loads(path.read_text(encoding="utf-8")) if path.exists() else ()
    return _fitted(names, aligned, effects)


def _fitted(
    names: Sequence[str], aligned: AlignedRecording, effects: Sequence[Effect]
) -> tuple[tuple[FittedEffect, ...], FloatArray | None]:
    """These effects, fitted on the recording one after the other, with their covariance."""
    fitted: tuple[FittedEffect, ...] = ()
    covariance: FloatArray | None = None
    for name in names:
        effect = next(effect for effect in effects if effect.id == name)
        sigma_um = compare(aligned, fitted, covariance).floor.by_axis_um
        result = search_constants(aligned, fitted, effect, sigma_um)
        fitted, covariance = result.fitted, result.covariance
    return fitted, covariance
