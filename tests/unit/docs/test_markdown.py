"""Docstrings as Markdown: lists stay lists, and what is indented is a block of code."""

from __future__ import annotations

import inspect

import pytest

from compd.recording import checks
from docs.generate import __main__ as generate
from docs.generate.markdown import prose


@pytest.mark.parametrize(
    ("docstring", "markdown"),
    [
        ("- one\n  and more\n- two", "- one\n  and more\n- two\n"),
        ("1. one\n   and more\n\ntext", "1. one\n   and more\n\ntext\n"),
        ("text\n\n    code\n      more\n\ntext", "text\n\n```text\ncode\n  more\n```\n\ntext\n"),
        ("- one\n\n    code", "- one\n\n```text\ncode\n```\n"),
        ("text::\n\n  - code\n    more", "text:\n\n```text\n- code\n  more\n```\n"),
    ],
)
def test_what_a_docstring_becomes(docstring: str, markdown: str) -> None:
    assert prose(docstring) == markdown


def test_the_rules_of_a_recording_are_a_list() -> None:
    rules = (inspect.getdoc(checks) or "").partition("- ")[2].partition("\n\n")[0]
    assert "\n  " in rules  # an item is wrapped
    page = generate.page_of("recording")
    assert f"- {rules.split(chr(10))[0]}" in page
    section = page.partition("## Rules and limits")[2].partition("\n| ")[0]
    assert "```" not in section
