"""Analogue modules: calibration curves, ends of the scale, broken wires; each preset against its simulated module."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from compd.gauge import Quality, Reading, RegisterReply
from compd.plugins import GAUGES, SIMULATED_GAUGES, load
from compd_drivers.linearisation import Linearisation
from compd_drivers.simulated.shared import signal_for

TABLE = {"signal": "V", "table": [[-10, -1.0], [0, 0.002], [10, 1.0]]}
LOOP = {"signal": "mA", "polynomial": [-1.5, 0.125], "valid": [4, 20]}


def curve(**options: Any) -> Linearisation:
    return Linearisation.model_validate(options)


# --- calibration curves --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("volts", "mm"), [(-10, -1.0), (-5, -0.499), (0, 0.002), (5, 0.501), (10, 1.0)])
def test_a_table_is_straight_between_its_points(volts: float, mm: float) -> None:
    assert curve(**TABLE).reading(volts, 1.0) == Reading(pytest.approx(mm, abs=1e-15), 1.0, Quality.OK)


def test_a_polynomial() -> None:
    assert curve(**LOOP).reading(12.0, 0.0).value == 0.0
    assert curve(signal="V", polynomial=[1.0, 0.0, 0.5], valid=[0.5, 2]).reading(2.0, 0.0).value == 3.0


@pytest.mark.parametrize(
    ("options", "signal", "quality"),
    [
        (TABLE, 10.001, Quality.OVER_RANGE),
        (TABLE, -10.001, Quality.UNDER_RANGE),
        (TABLE, math.nan, Quality.NOT_FINITE),
        (TABLE, math.inf, Quality.NOT_FINITE),
        (LOOP, 3.59, Quality.SENSOR_FAULT),
        (LOOP, 0.0, Quality.SENSOR_FAULT),
        (LOOP, 3.6, Quality.UNDER_RANGE),
        (LOOP, 20.01, Quality.OVER_RANGE),
        (LOOP, 21.01, Quality.SENSOR_FAULT),
        ({"signal": "mA", "table": [[0, 0], [20, 1]]}, -0.1, Quality.UNDER_RANGE),
    ],
)
def test_nothing_is_extrapolated(options: dict[str, Any], signal: float, quality: Quality) -> None:
    reading = curve(**options).reading(signal, 0.0)
    assert reading.quality is quality
    assert math.isnan(reading.value)


def test_zero_milliamperes_count_where_the_curve_begins_there() -> None:
    assert curve(signal="mA", table=[[0, 0], [20, 1]]).reading(0.0, 0.0).ok


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"signal": "V"}, "either"),
        ({**TABLE, "polynomial": [0, 1], "valid": [0, 1]}, "either"),
        ({"signal": "V", "polynomial": [0, 1]}, "valid"),
        ({**TABLE, "valid": [0, 1]}, "valid"),
        ({"signal": "V", "table": [[0, 0]]}, "at least 2"),
        ({"signal": "V", "table": [[0, 0], [0, 1]]}, "signals"),
        ({"signal": "V", "table": [[1, 0], [0, 1]]}, "signals"),
        ({"signal": "V", "table": [[0, 0], [1, 1], [2, 0.5]]}, "values"),
        ({"signal": "V", "polynomial": [0, 0, 1], "valid": [-1, 1]}, "rise or fall"),
        ({"signal": "V", "polynomial": [1, 0], "valid": [-1, 1]}, "rise or fall"),
        ({"signal": "V", "polynomial": [0, 1], "valid": [1, -1]}, "lowest"),
        ({"signal": "V", "table": [[0, 0], [1, math.nan]]}, "finite"),
        ({"signal": "bar", "table": [[0, 0], [1, 1]]}, "signal"),
    ],
)
def test_a_curve_that_cannot_be_right(options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        curve(**options)


@given(st.floats(-1, 1), st.booleans())
def test_the_transducer_is_the_curve_turned_round(value: float, falling: bool) -> None:
    table = [[-10, 1.0], [3, -0.2], [10, -1.0]] if falling else TABLE["table"]
    line = curve(signal="V", table=table)
    assert line.reading(signal_for(line, value), 0.0).value == pytest.approx(value, abs=1e-12)


# --- modules -------------------------------------------------------------------------------------------------


class Wire:
    """Registers straight from a simulated module."""

    def __init__(self, device: Any) -> None:
        self.device = device
        self.asked: list[tuple[int, int, int]] = []

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        assert unit == self.device.unit
        self.asked.append((function, address, count))
        registers = self.device.registers(function, address, count)
        assert registers is not None, f"the module has no function {function}, address {address}, count {count}"
        return RegisterReply(tuple(registers), 1.0)


def module(driver: str, values: dict[str, float], **options: Any) -> tuple[Any, Wire]:
    gauge = load(GAUGES, driver, driver)
    checked = gauge.Options.model_validate({"driver": driver, "line": "l", "unit": 1, **options})
    return gauge(checked), Wire(load(SIMULATED_GAUGES, driver, driver)(checked, lambda name: values[name]))


V10 = {"name": "a", "input": 1, "linearisation": {"signal": "V", "table": [[-9.5, -1], [9.5, 1]]}}
MA = {"name": "b", "input": 2, "linearisation": LOOP}
MODULES: dict[str, dict[str, Any]] = {
    "icpdas_m7017c": {
        "data_format": "hexadecimal",
        "channels": [{**V10, "range": "+-10V"}, {**MA, "range": "4-20mA"}],
    },
    "adam_4017p": {"channels": [{**V10, "range": "+-10V"}, {**MA, "range": "4-20mA"}]},
    "moxa_e1240": {"channels": [{**V10, "linearisation": {"signal": "V", "table": [[0.5, -1], [9.5, 1]]}}, MA]},
}
# One count of 16 bits over 20 V or 16 mA, in mm; a float32 carries 24 bits
STEP_MM = {"icpdas_m7017c": 5e-5, "adam_4017p": 5e-5, "moxa_e1240": 1e-6}


@pytest.mark.parametrize("driver", MODULES)
@given(values=st.tuples(st.floats(-0.99, 0.99), st.floats(-0.49, 0.99)))
def test_what_the_sensors_measure_arrives(driver: str, values: tuple[float, float]) -> None:
    gauge, wire = module(driver, {"a": values[0], "b": values[1]}, **MODULES[driver])
    assert [reading.value for reading in gauge.read(wire)] == [pytest.approx(v, abs=STEP_MM[driver]) for v in values]


@pytest.mark.parametrize("driver", MODULES)
@pytest.mark.parametrize("value", [math.nan, 5.0, -5.0])
def test_beyond_the_sensor_there_is_no_value(driver: str, value: float) -> None:
    gauge, wire = module(driver, {"a": value, "b": value}, **MODULES[driver])
    for reading in gauge.read(wire):
        assert reading.quality in {Quality.OVER_RANGE, Quality.UNDER_RANGE, Quality.SENSOR_FAULT}, reading
        assert math.isnan(reading.value)


def test_adjacent_inputs_are_read_at_once() -> None:
    gauge, wire = module("icpdas_m7017c", {"a": 0.0, "b": 0.0}, **MODULES["icpdas_m7017c"])
    gauge.read(wire)
    assert wire.asked == [(4, 1, 2)]
    gauge, wire = module("moxa_e1240", {"a": 0.0, "b": 0.0}, **MODULES["moxa_e1240"])
    gauge.read(wire)
    assert wire.asked == [(4, 10, 4), (4, 61, 2)], "the values first, then their status"


@pytest.mark.parametrize(
    ("value", "quality"),
    [
        (20.0, Quality.OK),
        (-54.9, Quality.OK),
        (85.0, Quality.SENSOR_FAULT),
        (84.9, Quality.OK),
        (math.nan, Quality.SENSOR_FAULT),
        (126.0, Quality.OVER_RANGE),
        (-56.0, Quality.UNDER_RANGE),
    ],
)
def test_thermometers(value: float, quality: Quality) -> None:
    gauge, wire = module("r4dcb08", {"1": value, "8": 20.0}, sensors=[8, 1])
    first, last = gauge.read(wire)
    assert [channel.name for channel in gauge.channels] == ["1", "8"]
    assert (first.quality, last.value) == (quality, pytest.approx(20.0))
    if quality is Quality.OK:
        assert first.value == pytest.approx(value, abs=0.05)


@pytest.mark.parametrize(
    ("driver", "options", "why"),
    [
        ("icpdas_m7017c", {"channels": [{**V10, "range": "+-10V"}]}, "data_format"),
        ("icpdas_m7017c", {"data_format": "engineering", "channels": [{**V10, "range": "+-10V"}]}, "hexadecimal"),
        ("icpdas_m7017c", {"data_format": "hexadecimal", "channels": [{**V10, "range": "4-20mA"}]}, "delivers mA"),
        ("adam_4017p", {"channels": [{**V10, "range": "+-10V"}, {**V10, "name": "c", "range": "+-5V"}]}, "input 1"),
        ("adam_4017p", {"channels": [{**V10, "input": 8, "range": "+-10V"}]}, "less than 8"),
        ("moxa_e1240", {"channels": [{"name": "a", "input": 0}]}, "linearisation"),
        ("r4dcb08", {"sensors": [9]}, "8"),
    ],
)
def test_options_that_cannot_be_right(driver: str, options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        module(driver, {}, **options)


def test_a_channel_of_the_generic_driver_is_linearised_too() -> None:
    channel = {
        "name": "a",
        "function": 4,
        "address": 0,
        "type": "int16",
        "scale": 10 / 32768,
        "unit": "mm",
        "over_range": [32767],
        "under_range": [-32768],
        "linearisation": TABLE,
        "highest": 0.9,
    }
    gauge = load(GAUGES, "modbus", "modbus")
    device = gauge(gauge.Options.model_validate({"driver": "modbus", "line": "l", "unit": 1, "channels": [channel]}))

    class Fixed:
        def __init__(self, raw: int) -> None:
            self.raw = raw & 0xFFFF

        def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
            return RegisterReply((self.raw,), 1.0)

    assert device.read(Fixed(16384))[0].value == pytest.approx(0.501)
    assert device.read(Fixed(32767))[0].quality is Quality.OVER_RANGE
    assert device.read(Fixed(-32768))[0].quality is Quality.UNDER_RANGE
    assert device.read(Fixed(32000))[0].quality is Quality.OVER_RANGE, "0.977 mm, above its highest"
