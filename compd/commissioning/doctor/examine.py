"""All checks of the doctor, and the next steps in order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from compd.commissioning.daemon_health import DaemonStatus, Health, daemon_status
from compd.commissioning.doctor.system import (
    clock_findings,
    disk_findings,
    realtime_findings,
    tcp_finding,
    unit_finding,
)
from compd.configuration import Configuration
from compd.line_settings import LineSettings
from compd.lines import definition_of
from compd.probes import Computer, Finding, Verdict, advice, good, unknown


def port_findings(computer: Computer, lines: Mapping[str, LineSettings], daemon_runs: bool) -> Iterator[Finding]:
    """For every line of a configuration. daemon_runs : its devices are then not connected to a second time."""
    for name, line in lines.items():
        yield from definition_of(line).probe(computer, f"line {name}", line, daemon_runs)


# Values of the shipped configurations, for a computer without a configuration.
_USUAL_PRIORITY = 40
_USUAL_DIRECTORY = Path("/var/lib/compd")
_TIMEOUT_S = 2.0


def examine(configuration: Configuration | None, computer: Computer | None = None) -> list[Finding]:
    """Make all checks; without a configuration those of the computer alone."""
    computer = computer or Computer()
    findings: list[Finding] = []
    daemon = None
    if configuration is not None:
        daemon = daemon_status(configuration.sockets.unix.path, _TIMEOUT_S)
        findings.append(_daemon_finding(daemon))
    runs = daemon is not None and daemon.health is not Health.UNKNOWN
    if configuration is not None:
        findings += port_findings(computer, configuration.lines, runs)
        if (tcp := configuration.sockets.tcp) is not None and tcp.port:
            findings.append(tcp_finding(computer, tcp.port, runs))
    priority = _USUAL_PRIORITY if configuration is None else configuration.loop.priority
    directory = _USUAL_DIRECTORY if configuration is None else Path(configuration.state.directory)
    findings += realtime_findings(computer, priority, {} if daemon is None else daemon.status.get("realtime", {}))
    findings += clock_findings(computer)
    findings += disk_findings(computer, directory)
    findings.append(unit_finding(computer, runs))
    return findings


def what_to_do(findings: Sequence[Finding]) -> list[str]:
    """The next steps: faults first, in the order of the checks, then advice."""
    by_weight = sorted(findings, key=lambda finding: -finding.verdict)
    return list(dict.fromkeys(finding.next_step for finding in by_weight if finding.next_step))


def _daemon_finding(daemon: DaemonStatus) -> Finding:
    if daemon.health is Health.UNKNOWN:
        return unknown("daemon", f"does not run: {daemon.reason}")
    if daemon.health is Health.OK:
        return good("daemon", daemon.text)
    words = "; ".join((daemon.text, *daemon.gauges))
    return advice("daemon", words, "look at `compd watch`; what the ports below show may be the cause")


def is_fit(findings: Sequence[Finding]) -> bool:
    """Whether there are no faults."""
    return all(finding.verdict is not Verdict.FAULT for finding in findings)
