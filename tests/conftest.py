"""What fails while the computer itself has paused is tried again: see `tests.support.pauses`."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import hypothesis
import pytest
import pytest_timeout
import structlog
from _pytest.runner import runtestprotocol

from tests.support.pauses import MATTERS_S, Pauses

# Every run tries the same examples, or others with COMPD_FUZZ. The computer may be busy: neither an example nor its
# making has a time limit.
hypothesis.settings.register_profile(
    "compd",
    deadline=None,
    derandomize="COMPD_FUZZ" not in os.environ,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("compd")

_TRIES = 4
# Of a report: it failed, and its test is tried again. Counted and listed by this word at the end.
_TRIED_AGAIN = "tried again"
_PAUSES = Pauses()
_LAST_RESORT = logging.lastResort


@pytest.hookimpl(wrapper=True)
def pytest_runtestloop(session: pytest.Session) -> Iterator[None]:
    if _only_distributes(session.config):
        return (yield)
    with _PAUSES.watched():
        return (yield)


def _only_distributes(config: pytest.Config) -> bool:
    """Whether this process hands tests out to others, and runs none."""
    return config.getoption("dist", "no") != "no" and not hasattr(config, "workerinput")


@pytest.hookimpl
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test; four times at most while it fails and the computer paused meanwhile.

    What runs a simulated machine beside its daemon in real time loses the gauges while neither runs, and the daemon
    does not believe them afterwards. Without a pause, the first failure counts.
    """
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for tries_left in reversed(range(_TRIES)):
        before_s = _PAUSES.lost_s
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        _leave_things_as_they_were()
        paused_s = _PAUSES.lost_s - before_s
        if not tries_left or paused_s < MATTERS_S or not any(report.failed for report in reports):
            break
        _log(item, [_tried_again(report, paused_s) for report in reports if report.failed])
        # a machine that other tests share is not what it was
        item.session._setupstate.teardown_exact(None)
        with _its_time_stopped(item):
            _PAUSES.settle()
        item._initrequest()  # type: ignore[attr-defined]
    _log(item, reports)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _leave_things_as_they_were() -> None:
    """Take back what a test has changed of this process by running a command or a loop in it."""
    # beside a real-time priority other tests stand still
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    # a command logs to its own stderr, which is closed after it where a test has run it
    log_file = getattr(structlog.get_config()["logger_factory"], "_file", None)
    if log_file is not None and log_file.closed:
        structlog.reset_defaults()
    logging.lastResort = _LAST_RESORT
    # workers of a page import nothing from their directory; the examples' scripts do
    os.environ.pop("PYTHONSAFEPATH", None)


@contextmanager
def _its_time_stopped(item: pytest.Item) -> Iterator[None]:
    """The limit of a test's time is that of one try, which begins at the end of the block."""
    settings = pytest_timeout._get_item_settings(item)
    if not settings.timeout:
        yield
        return
    item.ihook.pytest_timeout_cancel_timer(item=item)
    yield
    item.ihook.pytest_timeout_set_timer(item=item, settings=settings)


def _tried_again(report: pytest.TestReport, paused_s: float) -> pytest.TestReport:
    report.outcome = _TRIED_AGAIN  # type: ignore[assignment]
    report.sections.append((_TRIED_AGAIN, f"the computer itself paused for {paused_s:.2f} s meanwhile"))
    return report


def _log(item: pytest.Item, reports: Sequence[pytest.TestReport]) -> None:
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    return (_TRIED_AGAIN, "P", "PAUSED") if report.outcome == _TRIED_AGAIN else None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for report in terminalreporter.getreports(_TRIED_AGAIN):
        tries = "; ".join(text for name, text in report.sections if name == _TRIED_AGAIN)
        last_line = report.longreprtext.strip().splitlines()[-1:]
        terminalreporter.write_line(f"tried again: {report.nodeid}: {tries} {last_line}")
