"""`compd docs`: the documentation, shipped with compd for offline use."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compd.cli.paths import PathKind
from compd.errors import CompdError

_ROOT = Path(__file__).parents[3]
# Directories in an installed package, and in a checkout with and without `make docs`.
_PLACES = (_ROOT / "compd" / "documentation", _ROOT / "docs" / "_build" / "html", _ROOT / "docs")
# Built pages, and pages as they are written.
_SUFFIXES = (".html", ".md")


def docs(
    page: Annotated[
        str,
        typer.Argument(help="A page by its name, such as effects or tutorials/missing-effect."),
        PathKind.NAME_OR_FILE,
    ] = "index",
    path: Annotated[bool, typer.Option("--path", help="Print the page's path and open no browser.")] = False,
) -> None:
    """Open the documentation in the browser; it needs no network."""
    import webbrowser

    file = find_page(documentation_directory(), page)
    if path:
        typer.echo(file)
        return
    typer.echo(file.as_uri())
    if not webbrowser.open(file.as_uri()):
        typer.echo("No browser was found here; open this address in one.")


def documentation_directory() -> Path:
    """The directory of the pages, built ones first. Raises CompdError if there are none."""
    for place in _PLACES:
        if any((place / f"index{suffix}").is_file() for suffix in _SUFFIXES):
            return place
    raise CompdError.of(
        str(_PLACES[0]), "the documentation is not there", next_step="install compd again: every wheel has it"
    )


def find_page(directory: Path, name: str) -> Path:
    """The page of that name: its path below `directory`, or a unique end of one.

    A folder's page may be named by the folder: `tutorials` is `tutorials/index`. Raises CompdError with the names that
    are near where no page or more than one has this name.
    """
    suffix = next(suffix for suffix in _SUFFIXES if (directory / f"index{suffix}").is_file())
    pages = {
        file.relative_to(directory).with_suffix("").as_posix(): file
        for file in sorted(directory.rglob(f"*{suffix}"))
        # what Sphinx adds, and what it made of Markdown
        if not file.relative_to(directory).parts[0].startswith("_")
    }
    wanted = name.strip("/").removesuffix(".html").removesuffix(".md")
    for exact in (wanted, f"{wanted}/index"):
        if exact in pages:
            return pages[exact]
    ending = [page for page in pages if page.endswith(f"/{wanted}")]
    if len(ending) == 1:
        return pages[ending[0]]
    raise CompdError.of(
        "compd docs",
        "more than one page has this name" if ending else "there is no such page",
        value=name,
        allowed=", ".join(ending or _near(wanted, list(pages))),
        next_step="name one of these, or leave the name out for the front page",
    )


def _near(wanted: str, pages: list[str]) -> list[str]:
    """The pages whose name or last part resembles `wanted`; else the folders' pages."""
    from difflib import get_close_matches

    parts = {page.rpartition("/")[2]: page for page in pages}
    near = [*get_close_matches(wanted, pages), *(parts[part] for part in get_close_matches(wanted, list(parts)))]
    near += [page for page in pages if wanted and wanted in page]
    return list(dict.fromkeys(near)) or [page for page in pages if page.endswith("index")]
