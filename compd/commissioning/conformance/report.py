"""From a driver's name to the table of what held and what did not."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from compd.commissioning.conformance.cases import Result, Subject, run, slowest_line
from compd.commissioning.conformance.harness import ConformanceSession, ConformanceWire
from compd.commissioning.conformance.peer import Peer, Truth
from compd.commissioning.conformance.virtual import VirtualWire
from compd.commissioning.conformance.wire import CHARACTER_BITS, Kind, RealWire
from compd.errors import PluginError, Problem
from compd.gauge import Gauge, Quality
from compd.plugins import GAUGES, SIMULATED_GAUGES, load

SLOWEST_BAUD = 1200  # of every device in the shipped table
SLOW_TIMEOUT_S = 0.3


@dataclass(frozen=True)
class Driver:
    """A driver with what is needed to try it."""

    name: str
    gauge: type[Gauge[Any]]
    simulator: Any
    options: Any

    @property
    def registers(self) -> bool:
        return self.gauge.line_kind == "registers"

    @property
    def error_replies(self) -> Mapping[bytes, Quality]:
        """Whole replies by which the device says that something is wrong, as its simulator names them."""
        device = self.simulator(self.options, lambda channel: math.nan)
        replies = getattr(device, "error_replies", {})
        return {reply: Quality(quality) for reply, quality in replies.items()}

    def kinds(self) -> tuple[Kind, ...]:
        """The lines that it can hang on."""
        return ("modbus_rtu", "modbus_tcp") if self.registers else ("serial", "tcp")

    def subject(self, over_tcp: bool, exact: bool) -> Subject:
        checksum = self.registers or self.gauge.integrity == "checksum"
        return Subject(self.registers, over_tcp, checksum, exact, self.error_replies)

    def peer(self, over_tcp: bool = False) -> tuple[Peer, Truth]:
        """A device at the far end, and what it sees. `over_tcp`: a Modbus slave in TCP framing."""
        truth = Truth(self.gauge(self.options).channels, self.gauge.sample_range)
        return Peer(self.simulator, self.options, truth, over_tcp), truth

    def virtual(self, character_s: float = 0.0) -> ConformanceSession:
        """On a wire in virtual time."""
        peer, truth = self.peer()
        return self._session(VirtualWire(peer, self.registers, character_s=character_s), truth)

    def real(self, kind: Kind, directory: Path, **settings: Any) -> ConformanceSession:
        """On a pty or TCP port; `settings`: baud, timeout_s."""
        peer, truth = self.peer(over_tcp=kind == "modbus_tcp")
        return self._session(RealWire(peer, kind, directory, **settings), truth)

    def _session(self, wire: ConformanceWire, truth: Truth) -> ConformanceSession:
        return ConformanceSession(self.gauge(self.options), wire, truth)


def find(name: str, options: Mapping[str, Any] | None = None, simulator: str | None = None) -> Driver:
    """The driver `name` (entry point, or /file.py:ClassName), ready to be tried.

    `options` : without `driver` and `line`; the driver's own `sample_options` if None.
    `simulator` : the simulated device's entry point or file; `name` if None.
    Raises PluginError when there is no driver, no simulated device, or no options.
    """
    gauge = load(GAUGES, name, f"driver {name}")
    device = load(SIMULATED_GAUGES, simulator or name, f"simulated device of {name}")
    chosen = gauge.sample_options if options is None else options
    if chosen is None:
        chosen = {}
    try:
        checked = gauge.Options.model_validate({"driver": name, "line": "test", **chosen})
    except ValidationError as error:
        raise PluginError(
            [
                Problem(
                    where=f"driver {name}, options.{'.'.join(map(str, detail['loc']))}",
                    what=detail["msg"],
                    next_step="give the driver `sample_options`, or name a file with --options",
                )
                for detail in error.errors(include_url=False)
            ]
        ) from error
    return Driver(name, gauge, device, checked)


def try_driver(driver: Driver, on_real_wires: bool = True) -> Iterator[tuple[str, Result]]:
    """Every case on every wire that the driver can hang on: (wire, result) as they come."""
    with tempfile.TemporaryDirectory(prefix="compd-") as temporary:
        yield from _on("virtual time", driver.virtual(), driver.subject(False, True))
        slow = driver.virtual(CHARACTER_BITS / SLOWEST_BAUD)
        yield "virtual time", slowest_line(slow, SLOWEST_BAUD)
        if not on_real_wires:
            return
        for kind in driver.kinds():
            session = driver.real(kind, Path(temporary))
            subject = driver.subject(kind in ("tcp", "modbus_tcp"), False)
            yield from _on(kind, session, subject)
        session = driver.real(driver.kinds()[0], Path(temporary), baud=SLOWEST_BAUD, timeout_s=SLOW_TIMEOUT_S)
        try:
            yield driver.kinds()[0], slowest_line(session, SLOWEST_BAUD)
        finally:
            session.close()


def _on(wire: str, session: ConformanceSession, subject: Subject) -> Iterator[tuple[str, Result]]:
    try:
        for result in run(session, subject):
            yield wire, result
    finally:
        session.close()
