"""An address as a QR code: on a terminal, never in a file, and as a picture."""

from __future__ import annotations

import io
import sys

import pytest

from compd.page.server import print_qr_code, svg_qr_code
from compd.page.token_file import read_tokens
from tests.support.command import run_in_process

ADDRESS = "http://10.1.2.3:7760/?token="


def test_a_code_has_as_many_lines_as_half_its_modules():
    out = io.StringIO()
    print_qr_code("http://10.1.2.3:7760/", out)
    # version 2: 25 modules and 4 light ones on either side, two to a line of text
    assert len(out.getvalue().splitlines()) in (17, 18)
    assert svg_qr_code("http://10.1.2.3:7760/").count(b"<path") == 2


@pytest.mark.parametrize(
    ("options", "address"),
    [
        ((), ""),
        (("--listen", "10.1.2.3"), "http://10.1.2.3:7760/?token="),
        (("--listen", "fd00::7", "--port", "80"), "http://[fd00::7]/?token="),
        (("--behind", "https://machine.example/"), "https://machine.example/?token="),
    ],
)
def test_a_new_token_is_printed_with_its_address(tmp_path, options, address):
    tokens = tmp_path / "tokens.yaml"
    printed = run_in_process("page", "--tokens", str(tokens), "--new-token", "view:screen", *options)
    token, *more = printed.splitlines()
    assert [entry.name for entry in read_tokens(tokens)] == ["screen"]
    assert more == ([f"open {address}{token}"] if address else [])


def test_a_terminal_gets_the_code_of_the_address(monkeypatch):
    from compd.cli.live import page

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    page._print_qr_code(f"{ADDRESS}abc")
    assert len(terminal.getvalue().splitlines()) > 10
