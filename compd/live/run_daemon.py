"""`compd run`: the daemon under its supervisor, from the first configuration through every one that SIGHUP brings."""

from __future__ import annotations

import structlog

from compd.configuration import Configuration
from compd.errors import CompdError
from compd.live.daemon import Daemon
from compd.live.supervisor import Ending, Supervisor
from compd.live.system import THIS_COMPUTER, System, name_event
from compd.log import hide_secrets_of_libraries, log_to_stderr
from compd.machine_check import load_whole
from compd.text import hide_secrets

_log = structlog.get_logger()


def run(configuration: Configuration) -> bool:
    """Log to stderr, and run the daemon until SIGTERM or Ctrl-C; True where it ended by itself.

    Raises CompdError where it cannot start: a socket that cannot be had, a model file that cannot be used.
    """
    _log_to_stderr(THIS_COMPUTER)
    return run_daemon(configuration, THIS_COMPUTER)


def run_daemon(configuration: Configuration, system: System) -> bool:
    """Run the daemon on a computer; see `run`."""
    notifier = system.notifier()
    daemon = Daemon(configuration, system=system)
    while True:
        _report(daemon)
        daemon.take_over()
        successor = _Successor(daemon, system)
        ending = Supervisor(daemon, notifier, system).run(successor.check, successor.make)
        if ending is not Ending.RELOADED or successor.daemon is None:
            daemon.close()
            notifier.close()
            return ending is Ending.FAILED
        daemon.close(after=successor.daemon)
        daemon = successor.daemon


class _Successor:
    """The daemon of the configuration as its file is at SIGHUP."""

    def __init__(self, now: Daemon, system: System) -> None:
        self.daemon: Daemon | None = None  #: None until it has been made
        self._now = now
        self._system = system

    def check(self) -> None:
        """Make it in a process of its own, which shows whether it can be made; exit code 2 where it cannot."""
        if not self.make():
            raise SystemExit(2)

    def make(self) -> bool:
        """Whether it could be made; every problem is in the log where it could not."""
        try:
            self.daemon = Daemon(load_whole(self._now.configuration.path), self._now, self._system)
        except CompdError as error:
            for problem in error.problems:
                _log.error("configuration refused", problem=str(problem))
        return self.daemon is not None


def _report(daemon: Daemon) -> None:
    """Log what is about to run."""
    configuration = daemon.configuration
    for warning in configuration.warnings:
        _log.warning("configuration", where=warning.where, what=warning.what)
    _log.info(
        "running",
        machine=configuration.machine,
        config_hash=configuration.config_hash,
        rate_hz=configuration.loop.rate_hz,
        unix=configuration.sockets.unix.path,
        tcp_port=daemon.listeners.tcp_port,
    )


def _log_to_stderr(system: System) -> None:
    """Log one line per event to stderr, with colours on a terminal; under systemd an entry of the journal."""
    hide_secrets_of_libraries()
    if (journal := system.journal()) is None:
        log_to_stderr([name_event])
        return
    named = [structlog.processors.add_log_level, name_event]
    structlog.configure(
        processors=[*named, structlog.processors.format_exc_info, hide_secrets, journal.render], logger_factory=journal
    )
