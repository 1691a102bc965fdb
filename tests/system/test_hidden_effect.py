"""The machine has an effect that the daemon's model lacks: it is found, adopted, and the live error falls.

Everything goes through the commands that a person would use, on wires. What is hidden is in a sealed file that is
opened here at the end, to score. For each cause the number is the first that hides it plainly, not one that suits.

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

from compd.simulation import Mechanism, draw_hidden
from compd.simulation.causes.catalogue import CAUSES, possible_causes
from tests.scoreboard.expectation import covariates
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
# Run with all the tests; the others by `make hidden`.
QUICK = ("link_expansion",)
PAIRS = (
    ("link_expansion", "scale_gain"),
    ("link_elasticity", "scale_gain"),
    ("joint_comparator_gain", "tool_bending"),
)
OUTSIDE = {"cable_drag": HOURS, "air_pressure": DAYS, "humidity_swelling": DAYS}
# Of the long tests, `make hidden-sample` runs the first cause outside the library.
SAMPLE = next(iter(OUTSIDE))
LEFT_OUT = {
    "gauge_latency": "it shows on the move alone, and here all is measured at rest",
    "link_expansion_lag": "minutes are seconds where weather is faster: below what the library takes for plausible",
}
# Named rightly, but what is left is above the noise floor.
FALLS_SHORT = {
    "friction_hysteresis": "of 3.9 floors, of another form than the library's: 0.20 of 0.81 um are left, floor 0.16",
}
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
# Numbers below this are looked through; a cause is plain from so many times the noise.
NUMBERS = 300
PLAIN_FLOORS = 2.5
VISITS, CHECKS = 40, 10
# A hidden effect is plain when the squared error is so many times what noise alone would give.
PLAIN_RATIO = 2.0


def first_numbers() -> dict[str, int]:
    """For each cause the first number for `--hidden` that hides it plainly."""
    machine = Mechanism(tripod())
    first: dict[str, int] = {}
    for number in range(NUMBERS):
        hidden = draw_hidden(number, machine)
        if hidden.floors >= PLAIN_FLOORS:
            first.setdefault(hidden.id, number)
    return first


FIRST = first_numbers()
ONE = tuple(name for name in FIRST if name not in (*QUICK, *OUTSIDE, *LEFT_OUT, *FALLS_SHORT, *NOT_LIVE))


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
        run.compd("model", "add", effect, "--recording", recording, "--machine", run.configuration, "--model", model)


def zero_temperature_degC(hidden: list[int]) -> float:
    """Of machine and room when machine zero is taken: of a cold hall, a laboratory, two shops in summer."""
    return (15.0, 20.0, 23.0, 27.0)[sum(hidden) % 4]


def run_hidden(hidden: list[int], directory: Path, pace: Pace = HOURS) -> Outcome:
    """Survey, diagnose, adopt: from a machine with hidden causes to the daemon that compensates them."""
    options = [word for number in hidden for word in ("--hidden", str(number))]
    options += ["--zero-temperature", str(zero_temperature_degC(hidden))]
    with hidden_run(directory, "--seed", "1", "--speedup", pace.speedup, *options) as run:
        recording, before_um = run.survey(survey_visits(2, VISITS, heaters=pace.heaters), "survey")
        machine = ("--machine", str(run.configuration))
        compared = parse_output(run.compd("compare", recording, "--json", *machine))
        verdict = parse_output(run.compd("diagnose", recording, "--json", *machine))
        model = run.directory / "model.yaml"
        add_named_effects(run, verdict, recording, model)
        if model.exists():
            run.compd("model", "adopt", model, "--daemon", run.socket)
        after_um = run.tip_error_um(check_visits(3, CHECKS, heaters=pace.heaters))
    secret = json.loads((run.directory / "hidden.answer.json").read_text(encoding="utf-8"))
    return Outcome(compared, verdict, before_um, after_um, secret)


def check_found(outcome: Outcome) -> None:
    """Seen, named, and taken away: what is left is less than the noise of the measurement itself."""
    verdict, floor_um = outcome.verdict, outcome.compared["noise_floor_um"]
    assert outcome.compared["floor_ratio"] > PLAIN_RATIO
    named = {name for step in verdict["steps"] for name in (step["effect"], *step["rivals"])}
    assert named >= set(outcome.secret["answers"]), (outcome.secret, verdict["steps"])
    assert verdict["verdict"] in ("identified", "likely", "ambiguous")
    assert outcome.after_um < floor_um < outcome.before_um


def check_described(outcome: Outcome) -> None:
    """No effect is named for what the library has not; what it follows is, and its description takes it away."""
    verdict, floor_um = outcome.verdict, outcome.compared["noise_floor_um"]
    assert outcome.compared["floor_ratio"] > PLAIN_RATIO
    assert (verdict["verdict"], verdict["steps"]) == ("unexplained", [])
    proposed = {trend["covariate"] for trend in verdict["depends_on"][:2]}
    assert proposed & set(covariates(outcome.secret["follows"])), (outcome.secret, proposed)
    assert outcome.after_um < floor_um < outcome.before_um


def long(case: Any) -> Any:
    """A case of `make nightly`; some of them are run by .ci/run too."""
    return pytest.param(case, marks=[pytest.mark.long, *([pytest.mark.sample] if case == SAMPLE else [])])


def test_every_cause_is_run_or_left_out_for_a_reason() -> None:
    # rails and cranks, which a tripod lacks: `test_hidden_effect_of_kinds`
    on_a_tripod = set(possible_causes(Mechanism(tripod())))
    assert set(CAUSES) - on_a_tripod == {"rail_direction", "crank_radius"}
    assert set(FIRST) == on_a_tripod, "more numbers have to be looked through"
    assert {*QUICK, *OUTSIDE, *LEFT_OUT, *FALLS_SHORT, *NOT_LIVE} <= set(CAUSES)
    assert not [name for name in ONE if not CAUSES[name].in_library], "what the library has not stands in OUTSIDE"


@pytest.mark.parametrize("cause", [*QUICK, *map(long, ONE)])
def test_one_effect(cause: str) -> None:
    with run_directory() as directory:
        check_found(run_hidden([FIRST[cause]], directory))


@pytest.mark.parametrize("cause", [*map(long, FALLS_SHORT)])
def test_one_effect_whose_form_is_another(cause: str) -> None:
    with run_directory() as directory:
        outcome = run_hidden([FIRST[cause]], directory)
    assert {step["effect"] for step in outcome.verdict["steps"]} >= set(outcome.secret["answers"])
    assert outcome.after_um < outcome.before_um / 3


@pytest.mark.parametrize("causes", [*map(long, PAIRS)], ids="+".join)
def test_two_effects(causes: tuple[str, str]) -> None:
    with run_directory() as directory:
        check_found(run_hidden([FIRST[cause] for cause in causes], directory))


@pytest.mark.parametrize("cause", [*map(long, OUTSIDE)])
def test_cause_that_the_library_has_not(cause: str) -> None:
    with run_directory() as directory:
        check_described(run_hidden([FIRST[cause]], directory, OUTSIDE[cause]))
