"""`compd docs`: which page it opens, and what it says where there is none."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from compd.cli.start import docs as command
from compd.errors import CompdError
from tests.support.paths import ROOT

PAGES = ("index", "tutorials/index", "reference/index", "reference/effects", "how-to/add-an-effect", "gallery/index")

app = typer.Typer()
app.command()(command.docs)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Built pages, in the second of two places."""
    for name in (*PAGES, "_static/theme"):
        page = tmp_path / "built" / f"{name}.html"
        page.parent.mkdir(parents=True, exist_ok=True)
        page.touch()
    monkeypatch.setattr(command, "_PLACES", (tmp_path / "absent", tmp_path / "built"))
    return tmp_path / "built"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Addresses that the browser was asked to open."""
    addresses: list[str] = []

    def keep(address: str) -> bool:
        addresses.append(address)
        return True

    monkeypatch.setattr(webbrowser, "open", keep)
    return addresses


def run(*arguments: str) -> str:
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


@pytest.mark.parametrize(
    ("name", "page"),
    [
        ("index", "index"),
        ("effects", "reference/effects"),
        ("reference/effects", "reference/effects"),
        ("reference/effects.html", "reference/effects"),
        ("tutorials", "tutorials/index"),
        ("tutorials/", "tutorials/index"),
    ],
)
def test_a_page_is_found_by_its_name(site: Path, opened: list[str], name: str, page: str) -> None:
    run(name)
    assert opened == [(site / f"{page}.html").as_uri()]


def test_the_path_alone_opens_nothing(site: Path, opened: list[str]) -> None:
    assert run("--path").strip() == str(site / "index.html")
    assert opened == []


def test_without_a_browser_the_address_is_printed(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda _: False)
    output = run("effects")
    assert (site / "reference/effects.html").as_uri() in output
    assert "No browser" in output


@pytest.mark.parametrize(
    ("name", "near"), [("efects", "reference/effects"), ("effect", "how-to/add-an-effect"), ("zzz", "tutorials/index")]
)
def test_a_wrong_name_lists_what_is_near(site: Path, opened: list[str], name: str, near: str) -> None:
    with pytest.raises(CompdError, match="there is no such page") as caught:
        run(name)
    (problem,) = caught.value.problems
    assert near in problem.allowed
    assert "_static" not in problem.allowed
    assert opened == []


def test_a_name_of_several_pages_lists_them(site: Path) -> None:
    (site / "gallery" / "effects.html").touch()
    with pytest.raises(CompdError, match="more than one page"):
        run("effects")


@pytest.mark.parametrize("name", ["recording", "reference/recording.md", "protocol", "run-under-systemd"])
def test_a_checkout_and_a_wheel_without_built_pages_have_the_written_ones(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(command, "_PLACES", (ROOT / "compd" / "documentation", ROOT / "docs"))
    (page,) = [path for path in (ROOT / "docs").glob("*/*.md") if path.stem == Path(name).stem]
    assert run(name, "--path").strip() == str(page)


def test_an_installation_without_pages_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "_PLACES", (tmp_path / "a", tmp_path / "b"))
    with pytest.raises(CompdError, match="install compd again"):
        run()
