"""A cause that a number hides is found on wires on the kinds of machine that no other test runs in real time.

As in `test_hidden_effect_any_machine`, with scales and thermometers on Modbus TCP and no comparator. What is hidden
follows from a number, and is read at the end, to score.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from compd.configuration import Configuration, load
from compd.machine_kinds import KINDS
from compd.simulation import Mechanism, draw_hidden
from compd.simulation.causes.catalogue import CAUSES
from compd.simulation.truth.workspace import draw_points_mm
from tests.scoreboard.case import CONSTANT_CAUSES
from tests.support.hidden_run import hidden_run, parse_output
from tests.support.hidden_visits import visits_to
from tests.support.simulated import run_directory
from tests.system.test_hidden_effect import FALLS_SHORT, LEFT_OUT, NOT_LIVE, PLAIN_FLOORS
from tests.system.test_hidden_effect_any_machine import CHECKS, MACHINES, SPEEDUP, VISITS, Machine, written

THERMOMETERS = ("link_1", "link_2", "link_3", "base", "platform", "tool", "room")
# Each kind looks through its own numbers, so that the kinds do not all hide the same.
NUMBERS_PER_KIND = 100
OTHERS = tuple(kind for kind in KINDS if kind not in {machine.kind for machine in MACHINES.values()})


def plain_number(kind: str, configuration: Configuration) -> int:
    """The first of a kind's numbers that plainly hides an effect of the library which the daemon's tip can show."""
    mechanism = Mechanism(configuration.geometry)
    first = NUMBERS_PER_KIND * OTHERS.index(kind)
    for number in range(first, first + NUMBERS_PER_KIND):
        hidden = draw_hidden(number, mechanism, configuration.wiring)
        seen_live = hidden.id not in (*NOT_LIVE, *LEFT_OUT, *FALLS_SHORT)
        if hidden.floors >= PLAIN_FLOORS and seen_live and CAUSES[hidden.id].in_library:
            return number
    raise AssertionError(f"none of {NUMBERS_PER_KIND} numbers hides anything plainly in a {kind}")


@pytest.mark.long
@pytest.mark.parametrize("kind", OTHERS)
def test_what_a_number_hides_is_found_and_the_live_error_falls(kind: str) -> None:
    with run_directory() as directory:
        links = "123456" if KINDS[kind].legs != "three" else "123"
        places = (*(f"link_{i}" for i in links), *THERMOMETERS[3:])
        path = written(directory, Machine(kind, {}, places, ()))
        configuration = load(path)
        number = plain_number(kind, configuration)
        mechanism = Mechanism(configuration.geometry)
        # `compd recording join` needs the more places to find the clocks, the more scales there are
        visits = VISITS * (mechanism.scales - 1) // 2
        survey_mm, check_mm = (
            draw_points_mm(mechanism, np.random.default_rng(seed), count // 2)
            for seed, count in ((2, visits), (3, CHECKS))
        )
        hide = ("--seed", "1", "--speedup", SPEEDUP, "--hidden", str(number))
        with hidden_run(directory, *hide, configuration=path) as run:
            recording, before_um = run.survey(visits_to(survey_mm, 2), "survey")
            own = ("--machine", str(run.configuration))
            verdict = parse_output(run.compd("diagnose", recording, "--json", *own))
            model = run.directory / "model.yaml"
            for step in verdict["steps"]:
                run.compd("model", "add", step["effect"], "--recording", recording, "--model", model, *own)
            run.compd("model", "adopt", model, "--daemon", run.socket)
            after_um = run.tip_error_um(visits_to(check_mm, 3))
            (answer,) = run.directory.glob("**/*answer.json")
            (hidden,) = json.loads(answer.read_text(encoding="utf-8"))["answers"]
    named = {other for step in verdict["steps"] for other in (step["effect"], *step["rivals"])}
    right = set(CONSTANT_CAUSES) if hidden in CONSTANT_CAUSES else {hidden}
    assert named & right, (number, hidden, verdict["verdict"], named)
    assert after_um < before_um
