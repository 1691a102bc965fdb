"""Nothing is written over that a command of compd has not written itself."""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.errors import CompdError
from compd.files.output_file import check_replaceable, refused_path
from compd.report import check_page_path, write_page

PRECIOUS = "row,time_s,reference_x_mm\n1,0.0,1.25\n"


def test_a_page_is_written_over_a_page_and_over_nothing_else(tmp_path):
    page = tmp_path / "page.html"
    check_page_path(page)
    write_page(page, "My machine", "At the noise floor.", [], "")
    check_page_path(page)
    recording = tmp_path / "run.csv"
    recording.write_text(PRECIOUS)
    with pytest.raises(CompdError, match="not a page of compd") as caught:
        check_page_path(recording, overwrite=False)
    assert "--overwrite" in str(caught.value)
    check_page_path(recording, overwrite=True)


def test_an_empty_file_is_nobodys(tmp_path):
    (tmp_path / "page.html").touch()
    check_page_path(tmp_path / "page.html")


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_is_never_written_over(tmp_path, make):
    make(tmp_path / "x")
    with pytest.raises(CompdError, match="is not a file"):
        check_replaceable(tmp_path / "x", (b"mark",), "a page", overwrite=True)


@pytest.mark.parametrize(
    "command",
    [
        ("compare", "RUN", "--html", "RUN"),
        ("diagnose", "RUN", "--html", "RUN"),
        ("model", "effect", "link_expansion", "--html", "RUN"),
        ("plan", "RUN", "--rivals", "link_expansion,link_zero", "--out", "RUN"),
        ("sim", "tracker", "DIRECTORY", "--out", "RUN"),
        ("gauge", "learn", "--unit", "mm", "CAPTURE", "--to", "RUN"),
        ("demo", "--page", "RUN"),
    ],
    ids=lambda command: command[0],
)
def test_no_command_writes_over_a_recording(tmp_path, command):
    recording = tmp_path / "run.csv"
    recording.write_text(PRECIOUS)
    paths = {"RUN": recording, "DIRECTORY": tmp_path, "CAPTURE": tmp_path / "capture"}
    words = [str(paths.get(word, word)) for word in command]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, CompdError), result.output
    assert str(recording) in str(result.exception)
    assert "there already" in str(result.exception)
    assert recording.read_text() == PRECIOUS


def test_a_directory_in_which_a_command_may_not_write_is_named_without_a_traceback(tmp_path):
    """/sys takes no directory from anybody, root included."""
    command = [sys.executable, "-c", "from compd.cli import main; main()", "demo", "--page", "/sys/out/demo.html"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("/sys/out: was refused: ")
    assert "Traceback" not in done.stderr


def test_an_error_without_a_file_or_of_the_program_is_no_refusal():
    assert refused_path(OSError(errno.EACCES, "Permission denied")) is None
    assert refused_path(OSError(errno.EBADF, "Bad file descriptor", "x")) is None
