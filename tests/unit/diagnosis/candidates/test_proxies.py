"""Effects without their thermometer, tried with those that there are: never named, and told to be likely."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
import pytest

from compd.comparison import AlignedRecording, open_recording
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.proxies import proxy_candidates
from compd.diagnosis.recording_diagnosis import diagnose
from compd.units import UM_PER_MM
from tests.support.external_recordings import along, record_external
from tests.support.hidden_effects import LIBRARY, record_with_effects

ROWS = 240
SPINDLE = along("z", "spindle", "k * (temperature_spindle_degC - 20) / 10")
LAGGED = along(
    "z",
    "lagged",
    "k * lag(temperature_spindle_degC - 20, tau) / 10",
    parameters={
        "k": {"unit": "um", "plausible": [-100, 100], "source": "a test"},
        "tau": {"unit": "s", "plausible": [100, 1000], "source": "a test"},
    },
)
PRESSURE = along("z", "pressed", "k * pressure_hPa")
LINKS = [f"temperature_link_{i}_degC" for i in (1, 2, 3)]


def machining(path: Path, error_um: float, **more: np.ndarray) -> AlignedRecording:
    """A machine that warms up: the motor's temperature was measured, the spindle's not."""
    rng = np.random.default_rng(1)
    motor = 20 + np.repeat(rng.uniform(0, 20, 12), ROWS // 12)
    columns = {"temperature_motor_degC": motor, "temperature_room_degC": np.full(ROWS, 20.0), **more}
    return record_external(path, columns, {"z": error_um * (motor - 20) / 10})


def without(path: Path, names: Collection[str]) -> AlignedRecording:
    """The recording without some columns."""
    lines = [line.split(",") for line in path.read_text().splitlines()]
    keep = [k for k, name in enumerate(lines[0]) if name not in names]
    path.write_text("\n".join(",".join(line[k] for k in keep) for line in lines) + "\n")
    return open_recording(path)


def test_every_thermometer_that_moved_stands_in_for_the_missing_one(tmp_path: Path) -> None:
    aligned = machining(tmp_path / "run.csv", 5.0, temperature_bed_degC=np.linspace(20, 30, ROWS))
    found = proxy_candidates(aligned, [SPINDLE, PRESSURE], ())
    assert [(each.name, each.quantity, each.missing) for each in found] == [
        ("spindle by proxy", name, ("temperature_spindle_degC",))
        for name in ("temperature_motor_degC", "temperature_bed_degC")
    ]
    motor = aligned.rows.quantities["temperature_motor_degC"]
    assert found[0].columns_um[:, 0, 0] == pytest.approx((motor - 20) / 10)
    assert {each.kind for each in found} == {"proxy"}


def test_a_thermometer_is_told_by_its_unit(tmp_path: Path) -> None:
    warm = np.linspace(20, 30, ROWS)
    own = {"motor_2_degC": warm, "motor_3_K": warm + 273.15, "rise_K": warm - 20, "humidity_pct": warm}
    found = {
        each.quantity: each for each in proxy_candidates(machining(tmp_path / "run.csv", 5.0, **own), [SPINDLE], ())
    }
    assert set(found) == {"temperature_motor_degC", "motor_2_degC", "motor_3_K"}
    np.testing.assert_allclose(found["motor_3_K"].columns_um, found["motor_2_degC"].columns_um, atol=1e-5)


def test_the_choice_of_a_thermometer_is_a_search_and_has_its_price(tmp_path: Path) -> None:
    aligned = machining(tmp_path / "run.csv", 5.0)
    (plain,) = proxy_candidates(aligned, [SPINDLE], ())
    assert plain.parameter_count == 1 + CandidateCriteria.searched_constant
    lagged = proxy_candidates(aligned, [LAGGED], ())
    assert len(lagged) == len({each.constants["tau"] for each in lagged}) > 1
    assert {each.parameter_count for each in lagged} == {1 + 2 * CandidateCriteria.searched_constant}


def test_an_effect_with_its_thermometer_or_of_the_model_or_that_lacks_more_has_no_proxy(tmp_path: Path) -> None:
    aligned = machining(tmp_path / "run.csv", 5.0)
    motor = along("z", "motor", "k * (temperature_motor_degC - 20)")
    more = along("z", "more", "k * temperature_spindle_degC * pressure_hPa")
    assert proxy_candidates(aligned, [motor, more, PRESSURE], ()) == ()
    assert proxy_candidates(aligned, [SPINDLE], {"spindle"}) == ()


def test_all_missing_thermometers_of_an_effect_are_replaced_by_one(tmp_path: Path) -> None:
    record_with_effects(tmp_path / "run.csv", 1, {}, visits=40)
    aligned = without(tmp_path / "run.csv", LINKS)
    found = proxy_candidates(aligned, [LIBRARY["link_expansion"]], ())
    frame = next(each for each in found if each.quantity == "temperature_frame_degC")
    assert frame.missing == tuple(LINKS)
    jacobian_um = aligned.sensitivity(["link"])["link"].tip.sum(axis=2) * UM_PER_MM
    assert frame.columns_um.shape == (*jacobian_um.shape, 1)


def test_an_effect_without_its_thermometer_is_likely_and_not_named(tmp_path: Path) -> None:
    diagnosis = diagnose(machining(tmp_path / "run.csv", 5.0), (), None, [SPINDLE, PRESSURE])
    assert diagnosis.steps == ()
    assert diagnosis.verdict == "unexplained"
    first, second = diagnosis.untested
    assert (first.effect, first.likely) == ("spindle", True)
    assert (second.effect, second.likely) == ("pressed", False)
    proxies = [finding for finding in diagnosis.depends_on if finding.form == "proxy"]
    assert [(proxy.effect, proxy.covariate) for proxy in proxies] == [("spindle", "temperature_motor_degC")]
    assert proxies[0].parameters[0]["k"] == pytest.approx(5.0, abs=0.2)
    assert "temperature_spindle_degC" in str(diagnosis.next_measurement[0]["measure"])


def test_nothing_is_likely_where_no_thermometer_explains_anything(tmp_path: Path) -> None:
    diagnosis = diagnose(machining(tmp_path / "run.csv", 0.0), (), None, [SPINDLE])
    assert diagnosis.verdict == "adequate"
    assert not any(effect.likely for effect in diagnosis.untested)


def test_an_effect_that_can_be_tested_is_preferred_to_one_that_cannot(tmp_path: Path) -> None:
    """Both would do it: the motor's own expansion is named, the spindle's is its rival."""
    motor = along("z", "motor", "k * (temperature_motor_degC - 20) / 10")
    diagnosis = diagnose(machining(tmp_path / "run.csv", 5.0), (), None, [SPINDLE, motor])
    (step,) = diagnosis.steps
    assert step.effect.id == "motor"
    assert [rival.name for rival in step.rivals] == ["spindle"]
    assert diagnosis.verdict == "ambiguous"
    assert [effect.effect for effect in diagnosis.untested if effect.likely] == ["spindle"]
