"""The daemon put together, on real sockets; its gauges are good readings that the test writes."""

from __future__ import annotations

import json
import math
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import structlog

from compd.client import connect
from compd.clock import MonotonicClock
from compd.configuration import Configuration, load
from compd.errors import DaemonError
from compd.gauge import Quality, bad, good
from compd.live import daemon as daemon_module
from compd.live.daemon import Daemon
from compd.live.system.systemd import Notifier
from compd.operation_settings import SocketSettings, StateSettings
from tests.support.built_machines import drawing
from tests.support.paths import CONFIG
from tests.support.patience import PATIENCE_S
from tests.support.running_daemon import supervised

NEVER_STALE_S = 1e6


class StillGauges:
    """In the place of the lines: every gauge is read once and stays good."""

    def __init__(self, lines, stale_after_s, latest, clock, trust, poll_requests):
        self.lines = {}
        self.latest = latest

    def start(self):
        now_s = MonotonicClock().monotonic()
        for slot in range(len(self.latest.channels)):
            self.latest.put(slot, good(1.0, now_s))

    def stop(self, timeout_s=5.0):
        return True

    def status(self):
        return {"still": {"round_s": float("nan"), "state": "open"}}


@pytest.fixture
def still(monkeypatch):
    monkeypatch.setattr(daemon_module, "Acquisition", StillGauges)


def configuration(directory: Path, name="tripod-cmm.yaml", udp_port=None) -> Configuration:
    loaded = load(CONFIG / name)
    sockets = SocketSettings(
        tcp={"port": 0},
        unix={"path": str(directory / "s")},
        valid_for_s=0.1,
        udp=None if udp_port is None else {"host": "127.0.0.1", "port": udp_port},
    )
    loop = loaded.loop.model_copy(update={"stale_after_s": NEVER_STALE_S, "lock_memory": False, "rate_hz": 100})
    return replace(loaded, loop=loop, sockets=sockets, state=StateSettings(directory=str(directory / "state")))


@contextmanager
def running(configured: Configuration, notifier=None):
    with supervised(configured, notifier) as daemon, connect(configured.sockets.unix.path, PATIENCE_S) as client:
        yield daemon, client


def first(setpoints, state):
    """The first setpoint in `state`."""
    end_s = time.monotonic() + PATIENCE_S
    for setpoint in setpoints:
        if setpoint["state"] == state:
            return setpoint
        assert time.monotonic() < end_s, f"never {state}, still {setpoint}"
    raise AssertionError("no more setpoints come")


@pytest.mark.usefixtures("still")
def test_zero_is_asked_for_taken_kept_over_a_restart_and_refused_for_another_wiring(tmp_path):
    configured = configuration(tmp_path)
    with running(configured) as (_, client):
        assert client.version["machine"] == "tripod-cmm"
        assert client.version["config_hash"] == configured.config_hash
        setpoints = client.watch()
        assert "never been taken" in first(setpoints, "no_zero")["reason"]
        assert client.status()["zero"]["taken"] is False
        answer = client.zero()
        assert answer["readings_mm"]["joints.1"] == 1.0
        assert first(setpoints, "ok")["tip_M_mm"] == pytest.approx([0, 0, 190], abs=1e-6)
    with running(configured) as (_, client):
        assert first(client.watch(), "ok")["valid"]
        assert client.status()["zero"] == {"taken": True, "taken_at": answer["taken_at"]}
    scale, *others = configured.wiring.scale
    flipped = scale.model_copy(update={"sign": -1})
    rewired = replace(configured, wiring=configured.wiring.model_copy(update={"scale": (flipped, *others)}))
    with running(rewired) as (_, client):
        assert "another geometry, gauges or wiring" in first(client.watch(), "no_zero")["reason"]


@pytest.mark.usefixtures("still")
@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_a_gauge_that_waits_for_a_person_is_told_in_setpoint_and_status_with_the_same_words(tmp_path, name):
    configured = configuration(tmp_path, name)
    with running(configured) as (daemon, client):
        client.zero()
        assert first(client.watch(), "ok")
        assert "waits_for_person" not in client.status()
        now_s = MonotonicClock().monotonic()
        daemon.latest.put(daemon.latest.index["scale_1.position"], bad(now_s, Quality.DISTRUSTED, "came back"))
        words = "waits for a person"
        assert words in first(client.watch(), "fault")["reason"]
        assert client.status()["waits_for_person"] == f"{words}: look at scale_1, then `compd accept scale_1`"


@pytest.mark.usefixtures("still")
def test_machine_zero_says_where_a_port_has_changed_since(tmp_path):
    configured = configuration(tmp_path)
    with running(configured) as (_, client):
        client.zero()
    moved = configured.lines["scale_1"].model_copy(update={"port": "/dev/serial/by-id/usb-another"})
    elsewhere = replace(configured, lines={**configured.lines, "scale_1": moved})
    with running(elsewhere) as (daemon, client):
        change = "was at /dev/serial/by-id/usb-scale-1, is at /dev/serial/by-id/usb-another"
        assert client.status()["zero"]["ports_changed"] == {"scale_1": change}
        with structlog.testing.capture_logs() as logs:
            daemon.take_over()
    assert [(entry["gauge"], entry["change"]) for entry in logs] == [("scale_1", change)]


@pytest.mark.usefixtures("still")
def test_a_controller_gets_its_setpoints_and_its_going_ends_machine_tool_mode(tmp_path):
    configured = configuration(tmp_path)
    with running(configured) as (daemon, client):
        client.zero()
        setpoints = client.watch()
        with connect(f"127.0.0.1:{daemon.listeners.tcp_port}") as controller:
            controller.target(tip_B0_mm=[10, 0, -500])
            setpoint = next(s for s in setpoints if s["mode"] == "machine_tool" and s["state"] == "ok")
            assert setpoint["tip_B0_mm"] == pytest.approx([10, 0, -500])
            client.target(tip_B0_mm=[0, 0, -510])
            with pytest.raises(DaemonError, match="another client is the controller"):
                client.status()
            assert controller.status()["mode"] == "machine_tool"
        assert next(s for s in setpoints if s["mode"] == "cmm")["valid"]


@pytest.mark.usefixtures("still")
def test_status_tells_everything_and_holds_no_nan(tmp_path):
    with running(configuration(tmp_path)) as (daemon, client):
        next(client.watch())
        daemon.latest.put(daemon.latest.index["joints.3"], bad(1.0, Quality.DEVICE_ERROR, "ER,MS,31"))
        status = client.status()
        assert status["loop"]["cycles"] > 0
        assert status["lines"] == {"still": {"state": "open"}}, "what is nan is left out"
        assert set(status["realtime"]) == {"sched_fifo", "quiet_collector"}
        by_channel = {gauge["channel"]: gauge for gauge in status["gauges"]}
        assert by_channel["scale_1.position"]["measures"] == "scale 1"
        assert by_channel["scale_1.position"]["value"] == 1.0
        assert by_channel["joints.3"]["quality"] == "device_error"
        assert by_channel["joints.3"]["detail"] == "ER,MS,31"
        assert "value" not in by_channel["joints.3"]


@pytest.mark.usefixtures("still")
def test_udp_carries_one_packet_per_cycle_and_the_same_numbers(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(PATIENCE_S)
        configured = configuration(tmp_path, "hexapod.yaml", receiver.getsockname()[1])
        with running(configured) as (_, client):
            client.zero()
            lines = {s["seq"]: s for s, _ in zip(client.watch(), range(50), strict=False)}
            packets = {}
            while not set(packets) & set(lines) or max(packets) < max(lines):
                packet = receiver.recv(2048)
                packets[struct.unpack_from("<Q", packet, 8)[0]] = packet
            missed = client.status()["loop"]["missed_cycles"]
    gaps = max(packets) - min(packets) + 1 - len(packets)
    assert gaps <= missed, "one for every cycle"
    for seq in set(packets) & set(lines):
        valid = bool(struct.unpack_from("<H", packets[seq], 40)[0] & 1)
        assert valid == lines[seq]["valid"]
        if valid:
            assert struct.unpack_from("<3d", packets[seq], 48) == pytest.approx(lines[seq]["tip_M_mm"], abs=1e-7)
        assert packets[seq][264:272].hex() == configured.config_hash[:16]
        assert struct.unpack_from("<q", packets[seq], 280) == (-1,)


@pytest.mark.usefixtures("still")
@pytest.mark.parametrize(("name", "tip_B0_mm"), [("tripod-cmm.yaml", [10, 0, -500]), ("3-prs", [0, 0, 500])])
def test_udp_names_the_target_that_a_setpoint_answers(tmp_path, name, tip_B0_mm):
    machine = name if name.endswith(".yaml") else drawing(name, tmp_path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(PATIENCE_S)
        with running(configuration(tmp_path, machine, receiver.getsockname()[1])) as (_, client):
            client.zero()
            made_s = MonotonicClock().monotonic()
            client.target(tip_B0_mm=tip_B0_mm, time_s=made_s, id=7)
            named = (math.nan, -1)
            for _ in range(2000):
                named = struct.unpack_from("<dq", receiver.recv(2048), 272)
                if named[1] == 7:
                    break
    assert named == (made_s, 7)


@pytest.mark.usefixtures("still")
def test_systemd_hears_ready_and_watchdog_from_the_loop_and_the_state(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(PATIENCE_S)
        notifier = Notifier(str(tmp_path / "notify"), watchdog_s=0.1)
        with running(configuration(tmp_path), notifier) as (_, client):
            heard = set()
            while not {"READY=1", "WATCHDOG=1"} <= heard or not any(h.startswith("STATUS=no_zero") for h in heard):
                heard.add(manager.recv(4096).decode())
            client.status()
        while manager.recv(4096) != b"STOPPING=1":
            pass


def test_run_ends_with_sigterm_and_leaves_no_socket(tmp_path):
    """The program itself, with lines that are not there: it runs, says so, and stops when told."""
    configured = configuration(tmp_path)
    text = configured.path.read_text()
    for shipped, here in (
        ("/run/compd/compd.sock", str(tmp_path / "s")),
        ("/var/lib/compd", str(tmp_path / "state")),
        ("port: 7750", "port: 0"),
    ):
        assert shipped in text
        text = text.replace(shipped, here)
    config = tmp_path / "machine.yaml"
    config.write_text(text)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(PATIENCE_S)
        with subprocess.Popen(
            [sys.executable, "-m", "compd", "run", str(config)],
            stderr=subprocess.PIPE,
            text=True,
            env={"NOTIFY_SOCKET": str(tmp_path / "notify"), "PATH": "/usr/bin"},
        ) as process:
            try:
                while manager.recv(4096) != b"READY=1":
                    pass
                with connect(tmp_path / "s", PATIENCE_S) as client:
                    assert next(client.watch())["state"] == "no_zero"
                    with pytest.raises(DaemonError, match="not every gauge can be read"):
                        client.zero()
                process.send_signal(signal.SIGTERM)
                _, log = process.communicate(timeout=PATIENCE_S)
            finally:
                process.kill()
    assert process.returncode == 0, log
    assert 'event="no machine zero"' in log
    assert "signal=SIGTERM" in log
    assert not (tmp_path / "s").exists()


def test_a_second_daemon_on_the_same_socket_is_refused(tmp_path, still):
    configured = configuration(tmp_path)
    with running(configured), pytest.raises(DaemonError, match="another daemon is listening"):
        Daemon(configured)


def test_json_lines_of_watch_are_the_daemons_own(tmp_path, still, capsys):
    from compd.cli.live.watch import watch

    with running(configuration(tmp_path)):
        watch(str(tmp_path / "s"), rate_hz=50, count=3, json_lines=True)
        printed = capsys.readouterr().out.splitlines()  # here with the daemon's own log in between
        lines = [json.loads(line) for line in printed if line.startswith("{")]
        assert [line["class"] for line in lines] == ["SETPOINT"] * 3


def test_the_live_view_shows_state_tip_and_sources(tmp_path, still, capsys):
    from compd.cli.live.watch import watch
    from compd.cli.live.zero import zero

    with running(configuration(tmp_path)):
        watch(str(tmp_path / "s"), rate_hz=50, count=2)
        assert "NO_ZERO" in capsys.readouterr().out
        zero(str(tmp_path / "s"))
        assert "machine zero taken at" in capsys.readouterr().out
        watch(str(tmp_path / "s"), rate_hz=50, count=20)
        shown = capsys.readouterr().out
    for word in ("OK", "tip_M", "190.00000", "joints, um", "frame, um", "loop 100 Hz"):
        assert word in shown
