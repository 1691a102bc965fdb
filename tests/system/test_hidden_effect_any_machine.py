"""A machine without frame or joint comparators has a hidden effect: it is found, adopted, and the live error falls.

A linear delta with three scales and four thermometers, a 3-PRS whose target is z and two tilts, and a 6-UPS that gets
poses only; all gauges on Modbus TCP, their configurations from `compd machine new`. Nothing here knows what is hidden
before the end.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml

from compd.configuration import load
from compd.machine_kinds import KINDS, machine_text
from compd.simulation import Mechanism
from compd.simulation.truth.workspace import draw_points_mm
from tests.support.hidden_run import hidden_run, parse_output, write_unhurried
from tests.support.hidden_visits import Visit, check_visits, survey_visits, visits_to
from tests.support.pose_controller import pose_controller
from tests.support.simulated import run_directory

VISITS, CHECKS = 32, 8
SPEEDUP = "200"


class Machine(NamedTuple):
    """kind, own : as of `compd machine new`, and dimensions that are not the usual ones.

    thermometers : the places that have one.  hidden : strengths by cause.  scales : whether it has any; without, its
        controller is told poses.
    """

    kind: str
    own: dict[str, float]
    thermometers: tuple[str, ...]
    hidden: tuple[str, ...]
    scales: bool = True


MACHINES = {
    "linear delta": Machine("linear-delta", {}, ("link_1", "base", "platform", "room"), ("scale_gain=40",)),
    "3-PRS": Machine(
        "3-prs", {"platform_radius_mm": 200.0}, ("link_1", "link_2", "link_3", "room"), ("link_expansion=11",)
    ),
    "6-UPS": Machine("6-ups", {}, ("link_1", "base", "platform", "room"), ("base_joint_position=20",), scales=False),
}


def written(directory: Path, machine: Machine) -> Path:
    """The machine's configuration with thermometers, polled and served as many machines side by side are."""
    text = machine_text("mine", machine.kind, KINDS[machine.kind].usual._replace(**machine.own))
    data = yaml.safe_load(text.replace("{on: platform", '{"on": platform'))
    data["gauges"]["thermometers"] = {
        "driver": "modbus",
        "line": "cabinet",
        "unit": 2,
        "channels": [
            {"name": place, "function": 4, "address": i, "type": "int16", "scale": 0.01, "unit": "degC"}
            for i, place in enumerate(machine.thermometers)
        ],
    }
    data["wiring"]["quantities"] = [
        {"name": f"temperature_{place}_degC", "gauge": f"thermometers.{place}"} for place in machine.thermometers
    ]
    if not machine.scales:
        data["gauges"] = {"thermometers": data["gauges"]["thermometers"]}
        data["wiring"] = {"quantities": data["wiring"]["quantities"], "frame_drift_um": 0}
        data["sockets"]["target"] = {"valid_for_s": 60}
    return write_unhurried(directory / "mine.yaml", data)


def visits(path: Path) -> tuple[list[Visit], list[Visit]]:
    """Of the survey and of the check: boxes of three drives; of six, points that the simulated machine reaches."""
    mechanism = Mechanism(load(path).geometry)
    if mechanism.scales == 3:
        return survey_visits(2, VISITS, heaters=False), check_visits(3, CHECKS, heaters=False)
    points_mm = draw_points_mm(mechanism, np.random.default_rng(2), (VISITS + CHECKS) // 2)
    return visits_to(points_mm[: VISITS // 2], 2), visits_to(points_mm[VISITS // 2 :], 3)


@pytest.mark.long
@pytest.mark.parametrize("name", [pytest.param("linear delta", marks=pytest.mark.sample), "3-PRS", "6-UPS"])
def test_a_hidden_effect_is_found_and_the_live_error_falls(name: str) -> None:
    machine = MACHINES[name]
    options = [word for cause in machine.hidden for word in ("--effect", cause)]
    with ExitStack() as stack:
        directory = stack.enter_context(run_directory())
        path = written(directory, machine)
        run = stack.enter_context(
            hidden_run(directory, "--seed", "1", "--speedup", SPEEDUP, *options, configuration=path)
        )
        if not machine.scales:
            run.controller = stack.enter_context(pose_controller(run.socket, path))
        survey, checks = visits(path)
        recording, before_um = run.survey(survey, "survey")
        own = ("--machine", str(run.configuration))
        verdict = parse_output(run.compd("diagnose", recording, "--json", *own))
        named = [step["effect"] for step in verdict["steps"]]
        assert verdict["verdict"] in ("identified", "likely", "ambiguous")
        model = run.directory / "model.yaml"
        for effect in named:
            run.compd("model", "add", effect, "--recording", recording, "--model", model, *own)
        run.compd("model", "adopt", model, "--daemon", run.socket)
        after_um = run.tip_error_um(checks)
        floor_um = parse_output(run.compd("compare", recording, "--json", *own))["noise_floor_um"]
    causes = {cause.partition("=")[0] for cause in machine.hidden}
    assert causes <= {other for step in verdict["steps"] for other in (step["effect"], *step["rivals"])}
    assert after_um < floor_um < before_um
