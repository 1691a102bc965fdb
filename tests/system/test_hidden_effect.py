"""The machine has an effect that the daemon's model lacks: it is found, adopted, and the live error falls.

Everything goes through the commands that a person would use, on wires. What is hidden is in a sealed file that is
opened here at the end, to score. For each cause the number is the first that hides it plainly, not one that suits:
the first test here holds that.

Not covered: LEFT_OUT, with the reason; causes at the reference instrument and those that follow time, for the daemon's
tip has no part in them; one machine, the tripod, with one seed. A further small effect beside those that are hidden is
no failure here: the scoreboard counts these.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from compd.simulation.causes.catalogue import CAUSES
from compd.simulation.causes.hidden_cause import draw_hidden
from compd.simulation.truth.mechanism import Mechanism
from tests.scoreboard.scoring import follows
from tests.support.hidden_run import HiddenRun, hidden_run, parse_output
from tests.support.hidden_visits import check_visits, survey_visits
from tests.support.simulated import run_directory, tripod


class Pace(NamedTuple):
    """By how much weather and warm-up are faster than the machine; whether heaters are switched on and off."""

    speedup: str
    heaters: bool


# A minute on the machine is three hours of warm-up; pressure and humidity take longer, and then the frame must not
# move with the heaters while it is being read.
HOURS, DAYS = Pace("200", True), Pace("900", False)
# Numbers for `--hidden`. Two are run with all the tests, the others by `make hidden`.
QUICK = (4, 8)
ONE = (2, 3, 10, 18, 21, 24, 25, 33, 48, 49, 54, 56, 60, 69, 77, 89, 96, 131, 132, 178)
PAIRS = ([4, 10], [8, 10], [18, 56])
OUTSIDE = {20: HOURS, 15: DAYS, 1: DAYS}
# Of the long tests, `make hidden-sample` runs the first pair and this one.
SAMPLE_OUTSIDE = 20
LEFT_OUT = {
    28: "gauge latency shows on the move alone, and here all is measured at rest",
    16: "a lag of minutes is seconds where weather is faster: below what the library takes for plausible",
}
# Named rightly, but what is left is above the noise floor.
FALLS_SHORT = {
    49: "friction of 3.9 floors, of another form than the library's: 0.20 of 0.81 um are left, the floor is 0.16",
}
# Numbers below this are looked through; a cause is plain from so many times the noise.
NUMBERS = 300
PLAIN_FLOORS = 2.5
# What the daemon's tip has no part in: the reference instrument shows another place, or a moment passes.
NOT_LIVE = (
    "plate_bending",
    "reference_drift",
    "reference_air_index",
    "reference_registration",
    "plate_swelling",
    "collision_step",
    "room_breathing",
)
VISITS, CHECKS = 40, 10
TIMEOUT_S = 600
# A hidden effect is plain when the squared error is so many times what noise alone would give.
PLAIN_RATIO = 2.0


class Outcome(NamedTuple):
    """What was seen and said; um rms per coordinate. before, after: of the live tip against the truth."""

    compared: dict[str, Any]
    verdict: dict[str, Any]
    before_um: float
    after_um: float
    secret: dict[str, Any]


def add_named_effects(run: HiddenRun, verdict: dict[str, Any], recording: Path, model: Path) -> None:
    """What the diagnosis names; where it names no effect, the description that it proposes."""
    named = [step["effect"] for step in verdict["steps"]]
    for number, formula in enumerate(verdict["depends_on"][0]["formula_effects"] if verdict["depends_on"] else []):
        path = run.directory / f"formula_{number}.yaml"
        path.write_text(yaml.safe_dump(formula), encoding="utf-8")
        named.append(str(path))
    for effect in named:
        run.compd("effect", "add", effect, "--recording", recording, "--machine", run.configuration, "--model", model)


def run_hidden(hidden: list[int], directory: Path, pace: Pace = HOURS) -> Outcome:
    """Survey, diagnose, adopt: from a machine with hidden causes to the daemon that compensates them."""
    options = [word for number in hidden for word in ("--hidden", str(number))]
    with hidden_run(directory, "--seed", "1", "--speedup", pace.speedup, *options) as run:
        recording, before_um = run.survey(survey_visits(2, VISITS, heaters=pace.heaters), "survey")
        machine = ("--machine", str(run.configuration))
        compared = parse_output(run.compd("compare", recording, "--json", *machine))
        verdict = parse_output(run.compd("diagnose", recording, "--json", *machine))
        model = run.directory / "model.yaml"
        add_named_effects(run, verdict, recording, model)
        if model.exists():
            run.compd("adopt", model, "--daemon", run.socket)
        after_um = run.tip_error_um(check_visits(3, CHECKS, heaters=pace.heaters))
    secret = json.loads((run.directory / "hidden.answer.json").read_text(encoding="utf-8"))
    return Outcome(compared, verdict, before_um, after_um, secret)


def check_found(outcome: Outcome) -> None:
    """Seen, named, and taken away: what is left is less than the noise of the measurement itself."""
    verdict, floor_um = outcome.verdict, outcome.compared["noise_floor_um"]
    assert outcome.compared["floor_ratio"] > PLAIN_RATIO
    named = {name for step in verdict["steps"] for name in (step["effect"], *step["rivals"])}
    assert named >= set(outcome.secret["answers"]), (outcome.secret, verdict["steps"])
    assert verdict["verdict"] in ("identified", "ambiguous")
    assert outcome.after_um < floor_um < outcome.before_um


def check_described(outcome: Outcome) -> None:
    """No effect is named for what the library has not; what it follows is, and its description takes it away."""
    verdict, floor_um = outcome.verdict, outcome.compared["noise_floor_um"]
    assert outcome.compared["floor_ratio"] > PLAIN_RATIO
    assert (verdict["verdict"], verdict["steps"]) == ("unexplained", [])
    proposed = {trend["covariate"] for trend in verdict["depends_on"][:2]}
    assert proposed & follows(outcome.secret), (outcome.secret, proposed)
    assert outcome.after_um < floor_um < outcome.before_um


def test_every_live_cause_is_run_by_the_first_number_that_hides_it() -> None:
    machine = Mechanism(tripod())
    first: dict[str, int] = {}
    for number in range(NUMBERS):
        cause, _, floors = draw_hidden(number, machine)
        if cause not in NOT_LIVE and floors >= PLAIN_FLOORS:
            first.setdefault(cause, number)
    assert sorted((*QUICK, *ONE, *OUTSIDE, *LEFT_OUT)) == sorted(first.values())
    assert {*first, *NOT_LIVE} == {*CAUSES}


@pytest.mark.timeout(TIMEOUT_S)
@pytest.mark.parametrize(
    "hidden", [*QUICK, *(pytest.param(number, marks=pytest.mark.long) for number in ONE if number not in FALLS_SHORT)]
)
def test_one_effect(hidden: int) -> None:
    with run_directory() as directory:
        check_found(run_hidden([hidden], directory))


@pytest.mark.long
@pytest.mark.timeout(TIMEOUT_S)
@pytest.mark.parametrize("hidden", FALLS_SHORT)
def test_one_effect_whose_form_is_another(hidden: int) -> None:
    with run_directory() as directory:
        outcome = run_hidden([hidden], directory)
    assert {step["effect"] for step in outcome.verdict["steps"]} >= set(outcome.secret["answers"])
    assert outcome.after_um < outcome.before_um / 3


@pytest.mark.long
@pytest.mark.timeout(TIMEOUT_S)
@pytest.mark.parametrize("hidden", [pytest.param(PAIRS[0], marks=pytest.mark.sample), *PAIRS[1:]])
def test_two_effects(hidden: list[int]) -> None:
    with run_directory() as directory:
        check_found(run_hidden(hidden, directory))


@pytest.mark.long
@pytest.mark.timeout(TIMEOUT_S)
@pytest.mark.parametrize("hidden", [pytest.param(SAMPLE_OUTSIDE, marks=pytest.mark.sample), 15, 1])
def test_cause_that_the_library_has_not(hidden: int) -> None:
    with run_directory() as directory:
        check_described(run_hidden([hidden], directory, OUTSIDE[hidden]))
