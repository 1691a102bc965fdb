"""Options that several commands share: each field of a group is an option, with its own default or the command's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import pytest
import typer
from typer.testing import CliRunner

from compd.cli.option_groups import PageOptions, with_groups
from compd.cli.paths import PathKind, path_parameters


class Place(NamedTuple):
    folder: Annotated[Path, typer.Argument(help="Where."), PathKind.FOLDER]
    depth: Annotated[int, typer.Option(help="How deep.")] = 2


@with_groups
def look(place: Place, page: PageOptions = PageOptions(Path("out.html")), by: str = "name") -> None:
    """Look."""
    print(place.folder, place.depth, page.html, page.overwrite, by)


def run(*words: str) -> str:
    app = typer.Typer()
    app.command()(look)
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, result.output
    return result.stdout.strip()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["here"], "here 2 out.html False name"),
        (["here", "--depth", "3", "--html", "a.html", "--overwrite", "--by", "x"], "here 3 a.html True x"),
    ],
)
def test_fields_are_options_and_come_as_the_group(words: list[str], said: str) -> None:
    assert run(*words) == said


def test_help_has_every_field_and_the_paths_among_them_are_known() -> None:
    shown = run("--help")
    for text in ("--depth", "How deep.", "--html", "--overwrite", "--by"):
        assert text in shown
    kinds = {parameter.name: parameter.kind for parameter in path_parameters(look)}
    assert kinds == {"folder": PathKind.FOLDER, "html": PathKind.FILE}
