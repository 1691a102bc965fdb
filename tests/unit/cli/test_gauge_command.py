"""`compd gauge` and `compd driver` on simulated devices behind real ptys."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from compd.cli.live.gauge import driver as driver_cli
from compd.cli.live.gauge import gauge as gauge_cli
from compd.clock import MonotonicClock
from compd.configuration import load as load_machine
from compd.errors import CompdError
from compd.gauge_description import read_capture
from compd.gauge_tools import preset_candidates
from compd.gauge_tools.open_gauge import open_tapped_line
from compd.gauge_tools.probe import PresetCandidate, probe_port
from compd.lines import open_line, serial_ports
from compd.lines.kinds.modbus_rtu.settings import ModbusRtuLine
from compd.lines.kinds.serial.settings import SerialLine
from compd.plugins import GAUGES, SIMULATED_GAUGES, load, names
from compd.simulation.wires.simulated_line import SimulatedLine
from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S
from tests.unit.commissioning.gauge_description.test_capture import talker

RUNNER = CliRunner()
PATIENT, SOON = ("--timeout", str(PATIENCE_S)), ("--timeout", "0.3")
BAUD = ("--baud", "115200", "--format", "8N1", *PATIENT)
MAP = "channels=[{name: a, function: 4, address: 0, type: int16, unit: mm}]"


def device(name: str, **options: Any) -> Any:
    validated = load(GAUGES, name, name).Options.model_validate({"driver": name, "line": "x", **options})
    return load(SIMULATED_GAUGES, name, name)(validated, lambda channel: 1.25)


@pytest.fixture
def scale(tmp_path: Path) -> Iterator[str]:
    """A scale display's port."""
    settings = SerialLine(kind="serial", port="/x", baud=115200, format="8N1", timeout_s=0.5)
    line = SimulatedLine("scale", settings, [device("heidenhain_nd28x")], tmp_path)
    yield str(line.start())
    line.stop()


@pytest.fixture
def slave(tmp_path: Path) -> Iterator[str]:
    """The port of a Modbus slave with one float32."""
    settings = ModbusRtuLine(kind="modbus_rtu", port="/x", baud=115200, format="8N1", timeout_s=0.5)
    channels = [{"name": "a", "function": 4, "address": 0, "type": "float32", "unit": "mm"}]
    line = SimulatedLine("slave", settings, [device("modbus", unit=1, channels=channels)], tmp_path)
    yield str(line.start())
    line.stop()


def run_gauge(*arguments: str, answers: str | None = None) -> tuple[int, str]:
    result = RUNNER.invoke(gauge_cli.gauge, list(arguments), input=answers)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


def test_list_names_every_driver() -> None:
    code, output = run_gauge("list")
    assert code == 0
    assert all(name in output for name in names(GAUGES))


def test_names_are_whole_at_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    _, output = run_gauge("list")
    assert max(map(len, output.splitlines()[:-1])) <= 80
    assert all(re.search(rf"^[│ ]*{name}[│ ]", output, re.MULTILINE) for name in names(GAUGES))


def test_an_error_in_a_list_of_options_is_said_once(scale: str) -> None:
    port = ("--port", scale, *BAUD, "--set", "unit=1")
    with pytest.raises(CompdError) as caught:
        run_gauge("read", "modbus", *port, "--set", MAP.replace("unit: mm", "unit: ells"))
    assert [problem.where for problem in caught.value.problems] == ["--set channels.0.unit"]


def test_show_has_every_key_of_a_description_down_to_the_last() -> None:
    code, output = run_gauge("show", "modbus")
    assert code == 0
    for key in ("channels", "channels.type", "channels.status.mask", "identity.equals", "write_first.settle_s"):
        assert f" {key} " in output
    _, output = run_gauge("show", "serial_ascii")
    assert all(f" {key} " in output for key in ("requests.out", "requests.in", "channels.range", "errors.quality"))


def test_read_shows_the_bytes_and_the_value(scale: str) -> None:
    code, output = run_gauge("read", "heidenhain_nd28x", "--port", scale, *BAUD)
    assert code == 0
    assert "> 02 " in output
    assert "2b 20 20" in output
    assert "position: 1.250000 mm" in output


def test_read_modbus_with_its_frames(slave: str) -> None:
    channels = "[{name: a, function: 4, address: 0, type: float32, unit: mm}]"
    code, output = run_gauge(
        "read",
        "modbus",
        "--port",
        slave,
        "--baud",
        "115200",
        "--format",
        "8N1",
        "--set",
        "unit=1",
        "--set",
        f"channels={channels}",
    )
    assert code == 0
    assert "> 01 04 00 00" in output
    assert "modbus.a: 1.250000 mm" in output


def test_read_a_configured_gauge_that_is_not_there() -> None:
    path = str(ROOT / "config" / "tripod-cmm.yaml")
    code, output = run_gauge("read", path, "scale_1")
    assert code == 1
    assert "line_lost" in output
    with pytest.raises(CompdError, match="no such gauge"):
        run_gauge("read", path, "scale_9")


def test_a_serial_port_needs_baud_and_format(scale: str) -> None:
    with pytest.raises(CompdError, match="needs both"):
        run_gauge("read", "heidenhain_nd28x", "--port", scale)


def test_keys_of_the_line_stand_on_the_command_line(scale: str) -> None:
    port = ("--port", scale, *BAUD)
    code, output = run_gauge("read", "heidenhain_nd28x", *port, "--line", "pause_s=0.02")
    assert (code, "1.250000 mm" in output) == (0, True)
    code, output = run_gauge("read", "heidenhain_nd28x", *port, "--line", "echo=true")
    assert code == 1
    assert "see `echo` of the line" in output
    code, output = run_gauge(
        "read", "modbus", *port, *SOON, "--line", "kind=modbus_ascii", "--set", "unit=1", "--set", MAP
    )
    assert "> 3a 30 31 30 34" in output, ":0104, as text"


@pytest.mark.parametrize(
    ("key", "problem"),
    [
        ("echo", "--line: is not KEY=VALUE"),
        ("ecko=true", "--ecko"),
        ("rs485={rts_when_sending: 5}", "--rs485.rts_when"),
    ],
)
def test_a_key_of_the_line_that_cannot_be(scale: str, key: str, problem: str) -> None:
    port = ("--port", scale, *BAUD)
    with pytest.raises(CompdError, match=problem):
        RUNNER.invoke(gauge_cli.gauge, ["read", "heidenhain_nd28x", *port, "--line", key], catch_exceptions=False)


def test_watch_counts(scale: str) -> None:
    code, output = run_gauge("watch", "heidenhain_nd28x", "--port", scale, *BAUD, "--polls", "5")
    assert code == 0
    assert "5 polls" in output
    assert "faults: none" in output


def usb_port(device: Path, serial_number: str | None, pid: int = 0x7523) -> Any:
    """What pyserial says of an adapter."""
    return SimpleNamespace(
        device=str(device), vid=0x1A86, pid=pid, serial_number=serial_number, manufacturer="QinHeng", product="CH340",
        description="CH340",
    )  # fmt: skip


@pytest.fixture
def adapters(tmp_path: Path) -> Path:
    """Four adapters: two without serial numbers, which share one name, and two of one serial number, a clone."""
    for folder in ("by-id", "by-path"):
        (tmp_path / folder).mkdir()
    for k in range(5):
        device = tmp_path / f"ttyUSB{k}"
        device.touch()
        (tmp_path / "by-path" / f"pci-0000:00:14.0-usb-0:{k}:1.0-port0").symlink_to(device)
    (tmp_path / "by-id" / "usb-1a86_USB2.0-Serial-if00-port0").symlink_to(tmp_path / "ttyUSB1")
    (tmp_path / "by-id" / "usb-FTDI_0001-if00-port0").symlink_to(tmp_path / "ttyUSB3")
    (tmp_path / "by-id" / "usb-FTDI_A7-if00-port0").symlink_to(tmp_path / "ttyUSB4")
    return tmp_path


def test_adapters_that_share_a_name_are_named_by_their_sockets(adapters: Path) -> None:
    found = [
        *(usb_port(adapters / f"ttyUSB{k}", None) for k in (0, 1)),
        *(usb_port(adapters / f"ttyUSB{k}", "0001", pid=0x6001) for k in (2, 3)),
        usb_port(adapters / "ttyUSB4", "A7", pid=0x6001),
    ]
    ports = {
        Path(port.device).name: port for port in serial_ports(adapters / "by-id", adapters / "by-path", lambda: found)
    }
    for k in range(4):
        assert ports[f"ttyUSB{k}"].path.endswith(f"usb-0:{k}:1.0-port0")
        assert "USB socket" in ports[f"ttyUSB{k}"].note
    assert ports["ttyUSB4"].path.endswith("usb-FTDI_A7-if00-port0")
    assert ports["ttyUSB4"].note == ""


def test_a_single_adapter_without_a_serial_number_is_named_by_its_socket(adapters: Path) -> None:
    """The next one that is plugged in would take its name."""
    found = [usb_port(adapters / "ttyUSB1", None)]
    ports = serial_ports(adapters / "by-id", adapters / "by-path", lambda: found)
    (port,) = [port for port in ports if port.device.endswith("ttyUSB1")]
    assert port.path.endswith("usb-0:1:1.0-port0")


def test_scan_and_probe(scale: str, tmp_path: Path) -> None:
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    (by_id / "usb-Scale_1").symlink_to(scale)
    assert str(by_id / "usb-Scale_1") in {port.path for port in serial_ports(by_id)}
    nd28x = load(GAUGES, "heidenhain_nd28x", "x")
    candidate = PresetCandidate("nd", nd28x(nd28x.Options(driver="nd", line="x")), 115200, "8N1")
    assert str(probe_port(scale, candidate)) == "position 1.25 mm"
    assert "line_lost" in str(probe_port(str(tmp_path / "nothing"), candidate))
    assert {"heidenhain_nd28x", "sylvac_optors", "adam_4017p"} <= {candidate.name for candidate in preset_candidates()}


def test_read_waits_for_the_same_silence_as_the_daemon(scale: str) -> None:
    """3.5 characters at 9600 baud are 3.6 ms: a request that follows a byte sooner would be seen on the wire."""
    settings = SerialLine(kind="serial", port=scale, baud=9600, format="8N1", timeout_s=0.5)
    tapped = open_tapped_line(settings, MonotonicClock(), lambda direction, data: None)
    tapped.close()
    line = open_line(settings, MonotonicClock())
    line.close()
    assert vars(tapped)["_gap_s"] == vars(line)["_gap_s"] == pytest.approx(3.5 * 10 / 9600)


def test_scan_without_probe_sends_nothing() -> None:
    code, _ = run_gauge("scan")
    assert code == 0


LEARN = ("--unit", "mm", "--range", "unknown")


def test_what_learn_writes_is_what_read_and_watch_take(scale: str, tmp_path: Path) -> None:
    """A whole description, out of a file of replies and with the port of the gauge."""
    capture = tmp_path / "capture.txt"
    replies = [f'< "{sign}{number:10.4f}    \\r\\n"\n' for sign, number in (("+", 12.3456), ("-", 0.5), ("+", 1.2))]
    capture.write_text("".join(['# a scale display\n> "\\x02"\n', *replies]))
    written, port = tmp_path / "gauge.yaml", ("--port", scale, *BAUD)
    code, output = run_gauge("learn", str(capture), "--unit", "mm", "--range=-20,20", *port, "--to", str(written))
    assert code == 0
    assert written.read_text() in output
    code, output = run_gauge("read", str(written))
    assert (code, "learned_gauge.value: 1.250000 mm" in output) == (0, True)
    code, output = run_gauge("watch", str(written), "learned_gauge", "--polls", "3")
    assert (code, "faults: none" in output) == (0, True)
    run_gauge("learn", str(capture), "--unit", "mm", "--range=-1,1", *port, "--to", str(written), "--overwrite")
    code, output = run_gauge("read", str(written))
    assert (code, "over_range" in output) == (1, True)


def test_a_learned_gauge_is_pasted_into_a_machine(tmp_path: Path) -> None:
    capture = tmp_path / "capture.txt"
    capture.write_text('> "?\\r"\n< "+1.23\\r"\n< "-0.50\\r"\n< "+0.01\\r"\n')
    written, machine = tmp_path / "gauge.yaml", tmp_path / "machine.yaml"
    port = ("--port", "/dev/serial/by-id/dial", "--baud", "9600", "--format", "7E2")
    run_gauge("learn", str(capture), *LEARN, *port, "--to", str(written))
    lines, gauges = written.read_text().removeprefix("lines:\n").split("gauges:\n")
    shipped = (ROOT / "config" / "tripod-cmm.yaml").read_text()
    pasted = shipped.replace("\nlines:\n", "\nlines:\n" + lines).replace("\ngauges:\n", "\ngauges:\n" + gauges)
    machine.write_text(pasted)
    configuration = load_machine(machine)
    assert configuration.gauges["learned_gauge"].line == "learned_line"
    assert configuration.lines["learned_line"].model_dump()["format"] == "7E2"


def test_a_file_of_gauges_without_their_line_takes_it_from_the_command_line(scale: str, tmp_path: Path) -> None:
    file = tmp_path / "gauges.yaml"
    file.write_text(
        "gauges:\n  a: {driver: heidenhain_nd28x, line: x}\n  b: {driver: heidenhain_nd28x, line: x, unt: mm}\n"
    )
    with pytest.raises(CompdError, match=r"gauges.yaml:3 gauges.b.unt: unknown key"):
        run_gauge("read", str(file), "a")
    file.write_text(file.read_text().replace("unt", "unit"))
    with pytest.raises(CompdError, match=r"gauges.yaml:2 gauges.a.line: the file has no line of this name"):
        run_gauge("read", str(file), "a")
    with pytest.raises(CompdError, match="name one of its gauges"):
        run_gauge("read", str(file))
    code, output = run_gauge("read", str(file), "a", "--port", scale, *BAUD)
    assert (code, "a.position: 1.250000 mm" in output) == (0, True)


def test_an_error_reply_on_the_command_line(tmp_path: Path) -> None:
    capture = tmp_path / "capture.txt"
    capture.write_text('> "?\\r"\n< 2B 31 2E 32 33 0D\n> "?\\r"\n< "-0.50\\r"\n< "+0.01\\r"\n< "\\x15E=0\\r"\n')
    assert read_capture(capture)[-1] == (b"?\r", b"\x15E=0\r")
    code, output = run_gauge("learn", str(capture), *LEARN, "--error", r"\x15E=0=sensor_fault")
    assert code == 0
    assert "-> sensor_fault" in output
    with pytest.raises(CompdError, match="--error: has no reply"):
        run_gauge("learn", str(capture), *LEARN, "--error", "sensor_fault")


def test_a_range_that_is_none() -> None:
    with pytest.raises(CompdError, match="--range: is no range"):
        run_gauge("learn", "x", "--range", "wide")


def test_replies_of_a_live_gauge_are_kept_where_questions_are_left(scale: str) -> None:
    """The simulated display stands still: its replies do not differ, and that is said. Nobody presses Enter."""
    port = ("--port", scale, *BAUD, *SOON)
    result = RUNNER.invoke(gauge_cli.gauge, ["learn", *port, *LEARN, "--out", r"\x02", "--replies", "3"])
    assert isinstance(result.exception, CompdError)
    assert "too few that differ" in str(result.exception)
    kept = re.search(r"the replies are kept: compd gauge learn (\S+)", result.output)
    assert kept is not None
    captured = read_capture(Path(kept[1]))
    Path(kept[1]).unlink()
    assert [(request, len(reply)) for request, reply in captured] == 3 * [(b"\x02", 17)]


def test_learn_a_device_that_sends_unsolicited(tmp_path: Path) -> None:
    written = tmp_path / "gauge.yaml"
    with talker(0.02) as port:
        code, _ = run_gauge(
            "learn",
            "--port",
            port,
            "--baud",
            "9600",
            "--format",
            "8N1",
            *PATIENT,
            *LEARN,
            "--to",
            str(written),
            answers=6 * "\n",
        )
        assert code == 0
        code, output = run_gauge("watch", str(written), "--polls", "5")
    assert (code, "faults: none" in output) == (0, True)


def test_driver_test_prints_every_case_and_fails_by_exit_code(tmp_path: Path) -> None:
    result = RUNNER.invoke(driver_cli.driver, ["heidenhain_nd28x", "--quick"])
    assert result.exit_code == 0
    assert "nothing failed" in result.output
    assert "not detectable on this wire" in result.output
    options = tmp_path / "options.yaml"
    options.write_text("unit: inch\n")
    result = RUNNER.invoke(driver_cli.driver, ["heidenhain_nd28x", "--quick", "--options", str(options)])
    assert result.exit_code == 0
