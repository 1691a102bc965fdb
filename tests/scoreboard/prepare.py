"""Preparing a case: two campaigns on one machine on different days, and the answer, which no diagnosis sees."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.recording import sidecar_contents, write_recording
from compd.simulation import FULLY_MEASURED, TRACKER, Cause, CauseSizer, Mechanism, build_cause, seen_by
from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import CampaignPlan
from compd.simulation.campaign.simulated_recording import OUTLIER_SHARE
from compd.simulation.causes.hidden_cause import HiddenCause, answer
from compd.simulation.truth.instruments import PIN
from tests.scoreboard import recording_faults as faults
from tests.scoreboard.campaign_days import SIZED_ON_USUAL_DAYS, air_at_zero, days, touched_plane
from tests.scoreboard.case import THERMOMETERS, Case
from tests.scoreboard.case_machine import configuration_of, period_mm
from tests.scoreboard.expectation import ALWAYS_THERE, LEFT_UM, expectation
from tests.scoreboard.external_machine import ExternalMachine
from tests.scoreboard.external_machines import machine_of
from tests.scoreboard.hard_cases import PLANE, RE_MOUNTED, ROUNDED, WRONG_NOISE, ZERO_ELSEWHERE
from tests.scoreboard.sudden_change import NoCause, SuddenChange

# What is there of a play before it grows.
PLAY_BEFORE = 0.4
# Part of the visits between which a change lies.
CHANGE_WITHIN = (0.25, 0.75)
RECORDINGS = ("train", "other")
# The declared over the true noise.
WRONG_FACTORS = (0.1, 0.2, 5.0, 10.0)


def directory_of(case: Case, campaigns: Path) -> Path:
    """Where a case is kept."""
    return campaigns / case.name.replace(":", "_")


def prepare(case: Case, campaigns: Path) -> Path:
    """Directory of the case's two campaigns, on the same machine on different days; made once.

    train.csv and other.csv with their sidecars are for the diagnosis, and so are machine.yaml where the machine is not
    as shipped, and effects.yaml where compd does not know it; answer.json is for scoring.
    """
    directory = directory_of(case, campaigns)
    if (directory / "answer.json").exists():
        return directory
    directory.mkdir(parents=True, exist_ok=True)
    machine = machine_of(case)
    contents = _record(case, directory) if machine is None else _record_external(case, machine, directory)
    (directory / "answer.json").write_text(json.dumps(contents, indent=1) + "\n", encoding="utf-8")
    return directory


def _record_external(case: Case, machine: ExternalMachine, directory: Path) -> dict[str, Any]:
    """Write the recordings of a machine that compd does not know, with its effects; returns the answer."""
    shutil.copyfile(machine.effects, directory / "effects.yaml")
    made = [machine.record(case, number) for number in range(len(RECORDINGS))]
    for name, recorded in zip(RECORDINGS, made, strict=True):
        write_recording(directory / f"{name}.csv", recorded.columns, recorded.sidecar, overwrite=True)
    first = made[0]
    contents = {
        "case": case.name,
        "family": case.family,
        "seed": case.seed,
        "effects": first.strengths,
        "answers": list(case.causes),
        "follows": [],
        "kind": "library",
        "units": dict.fromkeys(case.causes, machine.unit),
        "error_in_floors": dict(zip(case.causes, case.floors, strict=True)),
        "weak_disturbances": {},
        ALWAYS_THERE: list(machine.constants),
        LEFT_UM: first.left_um,
    }
    return contents | {"expected": expectation(case, contents, None).as_json()}


def _record(case: Case, directory: Path) -> dict[str, Any]:
    """Write the campaigns of a machine that compd knows; returns the answer."""
    configuration = configuration_of(case, directory)
    geometry, wiring = configuration.geometry, configuration.wiring
    if case.family == "period":
        # only the simulated machine knows the period
        geometry = geometry.model_copy(update={"scale_signal_period_mm": period_mm(case)})
    mechanism = Mechanism(geometry)
    places = touched_plane(case, mechanism) if case.family == PLANE else None
    plans = [days(case, mechanism, number, places) for number in range(len(RECORDINGS))]
    sized_on = None if case.family in SIZED_ON_USUAL_DAYS else plans[0]
    sizer = CauseSizer(geometry, wiring, case.seed, air_at_zero=air_at_zero(case), plan=sized_on)
    hidden = [sizer.size(HiddenCause(*wanted)) for wanted in zip(case.causes, [None] * 9, case.floors, strict=False)]
    weak = sizer.weak_disturbances(case.causes)
    contents: dict[str, Any] = {"case": case.name, "family": case.family, "seed": case.seed, **answer(hidden, weak)}
    change_s: float | None = None
    for number, (name, plan) in enumerate(zip(RECORDINGS, plans, strict=True)):
        if case.family == "change" and number == 0:
            change_s = _change_s(case, plan)
        causes = [_as_it_acts(cause.cause, change_s if number == 0 else None, case.seed) for cause in hidden]
        disturbances = [build_cause(cause.id, cause.strength, sizer.mechanism, case.seed) for cause in weak]
        instrument = replace(TRACKER if places is None else PIN, outlier_share=OUTLIER_SHARE)
        campaign = Campaign(
            geometry,
            wiring,
            plan,
            case.seed,
            seen_by(FULLY_MEASURED, len(wiring.joint)),
            [*causes, *disturbances],
            reference=instrument,
            places=places,
        )
        logged = campaign.run()
        columns = {key: np.array(values) for key, values in logged.columns.items()}
        if places is not None:
            columns = faults.on_a_plane(columns, places.tip_M)
        recorded = _as_recorded(case, columns, case.rng(name))
        if number == 0 and case.family == RE_MOUNTED:
            recorded, change_s = faults.with_target_re_mounted(recorded, case.rng("mounting"))
        if number == 0 and case.family == ROUNDED:
            contents[LEFT_UM] = faults.rms_um(recorded, columns)
        at_zero = None if _zero_is_unknown(case) else logged.quantities_at_zero
        sidecar = sidecar_contents(configuration.machine, _reference(case), quantities_at_zero=at_zero)
        write_recording(directory / f"{name}.csv", recorded, sidecar, overwrite=True)
    contents["zero_is_unknown"] = _zero_is_unknown(case)
    contents["expected"] = expectation(case, contents, change_s).as_json()
    return contents


def _reference(case: Case) -> dict[str, Any]:
    """What the sidecar says of the reference."""
    frame = "instrument" if case.family == "unregistered" else "machine"
    reference: dict[str, Any] = {"quantity": "tool_position", "sigma_um": TRACKER.sigma_um, "frame": frame}
    if case.family == WRONG_NOISE:
        reference["sigma_um"] = round(TRACKER.sigma_um * float(case.rng("declared").choice(WRONG_FACTORS)), 4)
    if case.family == ROUNDED:
        # of the value that is shown nobody knows how much it scatters
        del reference["sigma_um"]
    return reference


def _zero_is_unknown(case: Case) -> bool:
    return case.family == ZERO_ELSEWHERE and bool(case.rng("known").uniform() < 0.5)


def _change_s(case: Case, plan: CampaignPlan) -> float:
    """When the change happens: as the machine sets out for one of the visits in the middle."""
    share = case.rng("change").uniform(*CHANGE_WITHIN)
    return plan.items[round(share * len(plan.items))].start_s


def _as_it_acts(cause: Cause, change_s: float | None, seed: int) -> Cause:
    """The cause with a memory of its own; from `change_s` on where that is given, a play only smaller before."""
    fresh = build_cause(cause.id, cause.strength, cause.mechanism, seed)
    if change_s is None:
        return fresh
    before: Cause = NoCause(cause.mechanism)
    if cause.id == "backlash":
        before = build_cause(cause.id, PLAY_BEFORE * cause.strength, cause.mechanism, seed)
    return SuddenChange(before, fresh, change_s)


def _as_recorded(case: Case, columns: Mapping[str, FloatArray], rng: np.random.Generator) -> dict[str, FloatArray]:
    """The columns with what happens to recordings of this family."""
    match case.family:
        case "glints":
            return faults.with_glints(columns, rng)
        case "shifted":
            return faults.with_shift(columns)
        case "drift":
            return faults.with_wander(columns, rng, comes_back=case.seed % 2 == 0)
        case "unregistered":
            return faults.in_instrument_frame(columns, rng)
        case "distractors":
            return faults.with_distractors(columns, rng)
        case "blind":
            return faults.without(columns, THERMOMETERS[case.causes[0]])
        case "rounded":
            return faults.in_steps(columns, case.rng("step"))
    return dict(columns)
