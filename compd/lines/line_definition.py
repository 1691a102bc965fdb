"""The definition of a kind of line: its keys, how it is opened, its twin, its time budget, how the doctor looks at it.

A kind is a folder in `compd/lines/kinds`, named as `kind` in the configuration, whose `__init__` has a `KIND`. All else
asks `compd.lines.open`. What is heavy, or needs a library of its own, is imported by the method that needs it: the
definitions are read whenever a configuration is.

A kind that is polled derives from `PolledDefinition`, or from what it shares with others: `SerialDefinition`,
`TcpDefinition`. A kind whose devices speak by themselves derives from `PushedDefinition`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from compd.clock import Clock
from compd.extras import install_line
from compd.gauge import LineFault, LineKind, Quality
from compd.line_settings import BROADCAST, WRITE_REGISTERS, LineSettings, TriggerBytes, TriggerWrite
from compd.lines.port_arguments import PortArguments

if TYPE_CHECKING:
    from compd.line_settings import Pace
    from compd.lines.line import Line
    from compd.lines.ports import Ports
    from compd.lines.stream import StreamLine
    from compd.probes import Computer, Finding
    from compd.twins import PolledTwin, SimulatedPushedLine


class Library(NamedTuple):
    """A package that is not installed with compd, and the extra that installs it."""

    package: str
    extra: str


class LineDefinition(ABC):
    """A kind of line."""

    kind: ClassVar[str]  #: as `kind` of a line in the configuration names it
    carries: ClassVar[LineKind]  #: what drivers find on it, as `Gauge.line_kind` has it.
    settings: ClassVar[type[LineSettings]]  #: its keys in the configuration
    example_port: ClassVar[str]  #: example_port, example_key: a port and a key of it, as on the command line
    #: its place in lists; lower ones come first. Of the kinds that carry the same, the first is taken for a port of the
    #: command line that no other claims.
    order: ClassVar[int] = 100
    library: ClassVar[Library | None] = None  #: what must be installed for it; None for compd itself
    example_key: ClassVar[str] = "pause_s=0.02"

    @abstractmethod
    def open(self, settings: Any, clock: Clock, ports: Ports) -> Line:
        """The open line. Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened."""

    @abstractmethod
    def probe(self, computer: Computer, subject: str, settings: Any, daemon_runs: bool) -> Iterator[Finding]:
        """What `compd doctor` finds at the other end. daemon_runs : a device is then not connected to a second time."""

    @abstractmethod
    def port_keys(self, port: PortArguments) -> dict[str, Any]:
        """The keys of a line at a port of the command line, without `kind` and `timeout_s`.

        Raises ConfigurationError for a port that is none of this kind.
        """

    def claims(self, port: str) -> bool:
        """Whether a port of the command line can only be one of this kind: host:port for TCP."""
        return False

    def device(self, line: Any) -> str:
        """What no other line may have: a port, //host:port for TCP; "" where several lines share the other end.

        line : the settings as far as they could be read: what is missing or wrong is None.
        """
        return ""

    def without_signals(self, line: Any) -> str:
        """What the line is, where it has neither DTR nor a break; "" where it has. `line`: as of `device`."""
        return f"a line of kind {self.kind}" if self.carries == "bytes" else ""


class PolledDefinition(LineDefinition):
    """A kind of line whose gauges are polled."""

    #: whether there is no baud rate, and no damage that a checksum of the network lets through
    over_network: ClassVar[bool]
    broadcast_answered: ClassVar[bool] = False  #: whether a write to unit 0 is answered, as one over Modbus TCP is
    tries_drivers: ClassVar[bool] = False  #: whether `compd gauge test-driver` tries drivers on it

    @abstractmethod
    def pace(self, settings: Any, turnaround_s: float | None = None) -> Pace:
        """Times on the line. `turnaround_s`: of its devices, s; None for the shortest."""

    @property
    @abstractmethod
    def twin(self) -> PolledTwin:
        """The far end, as the simulated machine has it."""

    def stream(self, settings: Any, clock: Clock, ports: Ports) -> StreamLine:
        """The line's stream of bytes, whatever is spoken over it. Raises LineFault as `open`, TypeError without one."""
        raise TypeError(f"a line of kind {self.kind} has no stream of bytes of its own")

    def open(self, settings: Any, clock: Clock, ports: Ports) -> Line:
        return self.stream(settings, clock, ports)

    def bytes_on_wire(self, sent: int, received: int) -> tuple[int, int]:
        """Bytes there and back of an exchange that has so many in `Gauge.traffic`."""
        return sent, received

    def trigger_s(self, settings: Any) -> float:
        """What the round trigger takes with its settling time, s; with its confirmation, where it is answered."""
        trigger: TriggerBytes | TriggerWrite | None = settings.round_trigger
        if trigger is None:
            return 0.0
        pace, settle_s = self.pace(settings), trigger.settle_s or 0.0
        if isinstance(trigger, TriggerBytes):
            return pace.quiet_s + len(trigger.request) * pace.character_s + settle_s
        several = trigger.function == WRITE_REGISTERS
        # Modbus over Serial Line V1.02: with unit and CRC
        sent, received = self.bytes_on_wire(9 + 2 * len(trigger.values) if several else 8, 8)
        if trigger.unit == BROADCAST and not self.broadcast_answered:
            return pace.quiet_s + sent * pace.character_s + settle_s
        return max(pace.exchange_s(sent, received), settle_s)

    def absent_wait_s(self, settings: Any) -> float:
        """How long nothing comes from a device that is absent before the line is free again, s."""
        return float(settings.timeout_s)

    def held_back_s(self, settings: Any) -> float:
        """How long an adapter holds a reply back, s."""
        return 0.0


class PushedDefinition(LineDefinition):
    """A kind of line whose devices speak by themselves."""

    example_key: ClassVar[str] = "user=compd"

    @abstractmethod
    def subscriber(self, settings: Any, clock: Clock) -> Line:
        """The line, connected. Raises LineFault (LINE_LOST), and ImportError where its library is not installed."""

    @abstractmethod
    def simulated_line(self, name: str, devices: Sequence[Any], broker: tuple[str, int] | None) -> SimulatedPushedLine:
        """The far end, as the simulated machine has it. `broker`: host and port of an MQTT broker that a person names.

        Raises CompdError where one is needed and none is named.
        """

    def open(self, settings: Any, clock: Clock, ports: Ports) -> Line:
        """The line; its port is within its library, and stays as it is."""
        try:
            return self.subscriber(settings, clock)
        except ImportError as error:
            if self.library is None:
                raise
            text = f"{error.name} is not installed: {install_line(self.library.extra)}"
            raise LineFault(Quality.LINE_LOST, text) from error
