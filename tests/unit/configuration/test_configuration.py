"""The configuration: every error at once, each with its place and what to do."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from compd.configuration import load
from compd.configuration.hashes import hash_of
from compd.configuration.schema import json_schema
from compd.errors import ConfigurationError
from compd.lines.kinds.modbus_rtu.settings import ModbusRtuLine
from compd.lines.kinds.modbus_tcp.settings import ModbusTcpLine
from compd.lines.kinds.serial.settings import SerialLine
from compd.lines.kinds.tcp.settings import TcpLine
from compd.plugins import GAUGES
from compd.plugins import load as load_plugin
from compd_drivers.heidenhain_nd28x import HeidenhainNd28x
from tests.support.paths import ROOT

TRIPOD = ROOT / "config" / "tripod-cmm.yaml"

Edit = Callable[[str], str]


def problems_of(tmp_path: Path, edit: Edit) -> list[str]:
    """What `load` says of the tripod's configuration after `edit`."""
    text = TRIPOD.read_text()
    changed = edit(text)
    assert changed != text, "the edit must change the file"
    path = tmp_path / "machine.yaml"
    path.write_text(changed)
    with pytest.raises(ConfigurationError) as caught:
        load(path)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize("name", ["tripod-cmm", "hexapod"])
def test_shipped_machines_are_complete(name: str) -> None:
    configuration = load(ROOT / "config" / f"{name}.yaml")
    assert configuration.machine == name
    assert configuration.warnings == ()
    assert set(configuration.gauge_objects()) == set(configuration.gauges)


ND28X = "scale_1: {driver: heidenhain_nd28x, line: scale_1"
SIMPLEX = "scale_1: {driver: sylvac_optors, unit: mm, cable: simplex, line: scale_1"
SYLVAC = "scale_1: {driver: sylvac_optors, unit: mm, line: scale_1"
CASES: list[tuple[Edit, str, str]] = [
    (lambda t: t.replace("  rate_hz: 200", "  rat_hz: 200"), "loop.rat_hz: unknown key", "did you mean `rate_hz`?"),
    (lambda t: t.replace("  on_stale: hold", "  #"), "loop.on_stale: is missing", "add `on_stale:`"),
    (lambda t: t.replace("on_stale: hold", "on_stale: ignore"), "loop.on_stale", "'hold', 'fade', 'degrade' or 'stop'"),
    (lambda t: t.replace("rate_hz: 200", "rate_hz: .inf"), "loop.rate_hz", "finite"),
    (lambda t: t.replace("rate_hz: 200", "rate_hz: -1"), "loop.rate_hz", "greater than 0"),
    (lambda t: t.replace("[0, 250, 0]", "[0, 251, 0]", 1), "geometry.base", "centroid"),
    (lambda t: t.replace("gauge: frame_u.u1}", "gauge: frame_u.u2}"), "wired already", "each channel once"),
    (lambda t: t.replace("{distance: u1,", "{distance: u2,"), "distance u1 is wired 0 times", "each exactly once"),
    (lambda t: t.replace("driver: keyence_gt2_dlrs1a", "driver: kyence"), "no such driver", "keyence_gt2_dlrs1a"),
    (lambda t: t.replace("line: joints", "line: join"), "no such line", "joints"),
    (lambda t: t.replace("line: frame_u", "line: joints"), "needs a line that carries registers", "modbus_rtu"),
    (lambda t: t.replace("heads: 9", "heads: 99"), "gauges.joints.heads", "15"),
    (lambda t: t.replace("gauge: joints.9}", "gauge: joints.10}"), "no such single channel", "joints.9"),
    (lambda t: t.replace("gauge: cabinet.room,", "gauge: cabinet.t1,"), "needs a gauge in degC", "mm"),
    (lambda t: t.replace("usb-scale-2", "usb-scale-1"), "line `scale_1` has the same port", "one line per port"),
    (
        lambda t: t.replace("/dev/serial/by-id/usb-rs485", "socket://GATEWAY:502").replace("192.168.10.20", "gateway"),
        "line `frame_u` has the same port",
        "one line per port",
    ),
    (
        lambda t: t.replace("role: Rb, gauge: joints.3", "role: B, gauge: joints.3"),
        "link 1 has comparators",
        "Ra and Rb",
    ),
    (
        lambda t: t.replace("{link: 2, gauge: scale_2}", "{link: 1, gauge: scale_2}"),
        "link 2 has 0 scales",
        "exactly one",
    ),
    (lambda t: t.replace("  rate_hz: 200", "  rate_hz: 200\n  rate_hz: 100"), "given twice", "keep one"),
    (lambda t: t + "\nlooop: {}\n", "looop: unknown key", "did you mean `loop`?"),
    (lambda t: t.replace("state:\n", "stat:\n"), "section `state` is missing", "add `state:`"),
    (lambda t: t + "acquisition: {own_process: [joint]}\n", "acquisition.own_process[1]: no such line", "frame_u"),
    (lambda t: t + "acquisition: {own_process: [joints, joints]}\n", "own_process[2]: named twice", "each line once"),
    (
        lambda t: t.replace("    low_latency: true ", "    rts: true ", 1).replace(ND28X, SYLVAC),
        "gauges.scale_1: is powered from RTS, which `rts: true` of line `scale_1` sets otherwise",
        "rts: false",
    ),
    (
        lambda t: t.replace("    low_latency: true ", "    rs485: {} ", 1).replace(ND28X, SYLVAC),
        "gauges.scale_1: is powered from RTS, which `rs485` of line `scale_1` sets otherwise",
        "rts: false",
    ),
    (
        lambda t: t.replace("port: /dev/serial/by-id/usb-scale-1", "port: socket://x:1", 1).replace(ND28X, SIMPLEX),
        "gauges.scale_1.line: is asked by DTR, which a TCP connection does not have",
        "rfc2217://",
    ),
    (lambda t: t.replace("    low_latency: true ", "    rs485: {rts: 1} ", 1), "lines.scale_1.rs485.rts: unknown", ""),
    (lambda t: t + "acquisition: {own_proces: [joints]}\n", "unknown key", "did you mean `own_process`?"),
    (lambda t: t + "acquisition: {memory_mb: 0}\n", "acquisition.memory_mb", "32 or more"),
]


@pytest.mark.parametrize(("edit", "where", "help_text"), CASES, ids=[case[1] for case in CASES])
def test_each_mistake_is_named_with_a_way_out(tmp_path: Path, edit: Edit, where: str, help_text: str) -> None:
    matching = [text for text in problems_of(tmp_path, edit) if where in text]
    assert matching, "the mistake is not reported"
    assert any(help_text in text for text in matching), matching


def test_all_mistakes_come_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    def edit(text: str) -> str:
        text = text.replace("zero_tip_M_mm: [0, 0, 190]", "zero_tip_M_mm: [0, 0]")
        text = text.replace("baud: 115200", "baud: fast")
        text = text.replace("heads: 9", "heds: 9")
        text = text.replace("on_stale: hold", "on_stale: maybe")
        return text.replace("correction_mm: 0.2", "correction_mm: 0")

    messages = problems_of(tmp_path, edit)
    for key in ("tool.zero_tip_M_mm", "lines.frame_u.baud", "heds", "loop.on_stale", "limits.correction_mm"):
        assert any(key in text for text in messages), (key, messages)
    numbers = [int(text.split(" ")[0].rsplit(":", 1)[1]) for text in messages]
    assert numbers == sorted(numbers)


def test_the_named_line_is_where_the_key_stands(tmp_path: Path) -> None:
    (text,) = problems_of(tmp_path, lambda t: t.replace("on_stale: hold", "on_stale: maybe"))
    line = int(text.split(" ")[0].rsplit(":", 1)[1])
    assert "on_stale: maybe" in (tmp_path / "machine.yaml").read_text().splitlines()[line - 1]


@pytest.mark.parametrize("text", ["", "- a\n- b\n", "loop: [1, 2\n", "loop:\n\trate_hz: 1\n"])
def test_a_file_that_is_no_configuration(tmp_path: Path, text: str) -> None:
    path = tmp_path / "machine.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=r"machine\.yaml"):
        load(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nowhere\.yaml"):
        load(tmp_path / "nowhere.yaml")


def test_nine_addressed_gauges_are_one_entry_and_a_list(tmp_path: Path) -> None:
    """By a merge key: the first entry is written out, the others say what is different."""
    first = """  c1: &comparator
    driver: modbus
    line: frame_u
    unit: 1
    channels: [{name: value, function: 4, address: 0, type: int16, scale: 0.0001, unit: mm, lowest: -1, highest: 1}]
"""
    others = "".join(f"  c{k}: {{<<: *comparator, unit: {k}}}\n" for k in range(2, 10))
    path = tmp_path / "machine.yaml"
    path.write_text(TRIPOD.read_text().replace("gauges:\n", f"gauges:\n{first}{others}", 1))
    gauges: Any = load(path).gauges
    assert [gauges[f"c{k}"].unit for k in range(1, 10)] == list(range(1, 10))
    assert {gauges[f"c{k}"].channels[0].scale for k in range(1, 10)} == {1e-4}


def test_a_serial_format_is_a_word_and_an_exponent_a_number(tmp_path: Path) -> None:
    path = tmp_path / "machine.yaml"
    path.write_text(TRIPOD.read_text().replace('"7E2"', "7E2").replace("valid_for_s: 0.1", "valid_for_s: 1e-1"))
    configuration = load(path)
    assert configuration.lines["scale_1"].format == "7E2"  # type: ignore[union-attr]
    assert configuration.sockets.valid_for_s == 0.1


def test_hashes_follow_what_they_stand_for(tmp_path: Path) -> None:
    path = tmp_path / "machine.yaml"
    first = load(TRIPOD)
    path.write_text(TRIPOD.read_text().replace("usb-scale-2", "usb-scale-9"))
    moved = load(path)
    assert moved.zero_hash == first.zero_hash, "another port does not change machine zero"
    assert moved.config_hash != first.config_hash
    path.write_text(TRIPOD.read_text().replace("zero_tip_M_mm: [0, 0, 190]", "zero_tip_M_mm: [0, 0, 191]"))
    assert load(path).zero_hash != first.zero_hash


# What these drivers' sample options, and plain lines, gave before the keys that have come since.
FORMER_HASHES = {
    "adam_4017p": "3ed870fe739b7946",
    "heidenhain_nd28x": "b34286aff1bfdf39",
    "icpdas_m7017c": "d3f5d0764f18d6e5",
    "keyence_dlen1": "0860e25cfa78c159",
    "keyence_gt2_dlrs1a": "37090a4e118d798d",
    "mahr_c1202": "f821897c5b1592d2",
    "microepsilon_msc7": "897bc1b99b0561bd",
    "modbus": "35d493c8ff93e54c",
    "moxa_e1240": "ba4e6c27765b220e",
    "r4dcb08": "c2e5d7b7d4e42b05",
    "serial_ascii": "7f7fe85c9e2cc9b1",
    "serial_frame": "07c1d6c91634a587",
    "sylvac_optors": "892952aec8a8d994",
    "tesa_tt80": "e12f38ef40f38f10",
}
PORT = {"port": "/dev/x", "baud": 9600, "format": "8N1", "timeout_s": 0.1}
PLAIN_LINES = {
    "a": SerialLine(kind="serial", **PORT),  # type: ignore[arg-type]
    "b": ModbusRtuLine(kind="modbus_rtu", **{**PORT, "port": "/dev/y"}),  # type: ignore[arg-type]
    "c": TcpLine(kind="tcp", host="h", port=1, timeout_s=0.1),
    "d": ModbusTcpLine(kind="modbus_tcp", host="h", timeout_s=0.1),
}


@pytest.mark.parametrize("driver", FORMER_HASHES)
def test_keys_that_are_left_out_change_no_hash(driver: str) -> None:
    """Machine zero and recordings name it: a new key with a default must not make them invalid."""
    kind = load_plugin(GAUGES, driver, driver)
    options = kind.Options.model_validate({"driver": driver, "line": "l", **(kind.sample_options or {})})
    assert hash_of(SimpleNamespace(gauges={"g": options}), ("gauges",)) == FORMER_HASHES[driver]
    assert hash_of(SimpleNamespace(lines=PLAIN_LINES), ("lines",)) == "25423cdb9d7fe15f"


def test_lines_get_processes_of_their_own_only_where_the_file_says_so(tmp_path: Path) -> None:
    path = tmp_path / "machine.yaml"
    first = load(TRIPOD)
    assert first.acquisition.own_process == ()
    path.write_text(TRIPOD.read_text() + "acquisition: {own_process: [joints], memory_mb: 256}\n")
    changed = load(path)
    assert (changed.acquisition.own_process, changed.acquisition.memory_mb) == (("joints",), 256)
    assert changed.config_hash != first.config_hash
    assert (changed.zero_hash, changed.geometry_hash) == (first.zero_hash, first.geometry_hash)
    path.write_text(TRIPOD.read_text() + "acquisition: {memory_mb: 512}\n")
    assert load(path).config_hash == first.config_hash, "what is written is the default"


def test_the_hash_of_a_file_without_optional_sections_and_keys_is_that_of_older_releases(tmp_path: Path) -> None:
    path = tmp_path / "tripod-cmm.yaml"
    later = (
        r",? *(acceleration_mm_per_s2: \d+|noise_um: [\d.]+|noise: [\d.]+|(lowest|highest): -?\d+|tip_error_um: \d+)"
    )
    path.write_text(re.sub(later, "", TRIPOD.read_text()))
    assert load(path).config_hash == "3ec53557c9b90938", "recordings and controllers have it"


def test_lines_with_a_mistake_of_their_own_are_still_lines_to_name(tmp_path: Path) -> None:
    def edit(text: str) -> str:
        return text.replace("baud: 115200", "baud: fast") + "acquisition: {own_process: [frame_u, dial]}\n"

    baud, dial = problems_of(tmp_path, edit)
    assert "lines.frame_u.baud" in baud
    assert "own_process[2]: no such line" in dial


OWN_DRIVER = "from compd_drivers.heidenhain_nd28x import HeidenhainNd28x as Mine\n"


@pytest.mark.parametrize(
    ("acquisition", "warned"),
    [
        ("", True),
        ("acquisition: {own_process: [scale_2]}\n", True),
        ("acquisition: {own_process: [scale_1]}\n", False),
        ("acquisition: {own_process: [scale_2, scale_3, joints, frame_u, cabinet]}\n", False),
    ],
    ids=["none", "another's", "its own", "alone in the shared one"],
)
def test_a_driver_from_elsewhere_that_shares_a_process_is_warned_of(
    tmp_path: Path, acquisition: str, warned: bool
) -> None:
    driver = tmp_path / "mine.py"
    driver.write_text(OWN_DRIVER)
    driver.chmod(0o644)
    path = tmp_path / "machine.yaml"
    text = TRIPOD.read_text().replace("scale_1: {driver: heidenhain_nd28x", f"scale_1: {{driver: '{driver}:Mine'")
    path.write_text(text + acquisition)
    warnings = [str(warning) for warning in load(path).warnings]
    assert bool(warnings) == warned
    for warning in warnings:
        assert "gauges.scale_1.driver: this driver is not part of compd" in warning
        assert "write `scale_1` under `acquisition: own_process:`" in warning


def test_a_driver_of_another_package_is_warned_of_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Theirs(HeidenhainNd28x):
        """What an entry point of another distribution would bring."""

    def theirs(group: str, name: str, where: str) -> type:
        return Theirs if where.endswith("gauges.scale_2.driver") else load_plugin(group, name, where)

    monkeypatch.setattr("compd.configuration.machine_configuration.load_plugin", theirs)
    (warning,) = load(TRIPOD).warnings
    assert "gauges.scale_2.driver" in str(warning)


def test_a_driver_in_a_file_must_not_be_writable_by_others(tmp_path: Path) -> None:
    driver = tmp_path / "mine.py"
    driver.write_text(OWN_DRIVER)
    path = tmp_path / "machine.yaml"
    path.write_text(
        TRIPOD.read_text().replace("scale_1: {driver: heidenhain_nd28x", f"scale_1: {{driver: '{driver}:Mine'")
    )
    driver.chmod(0o666)
    with pytest.raises(ConfigurationError, match="may be written by group or others"):
        load(path)
    driver.chmod(0o644)
    assert load(path).drivers["scale_1"].__name__ == "HeidenhainNd28x"


def test_the_schema_names_every_key_that_the_shipped_files_use() -> None:
    document = json_schema()
    json.dumps(document)
    data = yaml.safe_load(TRIPOD.read_text())
    assert set(data) <= set(document["properties"])
    assert document["additionalProperties"] is False
    needed = {*document["required"], "gauges", *document["dependentRequired"]["gauges"]}
    assert needed == set(data), "what the shipped files leave out is optional"
    assert "own_process" in document["properties"]["acquisition"]["properties"]
    drivers = [
        option["properties"]["driver"].get("const")
        for option in document["properties"]["gauges"]["additionalProperties"]["oneOf"]
    ]
    assert {"heidenhain_nd28x", "keyence_gt2_dlrs1a", "modbus"} <= set(drivers)
