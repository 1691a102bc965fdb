"""What a line can carry: the table of measured practice, and the warnings."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from compd.cli.start.check import print_lines
from compd.commissioning.line_budget import (
    LineBudget,
    budget_of_line,
    line_budgets,
)
from compd.commissioning.line_warnings import budget_warnings, line_warnings
from compd.configuration import load
from compd.line_settings.pace import character_bits
from compd.lines.kinds.modbus_ascii.settings import ModbusAsciiLine
from compd.lines.kinds.modbus_rtu.settings import ModbusRtuLine
from compd.lines.kinds.modbus_tcp.settings import ModbusTcpLine
from compd.lines.kinds.serial.settings import SerialLine
from tests.support.paths import CONFIG


def rtu(baud: int, **more: Any) -> ModbusRtuLine:
    return ModbusRtuLine(kind="modbus_rtu", port="/dev/x", baud=baud, format="8N1", **{"timeout_s": 0.1, **more})  # type: ignore[arg-type]


# nine values as: one block of int16, one block of float32, nine units with one register each
INT16, FLOAT32, UNITS = [(8, 23)], [(8, 41)], [(8, 7)] * 9


def test_modbus_ascii_takes_two_characters_for_a_byte() -> None:
    line = ModbusAsciiLine(kind="modbus_ascii", port="/dev/x", baud=9600, format="7E1", timeout_s=0.1)
    assert budget_of_line("l", line, {"a": INT16}).bytes == len(":0104000000093A\r\n") + len(":") + 2 * 22 + len("\r\n")


def test_a_pause_between_requests_counts() -> None:
    plain, paused = (budget_of_line("l", rtu(19200, **more), {"a": UNITS}) for more in ({}, {"pause_s": 0.02}))
    assert paused.ideal_s - plain.ideal_s == pytest.approx(9 * (0.02 - 3.5 * 10 / 19200))
    tcp = ModbusTcpLine(kind="modbus_tcp", host="x", timeout_s=0.1, pause_s=0.05)
    assert budget_of_line("l", tcp, {"a": INT16}).ideal_s > 0.05


@pytest.mark.parametrize(
    ("traffic", "count", "baud", "ideal_hz", "usual_hz"),
    [
        (INT16, 31, 19200, "51", "36"),
        (INT16, 31, 115200, "162", "69"),
        (FLOAT32, 49, 19200, "34", "27"),
        (FLOAT32, 49, 115200, "129", "62"),
        (UNITS, 135, 19200, "10", "5.7"),
        (UNITS, 135, 115200, "23", "8.5"),
    ],
)
def test_nine_comparators(traffic: list[tuple[int, int]], count: int, baud: int, ideal_hz: str, usual_hz: str) -> None:
    budget = budget_of_line("x", rtu(baud), {"gauge": traffic})
    assert budget.bytes == count
    assert f"{budget.ideal_hz:.0f}" == ideal_hz
    assert f"{budget.usual_hz:.{1 if '.' in usual_hz else 0}f}" == usual_hz


def test_bits_of_a_character() -> None:
    assert [character_bits(form) for form in ("8N1", "7E2", "8E1", "7N1", "8O2")] == [10, 11, 11, 9, 12]


def test_parity_and_stop_bits_cost_time() -> None:
    traffic = {"gauge": [(1, 17)]}
    forms = ("8N1", "7E2")
    lines = [SerialLine(kind="serial", port="/dev/x", baud=9600, format=form, timeout_s=0.1) for form in forms]
    fast, slow = (budget_of_line("x", line, traffic).ideal_s for line in lines)
    # 18 characters and twice 3.5 of silence, one bit more each
    assert slow - fast == pytest.approx(25 / 9600)


def test_tcp_counts_exchanges_not_bits() -> None:
    line = ModbusTcpLine(kind="modbus_tcp", host="h", timeout_s=0.3)
    short, long = budget_of_line("x", line, {"a": [(8, 7)]}), budget_of_line("x", line, {"a": [(8, 255)]})
    assert short.ideal_s == long.ideal_s > 0
    assert budget_of_line("x", line, {"a": UNITS}).ideal_s == pytest.approx(9 * short.ideal_s)


def test_slower_by_wish() -> None:
    assert budget_of_line("x", rtu(115200, poll_every_s=0.1), {"a": INT16}).ideal_hz == pytest.approx(10)


def test_no_slave_answers_before_the_silence_that_it_must_keep() -> None:
    slow = budget_of_line("x", rtu(1200), {"a": INT16})
    assert slow.usual_s == slow.ideal_s
    assert (
        budget_of_line("x", rtu(115200), {"a": INT16}).usual_s > budget_of_line("x", rtu(115200), {"a": INT16}).ideal_s
    )


def test_what_an_adapter_costs_that_holds_replies_back() -> None:
    nine = {f"g{i}": [(8, 7)] for i in range(9)}
    text = warning_text(budget_of_line("x", rtu(115200, low_latency=False), nine), 1.0)
    usual_ms = budget_of_line("x", rtu(115200), nine).usual_s * 1e3
    assert f"a round of {usual_ms:.1f} ms takes up to {usual_ms + 9 * 16:.1f}" in text
    assert warning_text(budget_of_line("x", rtu(115200), nine), 1.0) == ""
    by_network = rtu(115200, low_latency=False).model_copy(update={"port": "socket://server:4001"})
    assert warning_text(budget_of_line("x", by_network, nine), 1.0) == ""


def test_unknown_traffic_has_no_rate_and_says_so() -> None:
    budget = budget_of_line("x", rtu(9600), {"a": INT16, "mystery": None})
    assert not budget.known
    assert math.isnan(budget.ideal_hz)
    (warning,) = line_warnings(budget, 1.0, "lines.x")
    assert "mystery" in str(warning)


def test_a_line_whose_replies_do_not_say_whose_they_are_is_listened_to_after_each_round() -> None:
    nine = {f"g{i}": [(3, 10)] for i in range(9)}
    known, unknown = (budget_of_line("x", rtu(9600), nine, tells_whose=tells) for tells in (True, False))
    exchange_s = known.usual_s / 9
    assert unknown.usual_s == pytest.approx(known.usual_s + 1.25 * exchange_s + 2e-3)


def warning_text(budget: LineBudget, stale_after_s: float) -> str:
    return "\n".join(str(problem) for problem in line_warnings(budget, stale_after_s, "lines.x"))


@pytest.mark.parametrize("poll_every_s", [20.0, 0.5, 0.49])
def test_a_line_that_is_polled_too_seldom_is_stale_time_and_again(poll_every_s: float) -> None:
    seldom = budget_of_line("x", rtu(115200, poll_every_s=poll_every_s), {"a": INT16})
    assert "stale before the next ones come" in warning_text(seldom, 0.5)
    often = budget_of_line("x", rtu(115200, poll_every_s=0.4), {"a": INT16})
    assert warning_text(often, 0.5) == ""


def test_warnings_where_they_belong() -> None:
    nine = {f"g{i}": [(8, 7)] for i in range(9)}
    slow = budget_of_line("x", rtu(19200), nine)
    assert "go stale between two polls" in warning_text(slow, 0.2)
    mute = budget_of_line("x", rtu(19200, timeout_s=0.3), nine)
    assert "between two polls" not in warning_text(mute, 0.4)
    assert "one absent device of 9 delays the others by 28" in warning_text(mute, 0.4)
    assert warning_text(slow, 1.0) == ""
    alone = budget_of_line("x", rtu(19200, timeout_s=5.0), {"g": INT16})
    assert warning_text(alone, 1.0) == ""
    hurried = budget_of_line("x", rtu(19200, poll_every_s=0.01), {"g": INT16})
    assert "the wanted rate cannot be reached" in warning_text(hurried, 1.0)


def test_a_dead_unit_behind_a_gateway_costs_its_wait() -> None:
    six = {f"g{i}": [(8, 7)] for i in range(6)}

    def warned(**keys: Any) -> str:
        line = ModbusTcpLine(kind="modbus_tcp", host="h", timeout_s=0.1, **keys)
        return warning_text(budget_of_line("x", line, six), 0.5)

    assert warned() == ""
    assert "one absent device of 6 delays the others by 990 ms" in warned(gateway_wait_s=1.0)
    assert "`gateway_wait_s`" in warned(gateway_wait_s=1.0)
    assert warned(gateway_wait_s=0.1) == ""


@pytest.mark.parametrize("name", ["tripod-cmm", "hexapod"])
def test_shipped_machines(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    configuration = load(CONFIG / f"{name}.yaml")
    assert print_lines(configuration) == []
    printed = capsys.readouterr().out
    assert all(budget.known and budget.usual_hz > 1 for budget in line_budgets(configuration))
    assert all(line in printed for line in configuration.lines)


def test_a_line_that_is_too_slow_is_named_with_its_place(tmp_path: Path) -> None:
    text = (CONFIG / "tripod-cmm.yaml").read_text()
    head, tail = text.split("usb-joints\n", 1)
    path = tmp_path / "slow.yaml"
    path.write_text(head + "usb-joints\n" + tail.replace("baud: 38400", "baud: 1200", 1))
    configuration = load(path)
    (warning,) = budget_warnings(configuration, line_budgets(configuration))
    assert re.search(r":\d+ lines.joints: ", str(warning))
    assert "stale" in str(warning)


# --- how far apart the readings of a round are -------------------------------------------------------------

BROADCAST = {"function": 5, "address": 0, "values": [1], "settle_s": 0.1}


@pytest.mark.parametrize(("baud", "spread_ms"), [(9600, 234), (19200, 157), (115200, 104)])
def test_nine_units_are_apart_by_all_exchanges_but_one(baud: int, spread_ms: int) -> None:
    budget = budget_of_line("x", rtu(baud), {"gauge": UNITS})
    assert 1e3 * budget.spread_s == pytest.approx(spread_ms, abs=0.6)
    assert budget.spread_s == pytest.approx(budget.usual_s * 8 / 9)
    assert budget_of_line("x", rtu(baud), {"gauge": INT16}).spread_s == 0.0


def test_a_round_trigger_takes_its_time_and_leaves_no_spread() -> None:
    plain, latched = (
        budget_of_line("x", rtu(19200, **more), {"gauge": UNITS}) for more in ({}, {"round_trigger": BROADCAST})
    )
    assert latched.spread_s == 0.0
    assert latched.ideal_s - plain.ideal_s == pytest.approx((3.5 + 8) * 10 / 19200 + 0.1)
    answered = rtu(19200, round_trigger={"function": 16, "address": 0, "values": [1, 2], "unit": 3})
    more_s = budget_of_line("x", answered, {"gauge": UNITS}).usual_s - plain.usual_s
    assert more_s == pytest.approx((2 * 3.5 + 13 + 8) * 10 / 19200)


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_lengths_that_are_far_apart_are_warned_of_and_the_shipped_ones_are_not(name: str) -> None:
    configuration = load(CONFIG / name)
    budgets = line_budgets(configuration)
    assert budget_warnings(configuration, budgets) == []
    line = next(budget for budget in budgets if budget.name.startswith("joint"))
    others = [budget for budget in budgets if budget is not line]
    (warning,) = budget_warnings(configuration, [*others, replace(line, spread_s=0.174)])
    assert "lengths are measured 174 ms apart" in warning.what
    assert "`loop.skew_s`" in warning.next_step
    limited = replace(configuration, loop=configuration.loop.model_copy(update={"skew_s": 0.2}))
    assert budget_warnings(limited, [*others, replace(line, spread_s=0.174)]) == []


def test_a_limit_that_a_line_cannot_keep_is_warned_of() -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    limited = replace(configuration, loop=configuration.loop.model_copy(update={"skew_s": 0.01}))
    warnings = budget_warnings(limited, line_budgets(limited))
    assert {warning.what.split("`")[1] for warning in warnings} >= {"joints", "cabinet"}
    assert all("setpoints will be refused" in warning.what for warning in warnings)
