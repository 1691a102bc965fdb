"""The pictures of the eight kinds of machine are those that `compd machine draw` makes, and the page shows each."""

from __future__ import annotations

import pytest

from compd.machine_kinds import KINDS
from docs.pictures.machine_kinds import draw, picture_path
from tests.support.paths import ROOT

PAGE = ROOT / "docs" / "how-to" / "describe-a-machine.md"


@pytest.mark.parametrize("kind", KINDS)
def test_picture_is_up_to_date_and_shown(kind: str) -> None:
    path = picture_path(kind)
    assert path.read_text(encoding="utf-8") == draw(kind), "run `python -m docs.pictures.machine_kinds`"
    page = PAGE.read_text(encoding="utf-8")
    assert f"(../pictures/{path.name})" in page
    kind_row = next(line for line in page.splitlines() if line.startswith(f"| [`{kind}`]"))
    assert kind_row.endswith(f"| {' '.join(KINDS[kind].target_fixes)} |")
