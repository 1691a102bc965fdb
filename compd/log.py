"""The log of a process that goes on running: one line per event, without secrets, whatever has logged it."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Sequence
from typing import Any, TextIO

import structlog

from compd.text import hide_secrets, without_secrets


def log_to_stderr(named: Sequence[Any] = ()) -> None:
    """Log to stderr, with colours on a terminal. named : processors of structlog, before an event is written."""
    # the default traceback of a terminal has the values of variables, passwords among them
    terminal = structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)
    lines = structlog.processors.LogfmtRenderer(key_order=["timestamp", "level", "id", "event"])
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            *named,
            structlog.processors.format_exc_info,
            hide_secrets,
            structlog.processors.TimeStamper(fmt="iso"),
            terminal if sys.stderr.isatty() else lines,
        ],
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )


class _WithoutSecrets(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return without_secrets(super().format(record))


def hide_secrets_of_libraries() -> None:
    """Write what libraries log (MQTT, OPC UA, Modbus, HTTP) to stderr as before, from warnings on, without secrets."""
    handler = logging.StreamHandler()
    handler.setLevel(logging.WARNING)
    handler.setFormatter(_WithoutSecrets("%(message)s"))
    logging.lastResort = handler


def is_journal(stream: TextIO) -> bool:
    """Whether what is written to this stream ends in systemd's journal, for everybody who may read that."""
    try:
        status = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return False
    # systemd.exec(5): "device:inode" of what it has connected
    return os.environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"
