"""Preparing a case: two campaigns on one machine on different days, and the answer, which no diagnosis sees."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration, load, shipped_configuration
from compd.machine_kinds import KINDS, Dimensions, machine_text
from compd.recording import sidecar_contents, write_recording
from compd.simulation import FULLY_MEASURED, TRACKER, AirAtZero, Cause, CauseSizer, Mechanism, build_cause, seen_by
from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import CampaignPlan, draw_campaign_plan
from compd.simulation.campaign.simulated_recording import OUTLIER_SHARE
from compd.simulation.causes.hidden_cause import HiddenCause, answer
from compd.simulation.causes.sudden_change import NoCause, SuddenChange
from tests.scoreboard import recording_faults as faults
from tests.scoreboard.cases import KINDS_FAMILY, THERMOMETERS, Case
from tests.scoreboard.expectation import expectation

SHORT_ROWS = 90
WARM_UP_S = 1500.0
# Period that nobody has configured, mm: a screw's pitch, a gear's turn.
PERIOD_MM = (0.7, 6.0)
# What is there of a play before it grows.
PLAY_BEFORE = 0.4
# Part of the visits between which a change lies.
CHANGE_WITHIN = (0.25, 0.75)
# Dimensions of a machine of a kind, over the usual ones.
DIMENSION_SHARES = (0.9, 1.1)
RECORDINGS = ("train", "other")
# Temperatures of machine and room when machine zero is taken: of a cold hall, a laboratory, two shops in summer.
ZERO_degC = (15.0, 20.0, 23.0, 27.0)


def directory_of(case: Case, campaigns: Path) -> Path:
    """Where a case is kept."""
    return campaigns / case.name.replace(":", "_")


def prepare(case: Case, campaigns: Path) -> Path:
    """Directory of the case's two campaigns, on the same machine on different days; made once.

    train.csv and other.csv with their sidecars are for the diagnosis, and so is machine.yaml where the machine is not
    as shipped; answer.json is for scoring.
    """
    directory = directory_of(case, campaigns)
    if (directory / "answer.json").exists():
        return directory
    directory.mkdir(parents=True, exist_ok=True)
    configuration = _configuration(case, directory)
    geometry = configuration.geometry
    if case.family == "period":
        # only the simulated machine knows the period
        geometry = geometry.model_copy(update={"scale_signal_period_mm": _period_mm(case)})
    sizer = CauseSizer(geometry, configuration.wiring, case.seed, air_at_zero=_air_at_zero(case))
    hidden = [sizer.size(HiddenCause(*wanted)) for wanted in zip(case.causes, [None] * 9, case.floors, strict=False)]
    weak = sizer.weak_disturbances(case.causes)
    contents = {"case": case.name, "family": case.family, "seed": case.seed, **answer(hidden, weak)}
    change_s: float | None = None
    for number, name in enumerate(RECORDINGS):
        plan = _plan(case, sizer.mechanism, number)
        if case.family == "change" and number == 0:
            change_s = _change_s(case, plan)
        causes = [_as_it_acts(cause.cause, change_s if number == 0 else None, case.seed) for cause in hidden]
        disturbances = [build_cause(cause.id, cause.strength, sizer.mechanism, case.seed) for cause in weak]
        instrument = replace(TRACKER, outlier_share=OUTLIER_SHARE)
        campaign = Campaign(
            geometry,
            configuration.wiring,
            plan,
            case.seed,
            seen_by(FULLY_MEASURED, len(configuration.wiring.joint)),
            [*causes, *disturbances],
            reference=instrument,
        )
        logged = campaign.run()
        columns = {key: np.array(values) for key, values in logged.columns.items()}
        frame = "instrument" if case.family == "unregistered" else "machine"
        reference = {"quantity": "tool_position", "sigma_um": instrument.sigma_um, "frame": frame}
        write_recording(
            directory / f"{name}.csv",
            _as_recorded(case, columns, case.rng(name)),
            sidecar_contents(configuration.machine, reference, quantities_at_zero=logged.quantities_at_zero),
            overwrite=True,
        )
    contents["expected"] = expectation(case, contents, change_s).as_json()
    (directory / "answer.json").write_text(json.dumps(contents, indent=1) + "\n", encoding="utf-8")
    return directory


def _configuration(case: Case, directory: Path) -> Configuration:
    """The machine's configuration, the shipped one or the case's own."""
    if case.family == KINDS_FAMILY:
        path = directory / "machine.yaml"
        path.write_text(machine_text(case.kind, case.kind, _dimensions(case)), encoding="utf-8")
        return load(path)
    if case.family != "period":
        return load(shipped_configuration("hexapod.yaml" if case.family == "hexapod" else "tripod-cmm.yaml"))
    text = shipped_configuration("tripod-cmm.yaml").read_text(encoding="utf-8")
    path = directory / "machine.yaml"
    path.write_text(re.sub(r"(?m)^ *scale_signal_period_mm:.*\n", "", text), encoding="utf-8")
    return load(path)


def _dimensions(case: Case) -> Dimensions:
    """Of a machine like the usual one of its kind, and of no other size by much."""
    usual = KINDS[case.kind].usual
    shares = case.rng("dimensions").uniform(*DIMENSION_SHARES, len(usual)).tolist()
    return Dimensions(*(round(value * share, 1) for value, share in zip(usual, shares, strict=True)))


def _period_mm(case: Case) -> float:
    low, high = np.log(PERIOD_MM)
    return round(float(np.exp(case.rng("period").uniform(low, high))), 3)


def _plan(case: Case, mechanism: Mechanism, number: int) -> CampaignPlan:
    """What is measured in the campaign with this number."""
    warm_up_s = WARM_UP_S if case.family == "warm-start" else 0.0
    plan = draw_campaign_plan(mechanism, case.seed, number, warm_up_s=warm_up_s, air_at_zero=_air_at_zero(case))
    return plan.single_visits(SHORT_ROWS) if case.family == "short" and number == 0 else plan


def _air_at_zero(case: Case) -> AirAtZero:
    """The air when machine zero is taken."""
    rng = case.rng("zero")
    return AirAtZero(float(rng.choice(ZERO_degC)), round(float(rng.uniform(950.0, 1030.0)), 1), 40.0)


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
    return dict(columns)
