"""The pictures of the eight kinds of machine are those that `compd machine draw` makes, and the page shows each."""

from __future__ import annotations

from compd.machine_kinds import KINDS
from docs.pictures.machines import HERE, pictures
from tests.support.paths import ROOT

PAGE = ROOT / "docs" / "how-to" / "describe-a-machine.md"


def test_pictures_are_up_to_date() -> None:
    for name, text in pictures().items():
        assert (HERE / name).read_text(encoding="utf-8") == text, f"{name}: run `python -m docs.pictures.machines`"


def test_the_page_shows_every_kind_and_what_its_target_fixes() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for kind, description in KINDS.items():
        assert f"(../pictures/machines/{kind}.svg)" in page
        row = next(line for line in page.splitlines() if line.startswith(f"| [`{kind}`]"))
        assert row.endswith(f"| {' '.join(description.target_fixes)} |")
