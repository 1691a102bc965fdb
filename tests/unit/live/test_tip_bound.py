"""The bound of the tip's error against the simulated machine's truth: at rest, on the move, and when readings stop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.setpoint_states import State
from tests.support.live_machine import machine
from tests.support.moving_machine import DEPARTS_S, DIGIT_MM, NOISE_MM, Fault, configured, told, track

BOTH = pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
# A departure from rest shows with the next reading of a scale: until then nobody knows of it.
UNSEEN_S = 0.05
KNOWN_S = 0.9  # from here on every gauge has been read often enough
ARRIVED_S = 2.3
# After an arrival the bound allows for another departure for so long.
RESTS_S = 1.5
FAULTS = {
    "stalls for 0.2 s": Fault(stalled=(1.7, 1.9)),
    "stalls for 0.4 s": Fault(stalled=(1.6, 2.0)),
    "stalls for 0.45 s as it brakes": Fault(stalled=(1.85, 2.3)),
    "stalls from rest into the motion": Fault(stalled=(1.4, 1.75)),
    "loses one reply of a scale": Fault(lost=("scale_1", 1.65)),
    "loses one reply of a scale at rest": Fault(lost=("scale_1", 1.3)),
    "loses one reply of the joints": Fault(lost=("joint_1", 1.65)),
    "is killed": Fault(stalled=(1.7, 2.1), killed=True),
}


def judged(setpoints):
    """Those with values and a bound, beyond the departure that no reading has shown."""
    known = [each for each in setpoints if each.valid and each.time_s > KNOWN_S and np.isfinite(each.bound_um)]
    return [each for each in known if not DEPARTS_S < each.time_s < DEPARTS_S + UNSEEN_S]


def share_above(setpoints, factor=1.0):
    return float(np.mean([each.error_um > factor * each.bound_um for each in setpoints]))


@BOTH
@pytest.mark.parametrize("what", FAULTS)
def test_no_valid_setpoint_is_further_off_than_its_bound_where_acquisition(name, what):
    setpoints = told(configured(name, None), FAULTS[what])
    bounded = judged(setpoints)
    assert max(each.error_um for each in setpoints if each.valid) > 400.0, "the fault, or the departure, is there"
    assert share_above(bounded) <= 0.05
    assert share_above(bounded, 2.0) == 0.0


@BOTH
@pytest.mark.parametrize("what", FAULTS)
def test_the_shipped_limit_leaves_no_large_error_valid_where_acquisition(name, what):
    setpoints = told(configured(name), FAULTS[what])
    limit_um = configured(name).limits.tip_error_um
    assert max(each.error_um for each in setpoints if each.valid) < 2000.0
    assert all(each.bound_um <= limit_um for each in setpoints if each.valid)


@BOTH
def test_a_machine_without_a_fault_stays_valid_on_the_move(name):
    assert track(name).speed_mm_per_s() > 90.0
    setpoints = [each for each in told(configured(name)) if each.time_s > KNOWN_S]
    assert all(each.valid for each in setpoints)
    assert share_above(judged(setpoints), 1.0) == 0.0
    arrived = [each for each in setpoints if each.time_s > ARRIVED_S]
    assert max(each.bound_um for each in arrived[:5]) > 100.0, "it may leave again before anybody sees it"
    still = [e.bound_um for e in setpoints if e.time_s > ARRIVED_S + RESTS_S]
    assert max(still) < 5.0


@BOTH
def test_what_dominates_is_named_with_its_age(name):
    setpoints = told(configured(name), FAULTS["loses one reply of a scale"])
    reasons = [each.reason for each in setpoints if each.state is State.REFUSED and 1.6 < each.time_s < 1.95]
    assert reasons
    assert all("allowed 3.00 mm (`limits.tip_error_um`)" in reason for reason in reasons)
    assert all("most by scale 1 (scale_1.position), 0." in reason for reason in reasons[:5])
    assert "valid with newer readings" in reasons[0]
    setpoints = told(configured(name), FAULTS["is killed"])
    after = [each.reason for each in setpoints if each.state is State.REFUSED and each.time_s > 2.1]
    assert any("has been read only once" in reason for reason in after)


@BOTH
def test_at_rest_the_bound_is_that_of_the_scatter(name):
    """1.0 to 2.0 times the 95 % quantile of the error, over places and machine zeros, with the gauges' last digits."""
    live, rng = machine(name), np.random.default_rng(7)
    links, joints = live.model.links, live.wires.joints
    kinds = ["scale"] * links + ["joint"] * joints + ["frame"] * 9
    digit_mm, noise_mm = np.array([DIGIT_MM[k] for k in kinds]), np.array([NOISE_MM[k] for k in kinds])
    size_mm = np.array([{"scale": 5.0, "joint": 0.02, "frame": 0.02}[kind] for kind in kinds])

    def shown(lengths_mm):
        return np.round((lengths_mm + noise_mm * rng.normal(size=len(kinds))) / digit_mm) * digit_mm

    def tip_mm(lengths_mm):
        values = GaugeValues(*np.split(lengths_mm, [links, links + joints]), {})
        return compensate_cmm(live.model, values, WarmStart.at_zero(live.model))[0].tip_M_mm

    errors_um = []
    for _ in range(400):
        zero_mm, now_mm = rng.uniform(-1, 1, len(kinds)) * digit_mm, rng.uniform(-1, 1, len(kinds)) * size_mm
        mean_zero_mm = np.mean([shown(zero_mm) for _ in range(30)], axis=0)
        errors_um.append(1e3 * np.linalg.norm(tip_mm(shown(now_mm) - mean_zero_mm) - tip_mm(now_mm - zero_mm)))
    ratio = live.settle().u_tip_um / np.quantile(errors_um, 0.95)
    assert 1.0 <= ratio <= 2.0


@BOTH
def test_without_a_limit_of_its_own_a_silent_scale_leaves_the_bound_unknown_and_the_key_is_named(name):
    configuration = configured(name)
    gauges = {n: o.model_copy(update={"acceleration_mm_per_s2": None}) for n, o in configuration.gauges.items()}
    setpoints = told(replace(configuration, gauges=gauges), FAULTS["stalls for 0.2 s"])
    silent = [each for each in setpoints if 1.8 < each.time_s < 1.9]
    assert not any(each.valid for each in silent)
    assert "nothing limits how far" in silent[-1].reason
