"""The registry of formats: every list of formats follows it, and a format's reader is imported when a file is read."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.testclient import TestClient
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.export_options import Shape
from compd.cli.simulated.sim.tracker import ExportFormat
from compd.errors import CompdError
from compd.instruments import formats
from compd.instruments.export import ReadOptions
from compd.instruments.formats import instrument_formats, written_forms
from compd.instruments.instrument_format import InstrumentFormat, TextFormat, WrittenForm
from compd.instruments.read import read_export
from compd.page import Token, hashed
from compd.page.guard import Guard
from compd.page.joining.choices import read_choices
from compd.page.joining.routes import JoinRoutes
from compd.page.recordings import Recordings
from docs.generate.instrument_formats import page
from tests.support.paths import ROOT

# A format that is in no list: three columns behind a first line of its own.
ADDED = """
import numpy as np
from compd.instruments.instrument_format import TextFormat, WrittenForm
from compd.instruments.raw_table import RawTable

def read(text, options):
    columns = list(zip(*(line.split("/") for line in text.lines[1:])))
    return RawTable(text.path, "theodolite", columns, np.arange(2, len(text.lines) + 1), ("x_mm", "y_mm", "z_mm"), 1)

FORMAT = TextFormat(
    name="theodolite", title="Theodolite", file_is="a log of theodolites", finds="coordinates", ending=".log",
    read=read, mark="^THEO 1$",
    written=(WrittenForm(name="theo", title="a log", summary="slashes", write_bytes=lambda samples: b"THEO 1"),),
)
"""
# What each list shows where the folder in argv[1] has one more format.
LISTS = """
import json, sys
from pathlib import Path
from compd.instruments import formats
formats.__path__.append(sys.argv[1])
from tests.unit.instruments.test_formats import export_in, shown
print(json.dumps({**shown(), "read": export_in(Path(sys.argv[2]))}))
"""
TABLE = "THEO 1\n" + "".join(f"{k}.5/{k * k}.25/-7.5\n" for k in range(6))


def shown() -> dict[str, Any]:
    """The lists of formats: help, page, choices, documentation."""
    directory = Path("/nowhere")
    guarded = Guard(
        Starlette(routes=JoinRoutes(Recordings(directory, "/no/socket"), None, directory).routes()),
        [Token("a person", "operate", hashed("x"))],
        ["http://127.0.0.1:7760"],
        7760,
    )
    page_client = TestClient(guarded, base_url="http://127.0.0.1:7760")
    page_client.get("/", params={"token": "x"})
    environment = {"COLUMNS": "250", "TERM": "dumb"}
    return {
        "join": CliRunner().invoke(app, ["recording", "join", "--help"], env=environment).output,
        "tracker": CliRunner().invoke(app, ["sim", "tracker", "--help"], env=environment).output,
        "--as of join": list(Shape),
        "--as of tracker": list(ExportFormat),
        "page": page_client.get("/join/sources").json()["formats"],
        "chosen": [name for name in (*instrument_formats(), "theodolite", "neither") if chosen(name)],
        "docs": page(),
    }


def chosen(name: str) -> bool:
    """Whether the page may ask for the format."""
    try:
        return read_choices({"shape": name}, None, None).read.shape == name
    except CompdError:
        return False


def export_in(path: Path) -> str:
    return read_export(path, ReadOptions()).shape


def check_lists(lists: dict[str, Any], declared: InstrumentFormat, forms: tuple[str, ...]) -> None:
    assert declared.name in lists["--as of join"]
    assert f"{declared.name} ({declared.title})" in " ".join(lists["join"].replace("│", " ").split())
    assert [declared.name, declared.title] in lists["page"]
    assert declared.name in lists["chosen"]
    assert f"| `{declared.name}` | {declared.file_is}" in lists["docs"]
    for form in forms:
        assert form in lists["--as of tracker"]
        assert f"{form}: " in " ".join(lists["tracker"].replace("│", " ").split())
        assert f"| `{form}` |" in lists["docs"]


@pytest.fixture(scope="module")
def lists() -> dict[str, Any]:
    return shown()


@pytest.mark.parametrize("declared", instrument_formats().values(), ids=lambda declared: declared.name)
def test_every_list_has_every_format(lists: dict[str, Any], declared: InstrumentFormat) -> None:
    check_lists(lists, declared, tuple(form.name for form in declared.written))


def test_every_list_follows_a_package_that_is_added(tmp_path: Path) -> None:
    package = tmp_path / "formats" / "theodolite"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(ADDED)
    export = tmp_path / "export.log"
    export.write_text(TABLE)
    done = subprocess.run(
        [sys.executable, "-c", LISTS, str(package.parent), str(export)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "drivers")])},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lists = json.loads(done.stdout)
    added = TextFormat(
        name="theodolite", title="Theodolite", file_is="a log of theodolites", finds="", ending="", read=lambda *_: None
    )
    check_lists(lists, added, ("theo",))
    assert lists["read"] == "theodolite"


def test_a_format_that_is_not_there_is_in_no_list(lists: dict[str, Any]) -> None:
    assert "neither" not in lists["chosen"]
    assert "theodolite" not in json.dumps(lists)


def test_the_scripts_of_the_page_name_no_format() -> None:
    names = {*instrument_formats(), *(declared.title for declared in instrument_formats().values())}
    for script in (ROOT / "compd" / "page" / "static" / "join").glob("*.js"):
        text = script.read_text()
        assert [name for name in names if f'"{name}"' in text or f"'{name}'" in text] == [], script.name


def test_the_guide_shows_the_table() -> None:
    guide = (ROOT / "docs" / "how-to" / "join-an-instrument.md").read_text()
    included = guide.partition("```{include} ../reference/instrument-formats.md\n")[2].partition("```")[0]
    for option, mark in (("start-after", "begin"), ("end-before", "end")):
        assert f':{option}: "<!-- formats: {mark} -->"' in included
        assert page().count(f"<!-- formats: {mark} -->") == 1


def test_two_formats_of_one_name_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = tmp_path / "theodolite"
    package.mkdir()
    (package / "__init__.py").write_text(ADDED.replace('name="theodolite"', 'name="csv"'))
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(tmp_path)])
    instrument_formats.cache_clear()
    try:
        with pytest.raises(ValueError, match="theodolite: another format is called 'csv'"):
            instrument_formats()
    finally:
        sys.modules.pop("compd.instruments.formats.theodolite")
        instrument_formats.cache_clear()


@pytest.mark.parametrize(
    ("code", "imported"),
    [
        ("import compd.cli.measurements.recording.join, compd.cli.simulated.sim.tracker", []),
        ("import compd.page.joining.joiner", []),
        (
            "from pathlib import Path; from compd.instruments.read import *; read_export(Path(sys.argv[1]))",
            ["spatial_analyzer.reader"],
        ),
    ],
)
def test_no_reader_and_no_writer_is_imported_before_a_file_needs_it(
    tmp_path: Path, code: str, imported: list[str]
) -> None:
    export = tmp_path / "export.txt"
    rows = "".join(f"A, P, {k}, {k}.5, 1.5, 2.5\n" for k in range(5))
    export.write_text(f"// SpatialAnalyzer\n// AXES = CARTESIAN: X, Y, Z (mm)\n{rows}")
    code = f"import sys; {code}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, str(export)], capture_output=True, text=True, check=True)
    prefix = f"{formats.__name__}."
    inside = [name.removeprefix(prefix) for name in done.stdout.split() if name.startswith(prefix)]
    assert [name for name in inside if "." in name] == imported


def test_declarations_import_no_numpy() -> None:
    code = "import sys; from compd.instruments.formats import *; written_forms(); print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_form_is_written_by_one_format_alone() -> None:
    forms: list[WrittenForm] = [form for declared in instrument_formats().values() for form in declared.written]
    assert [form.name for form in forms] == list(written_forms())
