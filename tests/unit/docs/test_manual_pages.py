"""The manual pages: one for each command, in the language of man(7)."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache

import pytest

from docs.generate.command_entries import entries, shown_option
from docs.generate.manual_pages import manual_pages


@cache
def pages() -> dict[str, str]:
    return manual_pages()


def test_every_command_has_a_page_with_its_arguments_and_options() -> None:
    assert set(pages()) == {"compd.1", *(f"{entry.name.replace(' ', '-')}.1" for entry in entries())}
    for entry in entries():
        page = pages()[f"{entry.name.replace(' ', '-')}.1"].replace("\\-", "-")
        for option in entry.options:
            assert f".TP\n\\fB{shown_option(option)}\\fR\n" in page


def test_a_group_and_the_main_page_list_what_is_in_them() -> None:
    assert "\\fBcompd service upgrade\\fR" in pages()["compd-service.1"]
    assert "\\fBcompd check\\fR" in pages()["compd.1"]
    assert ".SH SEE ALSO\n.BR compd\\-service (1)\n" in pages()["compd-service-upgrade.1"]


@pytest.mark.parametrize("name", sorted(pages()))
def test_no_line_is_a_request_by_accident(name: str) -> None:
    known = r"\.(TH|SH|PP|TP|BR)( |$)"
    lines = pages()[name].split("\n")
    assert [line for line in lines if line[:1] in (".", "'") and not re.match(known, line)] == []
    assert "`" not in pages()[name]


@pytest.mark.skipif(shutil.which("mandoc") is None, reason="mandoc is not installed")
@pytest.mark.parametrize("name", ["compd.1", "compd-record.1", "compd-service-upgrade.1"])
def test_mandoc_finds_no_error(name: str) -> None:
    done = subprocess.run(
        ["mandoc", "-T", "lint", "-W", "error"], input=pages()[name], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "")
