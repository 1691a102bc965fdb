"""Effects of one's own in a file: what people wrote stays, ids are there once, a mistake is never written over."""

from __future__ import annotations

import pytest

from compd.errors import CompdError, StateError
from compd.model.library import load_effects
from compd.page.workbench.own_effects import OwnEffects, entries_of

HAND = """# found in March
- id: first   # the oldest
  port: link
  formula: k * humidity_pct
  # from the data sheet
  parameters: {k: {unit: um/pct, plausible: [0, 1], source: notes}}

# behind it
- id: last
  port: link
  formula: k * time_s
  parameters:
    k: {unit: um/s, plausible: [0, 1], source: notes}
"""


def declared(name="mine", formula="k * (humidity_pct - 50)", source="1e5"):
    parameter = {"unit": "um/pct", "plausible": [0, 1.5], "source": source}
    return {"id": name, "port": "link", "formula": formula, "parameters": {"k": parameter}}


@pytest.fixture
def own(tmp_path):
    return OwnEffects(tmp_path / "own.effects.yaml")


@pytest.mark.parametrize(
    "source", ["1e5", "12:30", "yes", "", "a: b # c", "line\nline", "\u00b5 \U0001f600", "'\"", "0o7", "~"]
)
def test_what_is_saved_is_read_as_it_was(own, source):
    own.save(declared(source=source), replace=False)
    assert entries_of(own.path.read_text(), own.path) == [declared(source=source)]
    (effect,) = load_effects(own.path).values()
    assert effect.declared == declared(source=source)


def test_what_people_wrote_stays(own):
    own.path.write_text(HAND)
    own.save(declared(), replace=False)
    assert own.path.read_text().startswith(HAND)
    assert list(own.effects) == ["first", "last", "mine"]


def test_the_layout_of_other_entries_stays(own):
    first = """effects:
    # of the links
    - id:   first
      port: link
      formula: 'k * time_s'
      parameters: {k: {unit: um/s,
                       plausible: [0, 1.50], source: "notes"}}
"""
    own.path.write_text(first)
    own.reload()
    own.save(declared(), replace=False)
    assert own.path.read_text().startswith(first)
    own.delete("mine")
    assert own.path.read_text() == first


def test_one_is_replaced_in_its_place_with_its_comments(own):
    own.path.write_text(HAND)
    own.reload()
    own.save(declared("first"), replace=True)
    text = own.path.read_text()
    assert text.endswith(HAND[HAND.index("\n# behind it") :])
    assert all(comment in text for comment in ("# found in March", "# the oldest", "# from the data sheet"))
    assert list(own.effects) == ["first", "last"]
    assert own.declarations["first"] == declared("first")


def test_an_id_is_there_once_unless_it_is_replaced(own):
    own.save(declared(), replace=False)
    before = own.path.read_text()
    with pytest.raises(StateError, match="has an effect of this id"):
        own.save(declared(formula="k * time_s"), replace=False)
    assert own.path.read_text() == before


def test_one_is_deleted_and_the_last_one_with_its_file(own):
    own.path.write_text(HAND)
    own.reload()
    own.delete("last")
    assert own.path.read_text() == HAND[: HAND.index("- id: last")]
    own.path.write_text("")
    own.save(declared(), replace=False)
    own.delete("mine")
    assert not own.path.exists()
    with pytest.raises(StateError, match="no such effect"):
        own.delete("mine")


def test_comments_alone_hold_no_effect_and_no_problem(own):
    own.path.write_text("# nothing yet\n")
    own.reload()
    assert (dict(own.effects), own.problems) == ({}, ())
    own.save(declared(), replace=False)
    assert own.path.read_text().startswith("# nothing yet\n- id: mine")


@pytest.mark.parametrize("text", ["effects:\n  - id: a\n{}", "effects:\n- id: a\n{}"])
def test_a_list_under_effects_is_continued(own, text):
    rest = "port: link\nformula: k * time_s\nparameters: {k: {unit: um/s, plausible: [0, 1], source: notes}}\n"
    indent = " " * (text.index("- id") - text.index("\n") + 1)
    own.path.write_text(text.format("".join(f"{indent}{line}\n" for line in rest.splitlines())))
    own.reload()
    assert own.problems == ()
    own.save(declared(), replace=False)
    assert list(own.effects) == ["a", "mine"]


@pytest.mark.parametrize("text", ["- id: A b\n", "5\n", "text\n", "- 5\n", "effects: 3\n", "- id: [\n", "\x00"])
def test_a_file_with_a_mistake_is_told_and_not_written_over(own, text):
    own.path.write_text(text)
    own.reload()
    assert own.problems
    with pytest.raises(CompdError):
        own.save(declared(), replace=True)
    assert own.path.read_text() == text


def test_a_single_effect_without_a_list_is_left_to_its_writer(own):
    own.path.write_text(HAND.partition("\n\n")[0].replace("- id", "  id"))
    own.reload()
    assert list(own.effects) == ["first"]
    with pytest.raises(CompdError, match="one part of it cannot be changed alone"):
        own.save(declared(), replace=False)


def test_a_mistake_is_refused_and_an_id_of_the_library_is_not(own):
    with pytest.raises(CompdError):
        own.save(declared(formula="k *"), replace=False)
    assert not own.path.exists()
    own.save(declared("backlash"), replace=False)
    assert list(own.effects) == ["backlash"]
