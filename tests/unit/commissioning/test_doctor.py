"""`compd doctor` on computers of all kinds, each a directory with what /dev, /proc and /sys would hold."""

from __future__ import annotations

import os
import socket
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from compd.commissioning.doctor import system
from compd.commissioning.doctor.examine import examine, is_fit, port_findings, what_to_do
from compd.commissioning.doctor.system import (
    clock_findings,
    disk_findings,
    realtime_findings,
    tcp_finding,
    unit_finding,
)
from compd.configuration import load
from compd.line_settings import LineSettings
from compd.lines.kinds.modbus_tcp.settings import ModbusTcpLine
from compd.lines.kinds.serial.settings import SerialLine
from compd.probes import Computer, Finding, Verdict, advice, fault, good
from compd.probes import serial_port as ports
from tests.support.paths import CONFIG

PORT = "/dev/serial/by-id/usb-FTDI_A1-if00-port0"


def line(port: str = PORT, low_latency: bool = True) -> dict[str, LineSettings]:
    return {"a": SerialLine(kind="serial", port=port, baud=9600, format="8N1", timeout_s=0.1, low_latency=low_latency)}


class Machine(Computer):
    """A computer below a directory of the test, with a USB adapter at ttyUSB0."""

    def __init__(self, root: Path, outputs: dict[str, str] | None = None) -> None:
        said = outputs or {}

        def run(command: Sequence[str]) -> str | None:
            return said.get(command[0])

        super().__init__(root, run)
        self.adapter("ttyUSB0", "1-1", serial="A1")
        self.link(PORT, "/dev/ttyUSB0")

    def write(self, path: str, text: str = "") -> None:
        self.path(path).parent.mkdir(parents=True, exist_ok=True)
        self.path(path).write_text(text + "\n")

    def link(self, path: str, to: str) -> None:
        self.path(path).parent.mkdir(parents=True, exist_ok=True)
        self.path(path).symlink_to(self.path(to))

    def adapter(self, tty: str, usb: str, serial: str = "", latency_ms: int = 16) -> None:
        self.write(f"/dev/{tty}")
        device = f"/sys/devices/usb/{usb}"
        self.write(f"{device}/idVendor", "0403")
        self.write(f"{device}/idProduct", "6001")
        if serial:
            self.write(f"{device}/serial", serial)
        self.write(f"{device}/{usb}:1.0/bInterfaceNumber", "00")
        self.write(f"{device}/{usb}:1.0/{tty}/port_number", "0")
        self.link(f"/sys/class/tty/{tty}/device", f"{device}/{usb}:1.0/{tty}")
        self.write(f"/sys/bus/usb-serial/devices/{tty}/latency_timer", str(latency_ms))


def only(findings: Sequence[Finding], verdict: Verdict) -> str:
    """The single finding of that verdict, with its next step."""
    (finding,) = [finding for finding in findings if finding.verdict is verdict]
    return f"{finding.what}; {finding.next_step}"


def test_a_port_that_is_there_and_may_be_opened(tmp_path: Path) -> None:
    findings = list(port_findings(Machine(tmp_path), line(), daemon_runs=False))
    assert {finding.verdict for finding in findings} == {Verdict.GOOD}
    assert f"{PORT} is there and may be opened" in [finding.what for finding in findings]


def test_a_port_that_is_not_there_is_named_with_those_that_are(tmp_path: Path) -> None:
    findings = list(port_findings(Machine(tmp_path), line("/dev/serial/by-id/usb-other"), daemon_runs=False))
    assert "usb-FTDI_A1-if00-port0" in only(findings, Verdict.FAULT)


def test_a_port_that_this_user_may_not_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine(tmp_path)
    monkeypatch.setattr(ports.os, "access", lambda *_: False)
    monkeypatch.setattr(ports.grp, "getgrgid", lambda _: type("Group", (), {"gr_name": "dialout"}))
    assert "usermod --append --groups dialout" in only(
        list(port_findings(machine, line(), daemon_runs=False)), Verdict.FAULT
    )


def test_who_holds_a_port(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.write("/proc/4711/comm", "minicom")
    machine.link("/proc/4711/fd/7", "/dev/ttyUSB0")
    assert "end minicom (4711)" in only(list(port_findings(machine, line(), daemon_runs=False)), Verdict.FAULT)
    machine.write("/proc/4711/comm", "compd acquisiti")
    findings = list(port_findings(machine, line(), daemon_runs=True))
    assert {finding.verdict for finding in findings} == {Verdict.GOOD}


def test_a_name_that_two_adapters_share(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.adapter("ttyUSB1", "1-2")
    machine.adapter("ttyUSB2", "1-3")
    machine.link("/dev/serial/by-id/usb-1a86-if00", "/dev/ttyUSB2")
    machine.link("/dev/serial/by-path/pci-usb-0:3", "/dev/ttyUSB2")
    findings = list(port_findings(machine, line("/dev/serial/by-id/usb-1a86-if00"), daemon_runs=False))
    assert "/dev/serial/by-path/pci-usb-0:3" in only(findings, Verdict.FAULT)
    assert all(finding.verdict is Verdict.GOOD for finding in port_findings(machine, line(), daemon_runs=False))


def test_a_name_that_depends_on_the_order_of_plugging(tmp_path: Path) -> None:
    findings = list(port_findings(Machine(tmp_path), line("/dev/ttyUSB0"), daemon_runs=False))
    assert f"write `port: {PORT}`" in only(findings, Verdict.ADVICE)


def test_the_latency_timer_of_an_adapter(tmp_path: Path) -> None:
    findings = list(port_findings(Machine(tmp_path), line(low_latency=False), daemon_runs=False))
    assert "16 ms (latency timer); line a: leave `low_latency` out" in only(findings, Verdict.ADVICE)


def test_a_network_device_is_not_connected_to_while_the_daemon_runs(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        port = server.getsockname()[1]
        lines = {"c": ModbusTcpLine(kind="modbus_tcp", host="127.0.0.1", port=port, timeout_s=0.1)}
        (finding,) = port_findings(machine, lines, daemon_runs=True)
        assert finding.verdict is Verdict.UNKNOWN
        with pytest.raises(BlockingIOError):
            server.accept()
        (finding,) = port_findings(machine, lines, daemon_runs=False)
        assert finding.verdict is Verdict.GOOD
    (finding,) = port_findings(machine, lines, daemon_runs=False)
    assert finding.verdict is Verdict.FAULT


def test_real_time_that_is_not_permitted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine(tmp_path)
    machine.write("/proc/self/status", "Name:\tpython\nCapEff:\t0000000000000000")
    machine.write("/proc/version", "Linux version 6.1 (x) #1 SMP")
    machine.write("/proc/sys/kernel/sched_rt_runtime_us", "-1")
    machine.write("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave")
    monkeypatch.setattr(system.resource, "getrlimit", lambda _: (0, 0))
    found = [finding.what for finding in realtime_findings(machine, 40, {}) if finding.verdict is Verdict.ADVICE]
    words = ("no priority 40", "0 MB of memory", "does not preempt", "throttling is off", "powersave")
    assert [word in what for word, what in zip(words, found, strict=True)] == [True] * 5


def test_real_time_by_capabilities_and_on_a_real_time_kernel(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.write("/proc/self/status", "CapEff:\t000001ffffffffff")
    machine.write("/sys/kernel/realtime", "1")
    machine.write("/proc/sys/kernel/sched_rt_runtime_us", "950000")
    findings = list(realtime_findings(machine, 40, {}))
    assert {finding.verdict for finding in findings} == {Verdict.GOOD}
    assert "the kernel is PREEMPT_RT" in [finding.what for finding in findings]


def test_what_the_running_daemon_was_granted_counts_more_than_what_this_user_may(tmp_path: Path) -> None:
    refused = {"granted": False, "detail": "Operation not permitted"}
    granted = {"sched_fifo": refused, "wake_latency": refused}
    fifo, awake, *_ = realtime_findings(Machine(tmp_path), 40, granted)
    assert "the running daemon has no sched_fifo" in fifo.what
    assert "the running daemon has no wake_latency" in awake.what
    assert "compd.rules" in awake.next_step


@pytest.mark.parametrize(("said", "verdict"), [("yes", Verdict.GOOD), ("no", Verdict.ADVICE), (None, Verdict.UNKNOWN)])
def test_the_time_of_day(tmp_path: Path, said: str | None, verdict: Verdict) -> None:
    outputs = {} if said is None else {"timedatectl": said}
    assert list(clock_findings(Machine(tmp_path, outputs)))[-1].verdict is verdict


def test_a_slow_clock(tmp_path: Path) -> None:
    machine = Machine(tmp_path, {"timedatectl": "yes"})
    machine.write("/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet")
    assert "hpet" in only(list(clock_findings(machine)), Verdict.ADVICE)


@pytest.mark.parametrize(
    ("free_bytes", "verdict"), [(50e6, Verdict.FAULT), (1e9, Verdict.ADVICE), (100e9, Verdict.GOOD)]
)
def test_room_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_bytes: float, verdict: Verdict) -> None:
    monkeypatch.setattr(system.shutil, "disk_usage", lambda _: type("Usage", (), {"free": free_bytes}))
    assert [finding.verdict for finding in disk_findings(Machine(tmp_path), Path("/var/lib/compd"))] == [verdict]


def test_a_state_directory_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system.os, "access", lambda *_: False)
    findings = list(disk_findings(Machine(tmp_path), Path("/var/lib/compd")))
    assert "no machine zero can be taken" in only(findings, Verdict.FAULT)
    assert not (tmp_path / "var").exists()


def test_the_tcp_port(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    assert tcp_finding(machine, 7750, daemon_runs=False).verdict is Verdict.GOOD
    head = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
    machine.write("/proc/net/tcp", head + "   0: 0100007F:1E46 00000000:0000 0A 0:0 00:0 0 0 0 4711 1")
    assert tcp_finding(machine, 7750, daemon_runs=False).verdict is Verdict.FAULT
    assert tcp_finding(machine, 7750, daemon_runs=True).verdict is Verdict.GOOD
    assert tcp_finding(machine, 7751, daemon_runs=False).verdict is Verdict.GOOD


UNIT = "LoadState=loaded\nActiveState={}\nSubState=x\nNRestarts=3\nUnitFileState={}"


@pytest.mark.parametrize(
    ("shown", "verdict"),
    [
        (None, Verdict.UNKNOWN),
        ("LoadState=not-found", Verdict.UNKNOWN),
        (UNIT.format("failed", "enabled"), Verdict.FAULT),
        (UNIT.format("active", "disabled"), Verdict.ADVICE),
        (UNIT.format("active", "enabled"), Verdict.GOOD),
    ],
)
def test_the_unit(tmp_path: Path, shown: str | None, verdict: Verdict) -> None:
    outputs = {} if shown is None else {"systemctl": shown}
    assert unit_finding(Machine(tmp_path, outputs), daemon_runs=True).verdict is verdict


def test_what_to_do_comes_with_the_worst_first_and_each_step_once() -> None:
    findings = [
        good("a", "well"),
        advice("b", "slow", "quicken b"),
        fault("c", "gone", "plug c in"),
        fault("d", "gone", "plug c in"),
    ]
    assert what_to_do(findings) == ["plug c in", "quicken b"]
    assert not is_fit(findings)
    assert is_fit(findings[:2])


def test_all_looks_at_a_configuration_touch_nothing(tmp_path: Path) -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    unix = configuration.sockets.unix.model_copy(update={"path": str(tmp_path / "none.sock")})
    lines = {name: settings for name, settings in configuration.lines.items() if settings.kind != "modbus_tcp"}
    sockets = configuration.sockets.model_copy(update={"unix": unix})
    machine = Machine(tmp_path / "root")
    before = sorted(path for path, *_ in os.walk(tmp_path))
    findings = examine(replace(configuration, sockets=sockets, lines=lines), machine)
    assert sum(finding.verdict is Verdict.FAULT for finding in findings) == 5, "none of its ports is here"
    assert sorted(path for path, *_ in os.walk(tmp_path)) == before
