"""Numbers put into a YAML text: all other text stays, in every style of collection."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.documents import parse_yaml, with_entries, with_values
from compd.errors import ConfigurationError

HERE = Path("machine.yaml")
TEXT = """\
# a machine
rods:
  - {length_mm: 300, base_B_mm: [0, 10.5, 0]}   # the first
  - length_mm: 1e3
    base_B_mm:
      - 1            # x
      - 2
      - 3
tool: {on: platform}
"""


def test_numbers_alone_change() -> None:
    edited = with_values(TEXT, HERE, {("rods", 0, "base_B_mm"): (0.25, 10.0, -1e-6), ("rods", 1, "length_mm"): 1000.5})
    assert edited == TEXT.replace("[0, 10.5, 0]", "[0.25, 10, -1.0e-06]").replace("1e3", "1000.5")


def test_comments_between_the_numbers_of_a_vector_stay() -> None:
    edited = with_values(TEXT, HERE, {("rods", 1, "base_B_mm"): (4.0, 5.0, 6.0)}, "drawing:")
    assert "      - 4            # x\n      - 5\n      - 6  # drawing: base_B_mm [1, 2, 3]\n" in edited


def test_a_key_that_is_missing_is_added_in_the_style_of_its_mapping() -> None:
    values = {("rods", 1, "radius_mm"): 7.0, ("tool", "at_P_mm"): (0.0, 0.0, 1.0), ("rods", 0, "radius_mm"): 2.0}
    edited = with_values(TEXT, HERE, values, "drawing:")
    assert "      - 3\n    radius_mm: 7  # drawing: radius_mm not stated\n" in edited
    assert "tool: {on: platform, at_P_mm: [0, 0, 1]}  # drawing: at_P_mm not stated\n" in edited
    assert "[0, 10.5, 0], radius_mm: 2}   # the first; drawing: radius_mm not stated\n" in edited


def test_a_number_for_several_places_is_refused() -> None:
    text = "first: &one {length_mm: 3}\nsecond: *one\n"
    with pytest.raises(ConfigurationError, match="written once for several places"):
        with_values(text, HERE, {("first", "length_mm"): 4.0})
    merged = "first: &one {length_mm: 3}\nsecond: {<<: *one, width_mm: 2}\n"
    with pytest.raises(ConfigurationError, match="written once for several places"):
        with_values(merged, HERE, {("first", "length_mm"): 4.0})
    # beside an anchor of something else nothing is refused
    assert "width_mm: 5" in with_values(merged, HERE, {("second", "width_mm"): 5.0})


def test_another_number_of_coordinates_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"machine.yaml:3 rods\[1\].base_B_mm: is written so"):
        with_values(TEXT, HERE, {("rods", 0, "base_B_mm"): (1.0, 2.0)})


ONE, TWO = {"row": 17, "reason": "the tracker's beam"}, {"rows": [3, 9], "reason": "1e5"}
LISTS = {
    "block": "a: 1\nlist:   # why\n- {row: 17, reason: 'the tracker''s beam'}  # own\n# next\nb: 2  # last\n",
    "indented": "list:\n  - row: 17\n    reason: the tracker's beam\nb: [1, 2]\n",
    "one line": "a: 1\nlist: [{row: 17, reason: the tracker's beam}]  # own\n",
    "all in one line": "{a: 1, list: [{row: 17, reason: the tracker's beam}], b: 2}\n",
}


@pytest.mark.parametrize("text", LISTS.values(), ids=LISTS)
def test_an_entry_is_added_and_removed_and_all_other_text_stays(text: str) -> None:
    more = with_entries(text, HERE, "list", [ONE, TWO])
    assert parse_yaml(more, HERE)[0] == {**parse_yaml(text, HERE)[0], "list": [ONE, TWO]}
    assert with_entries(more, HERE, "list", [ONE]) == text
    swapped = with_entries(more, HERE, "list", [TWO, ONE, TWO])
    assert parse_yaml(swapped, HERE)[0]["list"] == [TWO, ONE, TWO]
    assert all(line in swapped for line in ("# own", "# next", "b: 2  # last", "list:   # why") if line in text)


@pytest.mark.parametrize("text", ["a: 1\nlist:\nb: 2\n", "list: null\n", "list: []\na: 1\n", "a: |\n  text\n\n# end\n"])
def test_a_section_is_inserted_where_there_is_none(text: str) -> None:
    more = with_entries(text, HERE, "list", [ONE, TWO])
    assert parse_yaml(more, HERE)[0] == {**parse_yaml(text, HERE)[0], "list": [ONE, TWO]}
    fewer = with_entries(more, HERE, "list", [])
    assert "list" not in fewer
    assert ("# end" in fewer) == ("# end" in text)


def test_what_cannot_be_cut_is_refused() -> None:
    for text in ("list: {row: 17}\n", "- &one {row: 1}\n- *one\n", "list: [{row: 1}, # one\n {row: 2}]\n"):
        with pytest.raises(ConfigurationError, match="cannot be changed alone"):
            with_entries(text, HERE, "list" * ("list" in text), [TWO, {"row": 1}])
