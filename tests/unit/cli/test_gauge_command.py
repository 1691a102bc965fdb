"""`compd gauge` and `compd driver` on simulated devices behind real ptys."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from compd.cli import driver as driver_cli
from compd.cli import gauge as gauge_cli
from compd.commissioning.capture import read_capture
from compd.commissioning.describe import describe_replies, read_replies
from compd.commissioning.gauge_statistics import GaugeStatistics
from compd.commissioning.scan import PresetCandidate, preset_candidates, probe_port, serial_ports
from compd.configuration.lines import ModbusRtuLine, SerialLine
from compd.errors import CompdError
from compd.gauge import Channel, Quality, bad, good
from compd.plugins import GAUGES, SIMULATED_GAUGES, load, names
from compd.simulation.wires.simulated_line import SimulatedLine
from tests.support.paths import ROOT

RUNNER = CliRunner()


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


def gauge(*arguments: str, given: str | None = None) -> tuple[int, str]:
    result = RUNNER.invoke(gauge_cli.app, list(arguments), input=given)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


def test_list_names_every_driver() -> None:
    code, said = gauge("list")
    assert code == 0
    assert all(name[:12] in said for name in names(GAUGES))


def test_read_shows_the_bytes_and_the_value(scale: str) -> None:
    code, said = gauge("read", "heidenhain_nd28x", "--port", scale, "--baud", "115200", "--format", "8N1")
    assert code == 0
    assert "> 02 " in said
    assert "2b 20 20" in said
    assert "position: 1.250000 mm" in said


def test_read_modbus_with_its_frames(slave: str) -> None:
    channels = "[{name: a, function: 4, address: 0, type: float32, unit: mm}]"
    code, said = gauge(
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
    assert "> 01 04 00 00" in said
    assert "modbus.a: 1.250000 mm" in said


def test_read_a_configured_gauge_that_is_not_there() -> None:
    path = str(ROOT / "config" / "tripod-cmm.yaml")
    code, said = gauge("read", path, "scale_1")
    assert code == 1
    assert "line_lost" in said
    with pytest.raises(CompdError, match="no such gauge"):
        gauge("read", path, "scale_9")


def test_a_serial_port_needs_baud_and_format(scale: str) -> None:
    with pytest.raises(CompdError, match="needs both"):
        gauge("read", "heidenhain_nd28x", "--port", scale)


def test_watch_counts(scale: str) -> None:
    code, said = gauge(
        "watch", "heidenhain_nd28x", "--port", scale, "--baud", "115200", "--format", "8N1", "--polls", "5"
    )
    assert code == 0
    assert "5 polls" in said
    assert "faults: none" in said


def test_statistics() -> None:
    found = GaugeStatistics([Channel("a"), Channel("b")])
    assert math.isnan(found.rate_hz)
    assert math.isnan(found.noise(0))
    for k in range(5):
        other = bad(k / 10, Quality.CRC) if k % 2 else good(1.0, k / 10)
        found.add([good(0.001 * k, k / 10), other], k / 10)
    assert found.rate_hz == pytest.approx(10)
    assert found.noise(0) == pytest.approx(0.001 * math.sqrt(2.5))
    assert found.noise(1) == 0
    assert found.faults == {Quality.CRC: 2}
    assert found.age_s(1, 0.5) == pytest.approx(0.1)


def test_scan_and_probe(scale: str, tmp_path: Path) -> None:
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    (by_id / "usb-Scale_1").symlink_to(scale)
    assert str(by_id / "usb-Scale_1") in {port.path for port in serial_ports(by_id)}
    nd28x = load(GAUGES, "heidenhain_nd28x", "x")
    candidate = PresetCandidate("nd", nd28x(nd28x.Options(driver="nd", line="x")), 115200, "8N1")
    assert probe_port(scale, candidate) == "position 1.25 mm"
    assert "line_lost" in probe_port(str(tmp_path / "nothing"), candidate)
    assert {"heidenhain_nd28x", "sylvac_optors", "adam_4017p"} <= {found.name for found in preset_candidates()}


def test_scan_without_probe_sends_nothing() -> None:
    code, _ = gauge("scan")
    assert code == 0


# --- learn ---------------------------------------------------------------------------------------------------

OBSERVED = {
    "fixed decimals": (b"?\r", [b"+0001.23\r\n", b"-0012.30\r\n", b"+0000.00\r\n"], ["1.23", "-12.3", "0"]),
    "two heads": (
        b"M0\r\n",
        [b"M0,+000.1234,-001.0000\r\n", b"M0,-000.1234,-001.5000\r\n", b"M0,+010.1234,-001.0000\r\n"],
        ["0.1234, -1", "-0.1234, -1.5", "10.1234, -1"],
    ),
    "leading blanks": (
        b"\x02",
        [b"+    12.3456    \r\n", b"-     2.3456 >  \r\n", b"      0.0001 <  \r\n"],
        ["12.3456", "-2.3456", "0.0001"],
    ),
    "no fixed width": (b"?\r", [b" 1.234\r", b"-12.345\r", b" 0.001\r"], ["1.234", "-12.345", "0.001"]),
    "unasked": (b"", [b"GS,  12.3,kg\r\n", b"NT,  -2.3,kg\r\n", b"GS,   0.0,kg\r\n"], ["12.3", "-2.3", "0"]),
    "no terminator": (b"R", [b"A+1.234", b"A-0.500", b"A+0.001"], ["1.234", "-0.5", "0.001"]),
    "percent": (b"R", [b"12345%\r", b"00345%\r", b"-0001%\r"], ["12345", "345", "-1"]),
}


@pytest.mark.parametrize("case", OBSERVED)
def test_learned_description_reads_what_was_observed(case: str) -> None:
    request, replies, values = OBSERVED[case]
    learned = describe_replies(request, replies, "mm")
    assert read_replies(learned, load(GAUGES, "serial_ascii", "x"), replies) == values


def test_learned_description_is_narrow() -> None:
    request, replies, _ = OBSERVED["fixed decimals"]
    learned = describe_replies(request, replies, "mm")
    for damaged in (b"+001.23\r\n", b"+0001.2\r\n", b"+0001.234\r\n", b"0001.23\r\n", b"+00x1.23\r\n", b"\r\n"):
        with pytest.raises(CompdError, match="does not fit"):
            read_replies(learned, load(GAUGES, "serial_ascii", "x"), [damaged])


@pytest.mark.parametrize(
    ("replies", "said"),
    [
        ([b"+1.23\r\n", b"+1.23\r\n", b"+1.23\r\n"], "too few that differ"),
        ([b"+1.23\r\n", b"ERR0\r\n", b"+1.24\r\n", b"+1.25\r\n"], "reply 2, character"),
        ([b"+1.23", b"+11.23", b"+1.25"], "no terminator in common"),
        ([b"a\r", b"b\r", b"c\r"], "no number"),
        ([], "there is none"),
        ([b"1.0,2.0\r", b"1.1,2.1\r", b"1.2\r"], "reply 3"),
    ],
)
def test_inconsistent_replies_are_refused_with_their_place(replies: list[bytes], said: str) -> None:
    with pytest.raises(CompdError, match=said):
        describe_replies(b"?", replies, "mm")


def test_learn_from_a_file_gives_a_usable_gauge(tmp_path: Path) -> None:
    capture = tmp_path / "capture.txt"
    capture.write_text(
        '# an unknown gauge\n> "?\\r"\n< 2B 31 2E 32 33 0D\n> "?\\r"\n< "-0.50\\r"\n< "+0.01\\r"\n< "ERR0\\r"\n'
    )
    assert read_capture(capture) == (b"?\r", [b"+1.23\r", b"-0.50\r", b"+0.01\r", b"ERR0\r"])
    written = tmp_path / "gauge.yaml"
    code, said = gauge("learn", str(capture), "--unit", "um", "--error", "ERR0=sensor_fault", "--to", str(written))
    assert code == 0
    assert "sensor_fault" in said
    options = yaml.safe_load(written.read_text())["learned_gauge"]
    driver = load(GAUGES, "serial_ascii", "x")
    assert driver(driver.Options.model_validate(options)).channels[0].unit == "mm"


def test_a_capture_that_cannot_be_read_is_named_by_its_line(tmp_path: Path) -> None:
    capture = tmp_path / "capture.txt"
    capture.write_text("> 3F\n< 2G\n")
    with pytest.raises(CompdError, match=r"capture.txt:2"):
        read_capture(capture)
    capture.write_text("> 3F\n> 40\n")
    with pytest.raises(CompdError, match="another request"):
        read_capture(capture)


def test_learn_live(scale: str) -> None:
    """The simulated display stands still: its replies do not differ, and that is said."""
    with pytest.raises(CompdError, match="too few that differ"):
        gauge(
            "learn",
            "--unit",
            "mm",
            "--port",
            scale,
            "--baud",
            "115200",
            "--format",
            "8N1",
            "--out",
            r"\x02",
            "--timeout",
            "0.1",
            "--replies",
            "3",
            given="\n\n\n",
        )


def test_driver_test_prints_every_case_and_fails_by_exit_code(tmp_path: Path) -> None:
    result = RUNNER.invoke(driver_cli.app, ["test", "heidenhain_nd28x", "--quick"])
    assert result.exit_code == 0
    assert "nothing failed" in result.output
    assert "not detectable on this wire" in result.output
    options = tmp_path / "options.yaml"
    options.write_text("unit: inch\n")
    result = RUNNER.invoke(driver_cli.app, ["test", "heidenhain_nd28x", "--quick", "--options", str(options)])
    assert result.exit_code == 0
