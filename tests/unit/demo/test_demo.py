"""The demo judges itself: a session with a shortcoming is repeated once, and then a sentence replaces the result."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.configuration import load
from compd.demo import machine_zero
from compd.demo import session as session_module
from compd.demo.machine_zero import GAUGES_TIMEOUT_S, take_zero
from compd.demo.session import DemoSession, DemoVisit, run_demo
from compd.demo.summary import verdict
from compd.errors import CompdError, DaemonError
from compd.gauge import Quality
from tests.support.paths import CONFIG


def visit(none_um: float = 6.0, full_um: float = 0.3) -> DemoVisit:
    return DemoVisit(1.0, (1.0, 2.0, 3.0), {"none": none_um, "joints": 5.0, "full": full_um}, {})


GOOD = DemoSession("m", [visit()] * 5, cycles=3800, missed=200)
SHORT = {
    "the tip was measured at 4 points, needed 5": replace(GOOD, visits=[visit()] * 4),
    "the tip was measured at 0 points, needed 5": replace(GOOD, visits=[]),
    "the daemon missed 30 % of its cycles, allowed 5 %": replace(GOOD, cycles=2321, missed=972),
    "setpoints that had expired before the machine was driven to them: 1": replace(GOOD, expired=1),
    "compensation made the tip worse: 6.00 -> 64408.92 um": replace(GOOD, visits=[visit(6.0, 64408.92)] * 5),
    "machine zero: refused": replace(GOOD, failure="machine zero: refused"),
}


def test_a_session_without_a_shortcoming_is_a_result() -> None:
    assert GOOD.shortcoming == ""
    assert replace(GOOD, visits=[visit(6.0, 6.0)] * 5).shortcoming == "", "a machine with scales alone corrects nothing"
    assert "by 0.30 um with joints and frame compensated" in verdict(GOOD)


@pytest.mark.parametrize("reason", SHORT)
def test_each_shortcoming_is_one_sentence(reason: str) -> None:
    assert SHORT[reason].shortcoming == reason
    assert verdict(SHORT[reason]) == f"The demo gave no result on this computer in 2 attempts: {reason}."


@contextmanager
def no_machine(*_: Any) -> Any:
    yield Path("nowhere")


@pytest.mark.parametrize(
    ("sessions", "attempts"), [([GOOD], 1), ([DemoSession("m"), GOOD], 2), ([DemoSession("m")] * 3, 2)]
)
def test_a_session_with_a_shortcoming_is_repeated_once(
    monkeypatch: pytest.MonkeyPatch, sessions: list[DemoSession], attempts: int
) -> None:
    left = list(sessions)
    monkeypatch.setattr(session_module, "simulated_daemon", no_machine)
    monkeypatch.setattr(session_module, "run_session", lambda *_: left.pop(0))
    assert run_demo(load(CONFIG / "hexapod.yaml"), 20, 1, lambda *_: None) is sessions[attempts - 1]
    assert len(sessions) - len(left) == attempts


@pytest.mark.parametrize("reason", SHORT)
def test_without_a_result_the_command_prints_a_sentence_and_no_table_and_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, reason: str
) -> None:
    def run(configuration: Any, seconds: float, seed: int, on_change: Any) -> DemoSession:
        on_change(SHORT[reason], 1.0, {"seq": 1, "state": "ok", "reason": ""})
        return SHORT[reason]

    monkeypatch.setattr("compd.demo.run_demo", run, raising=False)
    page = tmp_path / "demo.html"
    result = CliRunner().invoke(app, ["demo", "--page", str(page)])
    assert result.exit_code == 1
    said = " ".join(result.output.split())
    assert said.endswith(f"Starting the simulated machine and the daemon ... {verdict(SHORT[reason])}")
    assert not page.exists()


def test_a_machine_without_scales_is_refused() -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    bare = replace(configuration, wiring=configuration.wiring.model_copy(update={"scale": ()}))
    with pytest.raises(CompdError, match="drives a machine by its scales"):
        run_demo(bare, 20, 1, lambda *_: None)


class Refusing:
    """A daemon that refuses machine zero `times`, and whose gauge has these qualities, the last one for ever."""

    def __init__(self, times: int, *qualities: Quality):
        self.times, self.qualities, self.orders = times, list(qualities), []

    def __enter__(self) -> Refusing:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def watch(self, rate_hz: float) -> Any:
        while True:
            yield {}

    def status(self) -> dict[str, Any]:
        quality = self.qualities.pop(0) if len(self.qualities) > 1 else self.qualities[0]
        return {"gauges": [{"channel": "scale_1.position", "quality": quality}]}

    def zero(self, replace: bool = False) -> None:
        self.orders.append(replace)
        if len(self.orders) <= self.times:
            text = "machine zero: not every gauge can be read: scale 1: stale\n    next: mend the gauge, then take zero"
            raise DaemonError.of("compd.sock", text, value="zero_refused")


@pytest.mark.parametrize("quality", [Quality.OK, Quality.DISTRUSTED])
@pytest.mark.parametrize("times", [0, 1, 2])
def test_machine_zero_is_tried_three_times(monkeypatch: pytest.MonkeyPatch, times: int, quality: Quality) -> None:
    daemon = Refusing(times, Quality.NEVER_READ, Quality.STALE, quality)
    monkeypatch.setattr(machine_zero, "connect", lambda *_: daemon)
    take_zero(Path("compd.sock"))
    assert daemon.orders == [True] * (times + 1)


def test_a_slow_computer_is_not_told_to_mend_a_gauge(monkeypatch: pytest.MonkeyPatch) -> None:
    daemon = Refusing(9, Quality.OK)
    monkeypatch.setattr(machine_zero, "connect", lambda *_: daemon)
    with pytest.raises(DaemonError, match="the daemon refused it 3 times") as refused:
        take_zero(Path("compd.sock"))
    assert "mend" not in str(refused.value)
    assert "too slow, or too busy" in str(refused.value)
    assert "scale 1: stale" in str(refused.value)


def test_a_gauge_that_is_never_read_ends_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = iter(range(0, 1000, 7))
    monkeypatch.setattr(machine_zero.time, "monotonic", lambda: float(next(now_s)))
    monkeypatch.setattr(machine_zero, "connect", lambda *_: Refusing(0, Quality.TIMEOUT))
    with pytest.raises(DaemonError, match=f"not all are read within {GAUGES_TIMEOUT_S:g} s") as refused:
        take_zero(Path("compd.sock"))
    assert "scale_1.position timeout" in str(refused.value)
