"""Labelled texts in few lines: what is cut, and where spare lines go."""

from __future__ import annotations

from compd.text.labelled_lines import LabelledText, fit_lines

LONG = "a clause that is much longer than the forty columns that there are for it and its label"


def test_labels_stand_in_a_column_and_texts_are_wrapped_beside_it() -> None:
    texts = [LabelledText("Found", ("one", "two")), LabelledText("Next step", (LONG,))]
    assert fit_lines(texts, 9, 40) == [
        "Found:     one; two",
        "Next step: a clause that is much longer",
        "           than the forty columns that",
        "           there are for it and its",
        "           label",
    ]


def test_whole_clauses_are_left_out_and_the_reader_is_told() -> None:
    assert fit_lines([LabelledText("Sure", ("chance 1 in 3", LONG))], 1, 40) == ["Sure: chance 1 in 3; more below"]


def test_a_first_clause_without_room_is_cut_between_words() -> None:
    (line,) = fit_lines([LabelledText("Sure", (LONG,))], 1, 40)
    assert line == "Sure: a clause that is much longer..."


def test_a_word_longer_than_the_line_is_cut_too() -> None:
    (line,) = fit_lines([LabelledText("Sure", ("x" * 90,))], 1, 40)
    assert len(line) <= 40
    (line,) = fit_lines([LabelledText("Sure", (f"also {'x' * 90}",))], 1, 40)
    assert line.startswith("Sure: also xxx")
    assert len(line) <= 40


def test_each_name_has_its_line_and_those_without_are_mentioned() -> None:
    found = LabelledText("Found", ("a: play", "b: heat", "c: load"), ("a", "b", "c"))
    assert fit_lines([found], 3, 40) == ["Found: a: play", "       b: heat", "       c: load"]
    assert fit_lines([found], 2, 40) == ["Found: a: play", "       also b, c"]
    assert fit_lines([found], 1, 40) == ["Found: a, b, c"]


def test_spare_lines_go_to_the_last_text_first() -> None:
    texts = [LabelledText("A", (LONG,)), LabelledText("B", (LONG,))]
    lines = fit_lines(texts, 5, 40)
    assert [line[:2] for line in lines] == ["A:", "  ", "B:", "  ", "  "]
    assert lines[1].endswith("...")
    assert not lines[4].endswith("...")
