"""The generated pages of the reference hold everything that the code has, each with a description."""

from __future__ import annotations

import doctest
import re
import struct
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from compd.calibration.criteria import CalibrationCriteria
from compd.columns import COLUMN_KINDS, parse_name
from compd.comparison import ComparisonCriteria
from compd.configuration import SECTIONS, json_schema
from compd.diagnosis import Criteria
from compd.fleet.criteria import FleetCriteria
from compd.gauge import Quality
from compd.live.loop import Setpoint
from compd.live.loop.packet_layout import PACKET_BODY, PACKET_FIELDS, PACKET_SIZE
from compd.live.service.messages import ErrorCode
from compd.live.service.requests import REQUESTS, SENT_MESSAGES
from compd.model.effects.effect_needs import NEEDS
from compd.model.formula import FUNCTIONS
from compd.model.formula.declaration import FormulaDeclaration, FormulaParameter
from compd.model.library import BUNDLED
from compd.model_file import ModelStep
from compd.model_file.model_document import EffectEntry, ModelDocument, ParameterEntry
from compd.plugins import GAUGES, load, names
from compd.recording import SECTIONS as SIDECAR
from compd.recording.checks import LIMITS
from compd.recording.reference import Reference
from compd.recording.sidecar import Exclusion
from compd.setpoint_states import Mode, State
from compd.threshold import Threshold, thresholds
from docs.generate import __main__ as generate
from docs.generate.command_entries import CommandEntry, entries
from docs.generate.live_examples import Exchange
from docs.generate.protocol import c_struct, packet_rows
from docs.generate.schema import ModelSchema, key_unit
from tests.support.paths import ROOT

MAX_TABLE = 4
MESSAGES = [*REQUESTS.values(), *SENT_MESSAGES.values()]
FILES = [ModelDocument, EffectEntry, ParameterEntry, ModelStep, FormulaDeclaration, FormulaParameter]
THRESHOLDS = [
    (name, field)
    for kind in (Criteria, ComparisonCriteria, FleetCriteria, CalibrationCriteria)
    for name, field in thresholds(kind).items()
]


def example(name: str) -> Exchange:
    """In place of one from a running daemon: tests/system has the wires."""
    return Exchange({"class": name}, ({"class": name},))


@pytest.fixture(scope="module", autouse=True)
def _no_daemon() -> Any:
    """The examples of the protocol come from a daemon, which these tests need not start."""
    patch = pytest.MonkeyPatch()
    examples = {name: example(name) for name in ("greeting", *REQUESTS, *SENT_MESSAGES)}
    patch.setattr("docs.generate.protocol.exchanges", lambda: examples)
    yield
    patch.undo()
    page.cache_clear()


@cache
def page(name: str) -> str:
    return generate.page_of(name)


def described(kind: Any) -> dict[str, str]:
    """Every key of a model and of the models in it, "model.key", with its description."""
    schema = ModelSchema(kind)
    inside = [name for name, definition in schema.definitions.items() if "properties" in definition]
    return {f"{name}.{key.name}": key.meaning for name in ["", *inside] for key in schema.keys(name)}


def without_examples(name: str, text: str) -> str:
    """The page; that of the protocol without what a daemon and its clients said."""
    examples = r"(?:^(?:For example(?:, a client sends|:)|and the daemon)\n\n)?^```json\n.*?^```\n\n*"
    return re.sub(examples, "", text, flags=re.MULTILINE | re.DOTALL) if name == generate.PROTOCOL else text


@pytest.mark.parametrize("name", generate.page_names())
def test_the_page_in_the_checkout_is_as_the_code_makes_it(name: str) -> None:
    kept = generate.file_of(name).read_text(encoding="utf-8")
    same = without_examples(name, kept) == without_examples(name, page(name))
    assert same, f"{generate.file_of(name)} is of other code: run `.venv/bin/python -m docs.generate`"


def test_other_values_of_a_daemon_are_no_other_page_and_another_key_is() -> None:
    said = '{"time_s": 14178.235854, "mm": [-1e-07], "path": "/tmp/compd-x/a", "config_hash": "695e2a839c7df9ce"}'
    later = '{"time_s": 9.2, "mm": [2.96e-05], "path": "/tmp/compd-ab_/a", "config_hash": "222dfbd8e56afdc8"}'
    assert generate.without_values(said) == generate.without_values(later)
    assert generate.without_values(said) != generate.without_values(later.replace("time_s", "at_s"))


@pytest.mark.parametrize("name", generate.page_names())
def test_a_page_has_a_title_and_tables_of_few_columns(name: str) -> None:
    text = page(name)
    assert text.startswith("# ")
    rows = [line for line in text.split("\n") if line.startswith("| ")]
    assert max((len(re.findall(r"(?<!\\)\|", row)) - 1 for row in rows), default=0) <= MAX_TABLE


@pytest.mark.parametrize("name", generate.page_names())
def test_no_cell_of_a_page_is_empty(name: str) -> None:
    assert not re.search(r"\| *\|", page(name), re.MULTILINE)


def test_targets_are_unique() -> None:
    targets = [
        target for name in generate.page_names() for target in re.findall(r"^\((\S+)\)=$", page(name), re.MULTILINE)
    ]
    assert sorted(set(targets)) == sorted(targets)


@pytest.mark.parametrize("name", generate.page_names())
def test_every_target_that_a_page_names_is_there(name: str) -> None:
    there = {
        target for other in generate.page_names() for target in re.findall(r"^\((\S+)\)=$", page(other), re.MULTILINE)
    }
    assert set(re.findall(r"\]\(#([^)]+)\)", page(name))) <= there


def test_every_page_is_in_the_index() -> None:
    index = (generate.REFERENCE / "index.md").read_text(encoding="utf-8")
    missing = [name for name in generate.page_names() if f"\n{name.replace('_', '-')}\n" not in index]
    assert missing == []


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_every_message_and_key_of_the_protocol(kind: Any) -> None:
    assert f"### `{kind.wire_name}`\n" in page("protocol")
    for name, meaning in described(kind).items():
        assert meaning, name
        assert f"| `{name.rpartition('.')[2]}` |" in page("protocol")


@pytest.mark.parametrize("kind", [*ErrorCode, *Mode, *Quality, *State])
def test_every_code_is_on_its_page_with_its_meaning(kind: Any) -> None:
    text = page({ErrorCode: "protocol", Mode: "protocol", Quality: "gauges", State: "states"}[type(kind)])
    row = next(line for line in text.split("\n") if line.startswith(f"| `{kind}` |"))
    assert kind.text
    assert row.count("|") >= 3


def test_the_packet_of_a_setpoint_by_the_offsets_of_the_page() -> None:
    packet = Setpoint(7, 2.5, 3.5, 0.25, State.OK, "", Mode.MACHINE_TOOL, None).to_packet(b"12345678")
    types = {"bytes": "s", "uint8": "B", "uint16": "H", "uint32": "I", "uint64": "Q", "int64": "q", "float64": "d"}
    read = {}
    for offset, kind, name, _ in packet_rows():
        count, _, letter = kind.rpartition(" ")
        read[name.strip("`")] = struct.unpack_from(f"<{count}{types[letter]}", packet, int(offset))
    assert (read["magic"], read["size"], read["seq"]) == ((b"CMPD",), (PACKET_SIZE,), (7,))
    assert (read["time_s"], read["valid_until_s"], read["age_s"]) == ((2.5,), (3.5,), (0.25,))
    assert (read["state"], read["mode"], read["flags"]) == ((State.OK.code,), (Mode.MACHINE_TOOL.code,), (0,))
    assert read["config_hash"] == (b"12345678",)
    assert read["target_id"] == (-1,)
    assert len(packet) == PACKET_SIZE == sum(field.size for field in PACKET_FIELDS)


def test_the_packet_is_packed_without_padding() -> None:
    formats = "".join(field.format for field in PACKET_BODY)
    assert struct.calcsize("<" + formats) == sum(field.size for field in PACKET_BODY)
    assert all(field.meaning for field in PACKET_FIELDS)


def test_the_structure_in_c_has_every_field_in_order() -> None:
    members = re.findall(r"(\w+)(?:\[\d+\])?;", c_struct())
    assert members == [field.name for field in PACKET_FIELDS]


def test_the_guide_to_controllers_shows_this_structure() -> None:
    assert c_struct() in (ROOT / "docs" / "how-to" / "connect-a-controller.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_of_the_configuration(section: str) -> None:
    assert f"## `{section}`\n" in page("configuration")
    for name, meaning in described(SECTIONS[section]).items():
        assert meaning, name
        assert f"| `{name.rpartition('.')[2]}` |" in page("configuration")


def test_every_key_of_the_schema_for_editors_has_a_description() -> None:
    schema = json_schema()
    models = {"": schema, **schema["$defs"]}
    empty = [
        f"{model}.{key}"
        for model, part in models.items()
        for key, value in part.get("properties", {}).items()
        if not (value.get("description") or "$ref" in value)
    ]
    assert empty == []


@pytest.mark.parametrize("name", names(GAUGES))
def test_every_driver_with_its_options(name: str) -> None:
    text = page("gauges")
    assert f"### `{name}`\n" in text
    for option, meaning in described(load(GAUGES, name, name).Options).items():
        assert meaning, option
        assert f"| `{option.rpartition('.')[2]}` |" in text


@pytest.mark.parametrize("effect", BUNDLED, ids=lambda effect: effect.id)
def test_every_effect(effect: Any) -> None:
    text = page("effects").partition(f"### `{effect.id}`\n")[2].partition("\n### ")[0]
    assert effect.equation in text
    assert all(f"`{symbol}`: " in text for symbol in effect.symbols)
    assert all(f"| `{part.name}` |" in text for part in (*effect.parameters, *effect.constants))
    assert all(f"[`{other}`]" in text for other in effect.mistaken_for)


def test_every_word_that_an_effect_may_need_has_a_meaning() -> None:
    words = {need for effect in BUNDLED for need in effect.needs}
    quantities = {need for need in words if parse_name(need.replace("{link}", "1").replace("{scale}", "1"))}
    assert words - quantities <= set(NEEDS)


@pytest.mark.parametrize("entry", entries(), ids=lambda entry: entry.name)
def test_every_command_with_its_options(entry: CommandEntry) -> None:
    text = page("commands").partition(f"### `{entry.name}`\n")[2].partition("\n### ")[0]
    assert entry.command.help
    for parameter in entry.command.params:
        if parameter.name != "help":
            assert parameter.help, parameter.name
            shown = parameter.opts[0] if parameter.param_type_name == "option" else parameter.metavar or parameter.name
            assert shown.strip("[]").upper() in text.upper()


@pytest.mark.parametrize(("name", "threshold"), THRESHOLDS, ids=[name for name, _ in THRESHOLDS])
def test_every_criterion(name: str, threshold: Threshold) -> None:
    row = next(line for line in page("criteria").split("\n") if line.startswith(f"| `{name}`<br>"))
    values = threshold.default if isinstance(threshold.default, tuple) else (threshold.default,)
    assert "<br>" + ", ".join(f"{value:g}" for value in values) in row


def test_the_code_of_the_criteria_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs as it stands, and other criteria change the verdict as it says."""
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```pycon\n(.*?)```", page("criteria"), re.DOTALL)
    examples = doctest.DocTestParser().get_doctest(code, {}, "criteria", None, None)
    failed, tried = doctest.DocTestRunner().run(examples)
    assert (failed, tried) == (0, len(examples.examples))
    assert tried > 6


@pytest.mark.parametrize("kind", COLUMN_KINDS, ids=lambda kind: kind.names)
def test_every_column_of_a_recording(kind: Any) -> None:
    assert kind.meaning
    for name in kind.names.split(", "):
        assert f"`{name}`" in page("recording")
        column = parse_name(re.sub(r"<[ik]>", "1", name).replace("<place>", "room").replace("<name>", "arm"))
        assert column is not None
        assert column.unit == kind.unit


@pytest.mark.parametrize("kind", [Reference, Exclusion])
def test_every_key_of_a_sidecar(kind: Any) -> None:
    for name, meaning in {**described(kind), **dict.fromkeys(SIDECAR, "a section")}.items():
        assert meaning, name
        assert f"| `{name.rpartition('.')[2]}` |" in page("recording")
    assert all(ModelSchema(section).schema["description"] for section in SIDECAR.values())


def test_every_limit_of_a_recording() -> None:
    assert all(f"| {limit.low:g} to {limit.high:g} |" in page("recording") for limit in LIMITS)


@pytest.mark.parametrize("kind", FILES, ids=lambda kind: kind.__name__)
def test_every_key_of_the_model_file_and_of_a_formula(kind: Any) -> None:
    for name, meaning in described(kind).items():
        assert meaning, name
        assert f"| `{name.rpartition('.')[2]}` |" in page("model_file")


def test_every_function_of_a_formula() -> None:
    assert all(f"| `{function.call}` |" in page("model_file") for function in FUNCTIONS.values())
    assert all(function.call.startswith(f"{name}(") for name, function in FUNCTIONS.items())


def test_a_key_shows_the_unit_in_which_its_name_ends() -> None:
    assert (key_unit("weight_N"), key_unit("slew_mm_per_s"), key_unit("rate_hz")) == ("N", "mm/s", "Hz")
    assert (key_unit("supports_B_mm"), key_unit("support_of_joint"), key_unit("low_latency")) == ("mm", "", "")


def test_a_class_that_holds_a_part_of_a_message_describes_its_keys() -> None:
    keys = described(SENT_MESSAGES["READINGS"])
    assert keys["Target.tip_by_scale"].startswith("with `machine: external`, 3 or 6 rows of n numbers")
    assert keys["ReadingMotion.late_s"].endswith("the device may have sampled, s")
    assert ModelSchema(SENT_MESSAGES["READINGS"]).definitions["Target"]["description"].count("\n") == 0
