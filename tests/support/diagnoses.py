"""Diagnoses made of given numbers, for tests of what is said and drawn of them: nothing is searched or fitted."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from compd.comparison import AlignedRecording, Comparison, compare
from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.noise_floor import NoiseFloor
from compd.diagnosis import Diagnosis, DiagnosisStep, EmpiricalFinding
from compd.diagnosis.findings import ParameterEstimate, Rival
from compd.diagnosis.verdict import Verdict
from compd.diagnosis.words.summary import summary
from compd.model.effects import Effect, FittedEffect
from compd.model.formula import formula_effect
from compd.model.library import load_library
from compd.recording import read_recording
from tests.support.measured import aligned as align_tripod
from tests.support.measured import gauges, record

ROWS = 60
FRAME = ("temperature_frame_degC", "temperature_bed_degC")


@cache
def tripod_recording(sessions: int = 4) -> AlignedRecording:
    """`monday.csv` of the shipped tripod, with temperatures, loads and directions, in four sessions, or in one in which
    everything warms up."""
    columns = dict(gauges(ROWS, 3))
    if sessions == 1:
        columns["session"] = np.ones(ROWS)
        warm = {name: np.sort(values) for name, values in columns.items() if name.startswith("temperature_")}
        columns |= warm
    with tempfile.TemporaryDirectory() as directory:
        return align_tripod(record(Path(directory), columns, name="monday"))


@cache
def external_recording(axes: str = "x", quantities: tuple[str, ...] = (), direction: bool = False) -> AlignedRecording:
    """`stage.csv` of a machine with a model of its own; a row every 100 s, that is row 62 at 6000 s.

    direction : whether `moved_1` is -1 or 1.
    """
    rng = np.random.default_rng(5)
    columns: dict[str, Any] = {"time_s": np.arange(ROWS * 2) * 100.0}
    columns |= {name: rng.uniform(-1, 1, ROWS * 2) for name in ("position_mm", "moved_1", *quantities)}
    if direction:
        columns["moved_1"] = rng.choice([-1.0, 1.0], ROWS * 2)
    for axis in axes:
        columns[f"model_{axis}_mm"] = np.zeros(ROWS * 2)
        columns[f"reference_{axis}_mm"] = rng.normal(0, 1e-3, ROWS * 2)
    lines = [
        ",".join(columns),
        *(",".join(f"{value:.6g}" for value in row) for row in zip(*columns.values(), strict=True)),
    ]
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "stage.csv"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        path.with_suffix(".yaml").write_text(
            "machine: external\nreference: {quantity: tool_position, frame: machine, sigma_um: 1.0}\n", encoding="utf-8"
        )
        return align_recording(read_recording(path, None), None)


def formula(name: str, text: str, physics: str, low: float = -20.0, high: float = 20.0, **more: Any) -> Effect:
    """A formula of one parameter b, in um, along x of an external machine."""
    parameters = {"b": {"unit": "um", "plausible": [low, high], "source": "a test"}}
    source = {"id": name, "port": "reference", "axis": "x", "formula": text, "parameters": parameters, **more}
    return formula_effect(source | ({"physics": physics} if physics else {}), "test")


def step(
    effect: str | Effect,
    values: Sequence[float],
    std: float,
    left_um: float,
    *,
    rivals: Mapping[str, float] | None = None,
    p_value: float = 0.001,
    plausible: bool = True,
    links: int = 3,
) -> DiagnosisStep:
    """An effect that was found; `left_um` with it and those before it.  rivals : similarity by id."""
    effect = load_library()[effect] if isinstance(effect, str) else effect
    columns = effect.columns(links)
    estimates = [
        ParameterEstimate(column.name, value, std, column.parameter.unit, plausible)
        for column, value in zip(columns, values, strict=True)
    ]
    theta = np.array([column.parameter.to_theta(value) for column, value in zip(columns, values, strict=True)])
    return DiagnosisStep(
        fitted=FittedEffect(effect, theta),
        rivals=tuple(Rival(0, name, cosine, 0.0, 0.1) for name, cosine in (rivals or {}).items()),
        heldout_rms_um=left_um,
        explained_fraction=0.9,
        p_value=p_value,
        parameters=tuple(estimates),
    )


def description(covariate: str, form: str, left_um: float, share: float, **more: Any) -> EmpiricalFinding:
    """What a residual follows."""
    unit = covariate.rsplit("_", 1)[-1]
    term = {
        "id": f"reference_follows_{covariate.lower()}_{form}_x",
        "port": "reference",
        "formula": f"k * {covariate}",
        "axis": "x",
        "physics": "A description, not a cause: the residual follows this on the recordings that were looked at.",
        "parameters": {"k": {"unit": f"um/{unit}", "plausible": [-3.0, 3.0], "source": "describes a residual"}},
    }
    fields: dict[str, Any] = {"formula_effects": (term,), "parameters": ({"k": 1.0},), "p_value": 0.001, **more}
    return EmpiricalFinding(covariate, form, "reference", explained_fraction=share, heldout_rms_um=left_um, **fields)


def described_by_two(physics: str, **fields: Any) -> Diagnosis:
    """An error that two temperatures describe, each by a formula; physics : in words, of the first; fields : others."""
    first, second = (description(name, "linear", 5.5, 0.998).formula_effects[0] for name in FRAME)
    finding = description(
        FRAME[0],
        "linear",
        5.5,
        0.998,
        beside=FRAME[1:],
        formula_effects=({**first, "physics": physics}, second),
        parameters=({"k": 0.4}, {"k": -0.2}),
    )
    recording = external_recording("x", quantities=FRAME)
    return diagnosis("unexplained", 115.0, 115.0, Noise(1.1), recording, depends_on=[finding], **fields)


@dataclass(frozen=True)
class Noise:
    """The noise floor of a made diagnosis."""

    um: float
    source: Any = "repeats"
    contradiction: str = ""


def diagnosis(
    verdict: Verdict,
    before_um: float,
    after_um: float,
    noise: Noise,
    recording: AlignedRecording | None = None,
    **fields: Any,
) -> Diagnosis:
    """A diagnosis whose errors on rows left out are before_um and after_um; other fields as `Diagnosis` has them."""
    recording = tripod_recording() if recording is None else recording
    by_axis_um = np.full(len(recording.labels), noise.um)
    floor = NoiseFloor(by_axis_um, noise.source, f"by {noise.source}", 100.0, noise.contradiction)
    comparison = replace(compare(recording), floor=floor)
    before, after = _scaled(comparison, before_um), _scaled(comparison, after_um)
    after = replace(after, fitted=tuple(found.fitted for found in fields.get("steps", ())))
    for name in ("steps", "candidates", "depends_on", "untested"):
        fields[name] = tuple(fields.get(name, ()))
    heldout = {"heldout_before_um": before_um, "heldout_after_um": after_um}
    made = Diagnosis(verdict, before, after, **{**heldout, **fields})
    return replace(made, summary=summary(made))


def _scaled(comparison: Comparison, rms_um: float) -> Comparison:
    """The comparison with its residual as large as wanted."""
    if math.isnan(rms_um):
        return comparison
    return replace(comparison, residual_um=comparison.residual_um * (rms_um / comparison.rms_um))
