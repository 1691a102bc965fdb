"""The log of a process: what libraries and tracebacks bring along is written without secrets."""

from __future__ import annotations

import io
import logging
import os
import sys

import pytest
import structlog

from compd.log import hide_secrets_of_libraries, is_journal, log_to_stderr

SECRET = "Zq7vK2xW9pLm4TnB"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _as_before():
    before, last = structlog.get_config(), logging.lastResort
    yield
    structlog.configure(**before)
    logging.lastResort = last


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_a_traceback_has_no_values_of_variables(stream, monkeypatch) -> None:
    monkeypatch.setattr(sys, "stderr", written := stream())
    log_to_stderr()
    password = SECRET
    try:
        raise ValueError(f"at mqtt://anna:{password}@host")
    except ValueError:
        structlog.get_logger().exception("line failed", address=f"http://host/?token={password}", password=password)
    assert "line failed" in written.getvalue()
    assert "ValueError" in written.getvalue()
    assert SECRET not in written.getvalue()


def test_a_library_writes_its_warnings_without_secrets(monkeypatch) -> None:
    monkeypatch.setattr(sys, "stderr", written := io.StringIO())
    hide_secrets_of_libraries()
    record = logging.LogRecord("paho", logging.WARNING, "", 0, "CONNECT user=%s password=%s", ("anna", SECRET), None)
    assert logging.lastResort is not None
    logging.lastResort.handle(record)
    assert written.getvalue() == "CONNECT user=anna password=***\n"


def test_the_journal_is_known_by_its_stream(tmp_path, monkeypatch) -> None:
    with (tmp_path / "log").open("w") as file:
        status = os.fstat(file.fileno())
        assert not is_journal(file)
        monkeypatch.setenv("JOURNAL_STREAM", f"{status.st_dev}:{status.st_ino}")
        assert is_journal(file)
    assert not is_journal(io.StringIO())
