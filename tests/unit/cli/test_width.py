"""At 80 columns every name that a person copies is whole, and no number is cut."""

from __future__ import annotations

import pytest
from rich.console import Console
from rich.table import Table
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.reflow import reflowed
from compd.configuration import load
from compd.gauge_tools import catalogue
from compd.report import keep_words_whole
from compd.text import number_text
from tests.support.paths import CONFIG

CUT = "…"


@pytest.fixture
def printed(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")

    def run(*arguments):
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        assert result.exit_code == 0, result.output
        assert CUT not in result.output
        return result.output

    return run


def test_gauge_list_names_every_driver_whole(printed):
    words = printed("gauge", "list").split()
    assert all(entry.name in words for entry in catalogue())


def test_gauge_show_wraps_no_text_twice(printed):
    assert "what is missing" not in printed("gauge", "show", "heidenhain_nd28x")
    lines = printed("gauge", "show", "heidenhain_nd28x").splitlines()
    assert any(line.startswith("38400 baud; STX (02) asks for the displayed value") for line in lines)
    assert "no: None" not in printed("gauge", "show", "heidenhain_nd28x")


@pytest.mark.long
@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_check_names_every_line_and_cuts_no_head(printed, name):
    text = printed("check", CONFIG / name)
    assert "exchanges" in text
    assert all(f" {line} " in text for line in load(CONFIG / name).lines)


@pytest.mark.long
def test_a_ledger_has_whole_names_and_numbers(printed, tmp_path):
    recording, model, effects = tmp_path / "run.csv", tmp_path / "model.yaml", tmp_path / "mine.yaml"
    name = "expansion_of_my_platform"
    effects.write_text(
        f"id: {name}\nport: link\nformula: k * temperature_room_degC\nphysics: Grows.\n"
        "parameters: {k: {unit: um/K, plausible: [-10, 10], source: mine}}\n"
    )
    printed("sim", "campaign", CONFIG / "tripod-cmm.yaml", "--seed", "3", "--out", recording)
    assert f" {name} " in printed("model", "add", effects, "--recording", recording, "--model", model)
    text = printed("model", "ledger", model)
    assert f" {name} " in text
    assert "residuals in um" in " ".join(text.split())
    assert " run.csv " in text


@pytest.mark.parametrize("width", [80, 60, 45])
def test_a_table_breaks_sentences_and_no_word(width):
    table = Table("effect", "why it is not named", "left, um")
    table.add_row("reference_registration", "nothing more beside what is named, and this is long", "0.1700")
    console = Console(width=width)
    with console.capture() as capture:
        console.print(keep_words_whole(table, width))
    text = capture.get()
    assert all(word in text for word in ("reference_registration", "nothing", "beside", "0.1700"))
    assert all(len(line) <= width for line in text.splitlines())


def test_paragraphs_are_joined_and_lists_and_examples_are_not():
    text = "One two\nthree.\n\n    code: 1\n    more: 2\nafter\nthat\n- item\n- item"
    assert reflowed(text) == "One two three.\n\n    code: 1\n    more: 2\nafter that\n- item\n- item"


def test_numbers_side_by_side_have_the_same_figures():
    assert [number_text(value, digits=3) for value in (0.494, 0.7, 0.816)] == ["0.494", "0.700", "0.816"]
