"""`compd gauge test-driver` finds every driver that is wrong, says what is wrong with it, and leaves others alone."""

from __future__ import annotations

import inspect
import re

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.conformance import CaseResult, DriverUnderTest, driver_under_test, run_conformance
from compd.gauge import Channel
from compd.gauge_tools import polled_drivers
from compd_drivers.modbus import Modbus
from compd_drivers.modbus_description import ModbusOptions
from tests.support.faulty_drivers import DRIVERS
from tests.support.sampled import sampled

RIGHT = ("Comparator", "Inch", "Code", "Exponent", "Addressed", "Checked", "Pair", "Registers", "Talker", "Pulsed")
RANGE = "range: all that the device can show"
EXCHANGED = "letters, units and signs exchanged"
ANOTHER = "another unit, or other settings"
NO_LIST = "errors that no list has"
DIGITS_AWAY = r"value: \S+ mm as ok, the sensor had \S+, \S+ of the device's digits \(0\.000\d+ mm\) away"
# Driver -> the case that must find it, and what its message must name.
FAULTY = {
    "GainOfNegatives": ("units and scale", DIGITS_AWAY),
    "Gain": ("units and scale", DIGITS_AWAY),
    "Inch25": ("units and scale", DIGITS_AWAY),
    "Offset": ("units and scale", DIGITS_AWAY),
    "TruncatedToMicrometres": ("units and scale", DIGITS_AWAY),
    "TruncatedToTensOfMicrometres": ("units and scale", DIGITS_AWAY),
    "TruncatedInItsLastDigit": ("units and scale", DIGITS_AWAY),
    "OffByADigitBelowZero": ("units and scale", DIGITS_AWAY),
    "WrongBeyondFive": (RANGE, "-5 mm as ok, the sensor had -10"),
    "SaturatedAtTen": (RANGE, "-10 mm as ok, the sensor had -20"),
    "WrongAtItsEnd": (RANGE, r"0 mm as ok, the sensor had 99\.9999"),
    "SignSwallowed": (RANGE, "0.0001 mm as ok, the sensor had -"),
    "SignSwallowedBelowOne": (RANGE, "0.0001 mm as ok, the sensor had -"),
    "CarryLost": (RANGE, "the sensor had -0.1"),
    "WrongEveryThousandth": ("thousands of polls", "poll [0-9]+: .* [45].*e[+]03 of the device's digits"),
    "Deadband": ("small steps, then standstill", "the sensor had"),
    "Smoothed": ("units and scale", DIGITS_AWAY),
    "FirstReplyForEver": ("units and scale", "0.2125 mm as ok, the sensor had"),
    "OneMemoryForAll": ("two of them at once", "the sensor had"),
    "AsksEverySecondTime": ("units and scale", "as ok, and nothing was asked"),
    "StampOfTheLastRequest": ("units and scale", "time stamp 3.000 ms before the request of this poll had left"),
    "StampBeforeTheRequest": ("units and scale", "time stamp 1.000 ms before the request of this poll had left"),
    "StampOfTheReply": ("units and scale", "time stamp 1.000 ms after the device had sampled"),
    "StampOfTheComputer": ("waits", "calls time.monotonic"),
    "Sleeps": ("waits", "calls time.sleep"),
    "SleepsAfterAFault": ("waits after faults", "no reply: `read` calls time.sleep"),
    "DrainsEveryTime": ("waits", "although its replies come at once: it waits 0.1 s"),
    "WaitsByTheComputersClock": ("waits", "calls time.monotonic"),
    "SleepsEveryHundredthPoll": ("thousands of polls", "`read` calls time.sleep"),
    "WaitsForAnEvent": ("waits", "calls threading's Condition.wait"),
    "AsksAgain": ("no request twice", "asks 2 times in one poll, 1 without a fault"),
    "SearchesANumber": ("one bit turned", r"is no reply of the device"),
    "SignOptional": ("bytes lost, or twice", r"byte 0 on: .*b'\d\d\.\d{4}mm\\r\\n' is no reply of the device"),
    "AnyWidth": ("bytes lost, or twice", r"b'.\d\d\.\d{3}mm\\r\\n' is no reply of the device"),
    "UnitNotLookedAt": (EXCHANGED, "'mm' is 'um'"),
    "LettersNotLookedAt": (EXCHANGED, "'m' at byte 8 is 'x'"),
    "UnknownErrorIsZero": (NO_LIST, "value is 0 mm, ok, out of b'"),
    "ErrorTextIsZero": (NO_LIST, r"value is 0 mm, ok, out of b'ERR"),
    "BlankFieldIsZero": (NO_LIST, r"value is 0 mm, ok, out of b'--------mm"),
    "HoldsTheLastValue": ("garbage before the reply", "as ok, the sensor had"),
    "NotFinite": ("a sensor is off", "inf as ok is no number"),
    "RaisesWhatItMeets": ("garbage before the reply", "raised ValueError"),
    "LastValueAfterThreeFaults": ("faults in a row, and in any order", "no reply, for the 4. time: .* the sensor had"),
    "FalseIdentity": (ANOTHER, r"`reply_identity` is b'\+', and a reply is b'-"),
    "CodeIsANumber": (RANGE, "99.9999 as ok, the sensor had -50: the device shows the same for all beyond -50,"),
    "ExponentWithoutSign": (RANGE, "the sensor had -10"),
    "AnyAddress": (ANOTHER, "b'01' at byte 1, as in the request, is b'02'"),
    "AnyAddressWritten": (ANOTHER, "b'01' at byte 1, as in the request, is b'02'"),
    "CheckedAnyAddress": (ANOTHER, "b'01' at byte 1, as in the request, is b'02'"),
    "CheckedAnyAddressWritten": (ANOTHER, "b'01' at byte 1, as in the request, is b'02'"),
    "ChecksumNotLookedAt": ("one bit turned", "is no reply of the device"),
    "ChecksumHalfLookedAt": ("a wrong checksum", "of the checksum, is b'1' in place of b'0'"),
    "CheckedUnitNotLookedAt": (EXCHANGED, "'m' at byte 11 is 'x'"),
    "CheckedErrorIsZero": (NO_LIST, "value is 0 mm, ok"),
    "Swapped": ("units and scale", "a: .* b: .*"),
    "SignSwallowedInTheSecond": (RANGE, "b: 0.0001 mm as ok, the sensor had -"),
    "ValueOfTheOther": ("a sensor is off", "b off: b: .* as ok, the sensor had nan"),
    "OneChannelShort": ("a sensor is off", "a off: 1 readings for 2 channels"),
    "LowWordAlone": (RANGE, "1.5536 mm as ok, the sensor had -5"),
    "WithoutSign": (RANGE, "429496.73 mm as ok, the sensor had -0.0001"),
    "ExceptionIsZero": ("error replies", "exception 5: value: 0 mm as ok"),
    "KeepsTheLastLine": ("no reply", "mm as ok, the sensor had"),
    "KeepsTheLastReading": ("no reply", "mm as ok, the sensor had"),
    "HalfALine": ("opened within a line", "mm as ok"),
    "OldestLine": ("polled seldom: the newest line", "3 lines later: .* nothing was sent in this poll"),
    "StampOfTheReceipt": ("units and scale", "after the device had sampled"),
    "StampBehindThePulse": ("units and scale", "time stamp 120.000 ms after the device had sampled"),
    "PulsesAgain": ("no request twice", "asks 2 times in one poll, 1 without a fault"),
    "OtherUnit": ("units and scale", "a poll without any fault gave timeout"),
}


def driver(name: str) -> DriverUnderTest:
    gauge = DRIVERS[name]
    options = gauge.Options(driver=name, line="test", **(gauge.sample_options or {}))
    return DriverUnderTest(name, gauge, gauge.device, options)


def result_of(name: str, case: str) -> CaseResult:
    """The case's result; the cases behind it are not tried."""
    return next(result for _, result in run_conformance(driver(name), on_real_wires=False) if result.case == case)


@pytest.mark.parametrize("name", sampled(RIGHT, 6))
def test_a_right_driver_fails_in_nothing(name: str) -> None:
    results = [result for _, result in run_conformance(driver(name), on_real_wires=False)]
    assert [result for result in results if result.verdict == "FAIL"] == []
    assert sum(result.verdict == "pass" for result in results) >= 20


@pytest.mark.parametrize("name", sampled(FAULTY, 8))
def test_a_faulty_driver_is_found_and_its_fault_is_named(name: str) -> None:
    case, message = FAULTY[name]
    result = result_of(name, case)
    assert result.verdict == "FAIL", result
    assert re.search(message, result.observed, re.DOTALL), result


def test_every_driver_of_the_file_is_tried() -> None:
    assert set(DRIVERS) == {*RIGHT, *FAULTY}


@pytest.mark.long
@pytest.mark.parametrize(("name", "code"), [("AnyAddress", 1), ("Addressed", 0)])
def test_from_the_command_line(name: str, code: int) -> None:
    gauge = f"{inspect.getfile(DRIVERS[name])}:{name}"
    device = f"{inspect.getfile(DRIVERS[name].device)}:{DRIVERS[name].device.__name__}"
    result = CliRunner().invoke(app, ["gauge", "test-driver", gauge, "--simulator", device, "--quick"])
    assert result.exit_code == code, result.output
    assert ("cases failed" in result.output) == bool(code)
    assert ("nothing failed" in result.output) == (not code)


@pytest.mark.long
def test_where_replies_do_not_say_whose_they_are_that_is_said() -> None:
    """Sylvac's replies have neither the unit of length nor an address."""
    driver = driver_under_test("sylvac_optors")
    result = next(r for _, r in run_conformance(driver, on_real_wires=False) if r.case == ANOTHER)
    assert result.verdict == "-"
    assert "not detectable on this wire: the reply of a device with unit=inch" in result.observed


@pytest.mark.parametrize("name", sampled(polled_drivers(), 3))
def test_each_shipped_driver_is_right_from_digit_to_end_of_scale_on_both_sides_of_zero(name: str) -> None:
    under_test = driver_under_test(name)
    channels: list[Channel] = list(under_test.gauge(under_test.options).channels)
    result = next(r for _, r in run_conformance(under_test, on_real_wires=False) if r.case == RANGE)
    for channel in channels:
        lowest, highest = map(float, re.search(rf"{channel.name} (\S+) to (\S+) ", result.observed).groups())  # type: ignore[union-attr]
        assert lowest < 0 < highest, result


class InvalidForgotten(Modbus):
    """The count that means no sensor is a number; the device shows it for all beyond its scale, too."""

    def __init__(self, options: ModbusOptions) -> None:
        super().__init__(options)
        self._map = tuple(channel.model_copy(update={"invalid": ()}) for channel in self._map)


@pytest.mark.long
def test_the_search_for_a_digit_ends_where_numbers_are_no_finer() -> None:
    shipped = driver_under_test("modbus")
    wrong = DriverUnderTest("x", InvalidForgotten, shipped.simulator, shipped.options)
    result = next(r for _, r in run_conformance(wrong, on_real_wires=False) if r.case == "a sensor is off")
    assert result.verdict == "FAIL"
    assert "c: 2147.48365 mm as ok, the sensor had nan" in result.observed


@pytest.mark.long
@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"unit": "mm", "cable": "simplex", "decimals": 3}, "no DTR"),
        ({"unit": "inch", "cable": "simplex", "decimals": 5}, "no DTR"),
    ],
)
def test_a_preset_that_is_asked_by_dtr_is_tried_in_virtual_time(options: dict[str, object], why: str) -> None:
    results = list(run_conformance(driver_under_test("sylvac_optors", options)))
    assert [result for _, result in results if result.verdict == "FAIL"] == []
    assert sum(result.verdict == "pass" for _, result in results) >= 18
    assert why in results[-1][1].observed


@pytest.mark.long
@pytest.mark.parametrize("form", sampled(["%+08.3f%0<sum8>", "%+08.3f", "%+08.3f mm"], 3))
def test_a_described_device_that_sends_unsolicited_is_tried_in_virtual_time(form: str) -> None:
    options = {"in": form, "in_terminator": r"\r\n", "channels": [{"name": "a", "unit": "mm"}]}
    results = list(run_conformance(driver_under_test("serial_ascii", options)))
    assert [result for _, result in results if result.verdict == "FAIL"] == []
    passed = {result.case for _, result in results if result.verdict == "pass"}
    assert {"no reply", "cut", "opened within a line", "polled seldom: the newest line"} <= passed
