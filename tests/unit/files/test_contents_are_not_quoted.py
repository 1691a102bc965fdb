"""Every reader of a file, given some other file: nothing of it is in an error, on the terminal or in the log."""

from __future__ import annotations

import io
import json
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
import structlog
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.problems import print_problems
from compd.configuration import load
from compd.errors import CompdError
from compd.fleet import find_recordings
from compd.gauge_description import read_capture
from compd.gauge_tools import gauge_of_file
from compd.instruments import ReadOptions, instrument_formats, preview_export, read_export
from compd.lines import PortArguments
from compd.lines.kinds.mqtt.subscriber import tls_context
from compd.lines.kinds.opc_ua.login import _certificate, _private_key
from compd.live.machine import load_zero
from compd.live.machine.machine_zero import FILE_NAME as ZERO_NAME
from compd.live.memory import TrustMemory
from compd.live.record import RecordedCycles
from compd.live.record.replay import CYCLES_SUFFIX
from compd.live.service import LastReadings
from compd.live.service.last_readings import FILE_NAME as LAST_NAME
from compd.live.service.request_context import read_token
from compd.live.system import THIS_COMPUTER
from compd.model.library import load_effects
from compd.model_file import read_stored
from compd.model_file.model_document import read_document as read_model_document
from compd.page import read_tokens
from compd.page.workbench.own_effects import entries_of
from compd.plan_file import read_plan_file
from compd.recording import OpenPart, exclude_rows, read_recording, read_sidecar
from compd.recording.ball_plate import read_plate
from compd_drivers.preset_directory import PresetDirectory
from tests.support.paths import CONFIG
from tests.support.sampled import sampled

# No part of it, six characters long, is a word.
SECRET = "Zq7vK2xW9pLm4TnB"
PARTS = [SECRET[i : i + 6].lower() for i in range(len(SECRET) - 5)]

CONTENTS: dict[str, bytes] = {
    name: text if isinstance(text, bytes) else text.encode()
    for name, text in {
        "shadow": f"root:$6$salt${SECRET}:20228:0:99999:7:::\ndaemon:*:20228:0:99999:7:::\n{SECRET}:!:20228::::::\n",
        "private key": f"-----BEGIN PRIVATE KEY-----\n{SECRET}{SECRET}\n{SECRET}\n-----END PRIVATE KEY-----\n",
        "certificate": f"-----BEGIN CERTIFICATE-----\n{SECRET}{SECRET}\n-----END CERTIFICATE-----\n",
        "log of key: value": f"level: info\nevent: a client\ntoken: {SECRET}\nurl: http://10.0.0.5/?token={SECRET}\n",
        "log of lines": f"2026-11-25 21:00:01 INFO client 10.0.0.5 token={SECRET} 12\n" * 3 + f"short {SECRET}\n",
        "log in columns": f"12 login {SECRET} anna\n" * 5 + f"{SECRET}\n",
        ".env": f"API_TOKEN={SECRET}\nDB_PASSWORD='{SECRET}'\nexport X={SECRET}\n",
        "JSON": json.dumps({"token": SECRET, "list": [SECRET, {SECRET: SECRET}], SECRET: 1}, indent=1),
        "JSON in one line": json.dumps({"class": SECRET, "password": SECRET}) + "\n",
        "JSON list": json.dumps([{"user": "anna", "password": SECRET}, SECRET]),
        "JSON text": json.dumps(SECRET),
        "TOML": f'[server]\ntoken = "{SECRET}"\n[{SECRET}]\nport = 1\n',
        "base64": f"{SECRET}{SECRET}{SECRET}==\n",
        "a word": SECRET,
        "two words": f"{SECRET} {SECRET}\n",
        "YAML tag": f"machine: !{SECRET} {SECRET}\n",
        "YAML tag of the whole": f"!{SECRET}\n- {SECRET}\n",
        "YAML tag with a handle": f"!{SECRET}!x {SECRET}\n",
        "YAML alias": f"a: *{SECRET}\n",
        "YAML alias in itself": f"a: &{SECRET} [*{SECRET}]\n",
        "YAML keys twice": f"{SECRET}: 1\n{SECRET}: 2\n",
        "YAML list as key": f"[{SECRET}]: {SECRET}\n",
        "YAML of the wrong type": f"a: !!int {SECRET}\n",
        "YAML merge": f"<<: {SECRET}\n",
        "YAML list": f"- {SECRET}\n- user: anna\n  password: {SECRET}\n",
        "YAML cut off": f'a: "{SECRET}\n',
        "YAML with a known word": f"machine: {SECRET}\npassword: {SECRET}\n{SECRET}: 1\n",
        "YAML of effects with a password": f"effects:\n- password: {SECRET}\n",
        "YAML with a format": f"format: 99\nrelease: {SECRET}\n",
        "CSV of passwords": f"name,password\nanna,{SECRET}\nbert,{SECRET}\n",
        "CSV of passwords, semicolons": f"{SECRET};password\nanna;{SECRET}\n",
        "CSV with quotes": f'"{SECRET}\n',
        "Python": f"raise ValueError('{SECRET}')\n",
        "Python name": f"{SECRET}\n",
        "Python encoding": f"# coding: {SECRET}\n",
        "latin-1": f"\xe9 {SECRET}\n".encode("latin-1"),
        "UTF-16": SECRET.encode("utf-16"),
        "NUL": f"{SECRET}\0{SECRET}\n",
        "binary": bytes(range(256)) + SECRET.encode() + bytes(range(128, 256)),
        "zip": b"PK\x03\x04" + SECRET.encode() * 9,
        "Parquet": b"PAR1" + SECRET.encode() * 9 + b"PAR1",
        "CARTO": f"HEADER::{SECRET}\r\n{SECRET}: {SECRET}\r\n".encode(),
        "empty": b"",
    }.items()
}


class Reader(NamedTuple):
    """A reader of a file : what a file of its kind is called, and what reads it."""

    file_name: str
    read: Callable[[Path], object]


def _problems(read: Callable[[Path, list], object]) -> Callable[[Path], object]:
    """A reader that collects its problems: they are raised."""

    def raising(path: Path) -> None:
        problems: list = []
        read(path, problems)
        if problems:
            raise CompdError(problems)

    return raising


def _recording(path: Path) -> object:
    path.with_suffix(".yaml").write_text("machine: tripod-cmm\nreference: {quantity: tool_position, frame: machine}\n")
    return read_recording(path)


def _without_table(read: Callable[[Path], object]) -> Callable[[Path], object]:
    def beside_a_table(path: Path) -> object:
        path.with_suffix(".csv").write_text("time_s\n0\n1\n")
        return read(path)

    return beside_a_table


def _export(shape: str | None) -> Callable[[Path], object]:
    return lambda path: read_export(path, ReadOptions(shape=shape))


def _last_readings(path: Path) -> None:
    memory = TrustMemory(["scale_1.position"], [0.001])
    LastReadings(path.parent, "", memory, THIS_COMPUTER).recall()


def _private(read: Callable[[Path], object]) -> Callable[[Path], object]:
    def own(path: Path) -> object:
        path.chmod(0o600)
        return read(path)

    return own


def _tls(key: str) -> Callable[[Path], object]:
    class Settings:
        ca_file = certificate = private_key = None

    def context(path: Path) -> object:
        files = Settings()
        setattr(files, key, str(path))
        if key != "ca_file":
            files.certificate = files.private_key = str(path)
        return tls_context(files)

    return context


READERS: dict[str, Reader] = {
    "configuration": Reader("machine.yaml", load),
    "model file": Reader("x.model.yaml", read_stored),
    "model file, by its content": Reader("x.yaml", lambda path: read_model_document(path, path.read_bytes())),
    "effects": Reader("effects.yaml", load_effects),
    "effects in Python": Reader("effects.py", load_effects),
    "effects of the page": Reader("own.yaml", lambda path: entries_of(path.read_text("utf-8", "replace"), path)),
    "sidecar": Reader("x.yaml", _problems(read_sidecar)),
    "recording by its sidecar": Reader("x.yaml", _without_table(read_recording)),
    "rows left out": Reader("x.yaml", _without_table(lambda path: exclude_rows(path, [2], "why"))),
    "recording, CSV": Reader("x.csv", _recording),
    "recording, Parquet": Reader("x.parquet", _recording),
    "open part": Reader("x.arrow", OpenPart),
    "cycles": Reader(f"x{CYCLES_SUFFIX}", lambda path: list(RecordedCycles(path).cycles())),
    "plan": Reader("plan.csv", _problems(lambda path, problems: read_plan_file(path, 3, {}, problems))),
    "ball plate": Reader("plate.csv", _problems(read_plate)),
    "machine zero": Reader(ZERO_NAME, lambda path: load_zero(path.parent, "", ("scale_1.position",), THIS_COMPUTER)),
    "last readings": Reader(LAST_NAME, _last_readings),
    "export": Reader("export.txt", _export(None)),
    **{f"export as {shape}": Reader("export.txt", _export(shape)) for shape in instrument_formats()},
    "export before it is joined": Reader("export.txt", lambda path: preview_export(path, ReadOptions())),
    "preset": Reader("mine.yaml", lambda path: PresetDirectory(path.parent).driver("mine")),
    "gauges": Reader("gauges.yaml", lambda path: gauge_of_file(path, None, PortArguments("", None, None, 1.0))),
    "capture": Reader("capture.txt", read_capture),
    "tokens": Reader("tokens.yaml", _private(read_tokens)),
    "token of the TCP port": Reader("token", _private(read_token)),
    "certificate": Reader("own.pem", lambda path: _certificate("certificate", str(path))),
    "private key": Reader("own.key", lambda path: _private_key(str(path))),
    "certificate of an authority": Reader("ca.pem", _tls("ca_file")),
    "certificate for a broker": Reader("own.pem", _tls("certificate")),
    "fleet": Reader("x.yaml", lambda path: find_recordings([path.parent])),
}
# What may be raised of a file of a line; its words reach the log as the reason of a lost line.
EXPECTED = (CompdError, ValueError, OSError)


def said(reader: Reader, directory: Path, content: bytes) -> str:
    """What the reader says of the content: the error with its causes, what the terminal shows of it, and the log."""
    path = directory / reader.file_name
    path.write_bytes(content)
    words = []
    with structlog.testing.capture_logs() as logged:
        try:
            reader.read(path)
        except EXPECTED as error:
            words += [str(error), *traceback.format_exception_only(error)]
            words += [str(problem) for problem in getattr(error, "problems", ())]
    return "\n".join([*words, *map(str, logged)])


def assert_quotes_nothing(text: str) -> None:
    lower = text.lower()
    assert not [part for part in PARTS if part in lower], text


@pytest.mark.parametrize("name", READERS)
def test_nothing_of_another_file_is_quoted(name: str, tmp_path: Path) -> None:
    for number, content in enumerate(CONTENTS.values()):
        (directory := tmp_path / str(number)).mkdir()
        assert_quotes_nothing(said(READERS[name], directory, content))


TRIPOD = str(CONFIG / "tripod-cmm.yaml")
# FILE stands for the path of the file that is another one.
COMMANDS: dict[str, tuple[str, list[str]]] = {
    "check": ("machine.yaml", ["check", "FILE"]),
    "run": ("machine.yaml", ["run", "FILE"]),
    "page": ("machine.yaml", ["page", "--daemon", "FILE"]),
    "page --tokens": ("tokens.yaml", ["page", "--tokens", "FILE", "--listen", "127.0.0.1"]),
    "page --new-token": ("tokens.yaml", ["page", "--tokens", "FILE", "--new-token", "view:anna"]),
    "compare": ("run.csv", ["compare", "FILE", "--machine", TRIPOD]),
    "model remove": ("x.model.yaml", ["model", "remove", "link_sag", "--model", "FILE"]),
    "diagnose --effects": ("own.yaml", ["diagnose", "none.csv", "--effects", "FILE"]),
    "model effect": ("own.yaml", ["model", "effect", "FILE"]),
    "model ledger": ("x.model.yaml", ["model", "ledger", "FILE"]),
    "recording check": ("run.csv", ["recording", "check", "FILE"]),
    "recording join": ("export.txt", ["recording", "join", "none.csv", "FILE"]),
    "gauge test-driver --options": ("options.yaml", ["gauge", "test-driver", "serial_ascii", "--options", "FILE"]),
    "sim campaign --plan": ("plan.csv", ["sim", "campaign", TRIPOD, "--plan", "FILE", "--out", "out.csv"]),
}


@pytest.mark.parametrize(
    "content", sampled(["shadow", "log of key: value", "private key", ".env", "JSON", "YAML tag", "binary"], 4)
)
@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_prints_anything_of_another_file(name: str, content: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    file_name, words = COMMANDS[name]
    path = tmp_path / file_name
    path.write_bytes(CONTENTS[content])
    path.chmod(0o600)
    result = CliRunner().invoke(app, [str(path) if word == "FILE" else word for word in words])
    assert result.exit_code != 0, result.output
    assert isinstance(result.exception, CompdError | SystemExit), result.exception
    printed = io.StringIO()
    print_problems(getattr(result.exception, "problems", ()), stream=printed)
    assert_quotes_nothing(result.output + printed.getvalue() + str(result.exception))


@settings(max_examples=50, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(sorted(READERS)),
    pieces=st.lists(
        st.sampled_from([SECRET, "\n", ": ", "- ", "  ", *"{}[],;\t\"'!=#", "&a ", "*a", "<<", "1.5"]),
        max_size=30,
    ),
)
def test_nothing_of_a_file_of_any_form_is_quoted(name: str, pieces: list[str], tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=tmp_path) as directory:
        assert_quotes_nothing(said(READERS[name], Path(directory), "".join(pieces).encode()))
