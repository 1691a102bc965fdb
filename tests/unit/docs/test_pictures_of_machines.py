"""The pictures of the kinds of machine are those that `compd machine new` and `compd machine draw` make."""

from __future__ import annotations

from docs.pictures.machines import HERE, pictures


def test_every_kind_has_its_picture_and_no_other() -> None:
    drawn = pictures()
    assert {path.name for path in HERE.glob("*.svg")} == set(drawn)
    old = [name for name, text in drawn.items() if (HERE / name).read_text(encoding="utf-8") != text]
    assert not old, "run `python -m docs.pictures.machines`"
