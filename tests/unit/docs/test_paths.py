"""What the documentation and its pictures name is there: files, folders, links, every package in the architecture."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from tests.support.paths import ROOT

DOCS = ROOT / "docs"
PICTURES = sorted((DOCS / "pictures").glob("*.svg"))
FENCE = re.compile(r"^(`{3,}).*?^\1`*$", re.MULTILINE | re.DOTALL)
TREES = ("compd/", "drivers/", "tests/", "docs/", "config/", "systemd/")
# In backticks and not in a role such as {term}`...`: a path from the root, or from compd/ where that is a package.
CODE = re.compile(r"(?<![`}])`([^`\n]+)`")
LINK = re.compile(r"\]\(<?([^)>\s]+)>?\)")
TEXT = re.compile(r"<(?:text|tspan)[^>]*>([^<]+)<")
FILE = re.compile(r"(?<![\w./-])[\w./-]*\w(?:\.(?:py|ya?ml|md|csv|svg)|/)(?![\w/])")
# NAME.yaml, PORT.py: any file of that folder.
PLACEHOLDER = re.compile(r"[A-Z]{3,}")


def pages() -> list[Path]:
    """README, CONTRIBUTING and every page, but those that `make docs` makes of pictures."""
    written = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
    top = [ROOT / name for name in ("README.md", "CONTRIBUTING.md") if (ROOT / name).exists()]
    return top + [path for path in written if name_of(path) in tracked()]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def packages() -> set[str]:
    """The packages of compd."""
    return {path.parent.name for path in (ROOT / "compd").glob("*/__init__.py")}


@cache
def tracked() -> frozenset[str]:
    """Files of the tree and the folders that they are in, without what tools leave behind."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:  # an unpacked release
        files = [name_of(path) for path in ROOT.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    else:
        files = [name for name in listed.stdout.splitlines() if (ROOT / name).exists()]
    folders = {parent.as_posix() for name in files for parent in Path(name).parents}
    return frozenset({*files, *folders})


def exists(path: str) -> bool:
    """Whether the tree has the path; capitals such as NAME stand for any name."""
    pattern = re.compile(PLACEHOLDER.sub(r"[\\w.-]+", re.escape(path.rstrip("/"))))
    return path.rstrip("/") in tracked() or any(pattern.fullmatch(name) for name in tracked())


def paths_in(text: str) -> list[str]:
    """Paths in backticks outside fences, from the root."""
    found = []
    for code in CODE.findall(FENCE.sub("", text)):
        path = code.removesuffix(":").split(":")[0].split("#")[0]
        if re.search(r"[\s{}<>*()=$]", path):
            continue
        if path.startswith(TREES):
            found.append(path)
        elif path.split("/")[0] in packages() and "/" in path:
            found.append(f"compd/{path}")
    return found


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_every_path_that_a_page_names_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    # the reader writes these, as in CONTRIBUTING
    written = re.findall(r"^`([^`]+)`, a new file:$", text, flags=re.MULTILINE)
    assert [path for path in paths_in(text) if path not in written and not exists(path)] == []


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_every_relative_link_resolves(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    targets = [target.split("#")[0] for target in LINK.findall(text) if not re.match(r"[a-z]+:|#", target)]
    names = [(page.parent / target).resolve().relative_to(ROOT).as_posix() for target in targets]
    assert [name for name in names if not exists(name)] == []


@pytest.mark.parametrize("picture", PICTURES, ids=name_of)
def test_every_file_in_a_picture_is_there(picture: Path) -> None:
    assert [name for name in files_in(picture) if not exists(name) and not exists(f"compd/{name}")] == []


@pytest.mark.parametrize("name", ["architecture", "one-reading", "one-recording", "one-effect"])
def test_a_picture_of_the_code_names_its_files(name: str) -> None:
    assert files_in(DOCS / "pictures" / f"{name}.svg")


def files_in(picture: Path) -> list[str]:
    """Names of files and folders in a picture's text."""
    texts = TEXT.findall(picture.read_text(encoding="utf-8"))
    return [name for text in texts for name in FILE.findall(text) if not name.startswith("NAME.")]


@pytest.mark.parametrize("name", ["one-reading", "one-recording", "one-effect"])
def test_the_numbers_in_a_picture_are_those_of_its_page(name: str) -> None:
    picture = (DOCS / "pictures" / f"{name}.svg").read_text(encoding="utf-8")
    page = (DOCS / "explanation" / f"{name}.md").read_text(encoding="utf-8")
    shown = re.findall(r"\d+\.\d+", " ".join(re.findall(r'<text class="v"[^>]*>([^<]+)<', picture)))
    assert len(shown) > 5
    computed = {float(number) for number in re.findall(r"\d+(?:\.\d+)?", page)}
    assert [number for number in shown if float(number) not in computed] == []


def test_the_architecture_has_every_package() -> None:
    folders = {name.rstrip("/") for name in files_in(DOCS / "pictures" / "architecture.svg") if name.endswith("/")}
    assert {name for name in folders if "/" not in name} == packages()


def test_the_tree_of_rooms_has_every_package() -> None:
    tree = re.findall(r"([a-z_]+)/", (DOCS / "explanation" / "rooms.md").read_text(encoding="utf-8"))
    assert packages() <= set(tree)


def test_a_path_that_is_not_there_is_noticed() -> None:
    text = "`compd/live/loop/cycle.py`, `live/loop/cycle.py`, `compd/live/loop/bicycle.py`.\n```text\n`docs/x`\n```\n"
    assert [path for path in paths_in(text) if not exists(path)] == ["compd/live/loop/bicycle.py"]
    assert exists("compd/model/library/PORT.py")
    assert not exists("compd/model/PORT.exe")
