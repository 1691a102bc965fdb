"""What a fault happens to: a machine, its lines, its daemon and the truth; a virtual one, or a real one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from compd.setpoint_states import State
from tests.injection.faults import Fault
from tests.support.watching import Seen

# The configuration of the machine, the rate of its daemon, and the seed of its noise.
TRIPOD = "tripod-cmm.yaml"
RATE_HZ = 100.0
SEED = 3
VALID_FOR_S = 0.1
# What an owner adds to the shipped configuration, so that the gauges are compared with each other.
VOTES = {
    "joint_pair_um": 30.0,
    "tip_mm_per_s": 200.0,
    "frame": {"temperature": "temperature_frame_degC", "expansion_ppm_per_K": 10.5, "tolerance_um": 15.0},
}
MACHINE_ZERO = "machine-zero.json"
# For so long after a motion a setpoint may rest on readings from the motion: two polls of the slowest gauge.
SETTLED_S = 0.3
# How far links go in a drive away, mm; from further out than TURNS_MM, back.
WAY_MM, TURNS_MM = 7.0, 7.5
# How often the state is looked at, s.
LOOK_EVERY_S = 0.02


class Held(NamedTuple):
    """A valid setpoint against the truth. error_um : of its tip; None where nobody knows. rested : whether no reading
    that it rests on is from a motion."""

    error_um: float | None
    rested: bool


UNKNOWN = Held(None, False)


class Watched(Protocol):
    """A client that takes every setpoint. ended : why no more come. broken : which setpoint broke which rule."""

    seen: list[Seen]
    ended: str
    broken: list[str]


class Wires(Protocol):
    """The lines between the devices and the daemon."""

    def fault(self, line: str, fault: Fault | None) -> None:
        """From the next reply on, beside those that the line has; None ends all of them."""

    def unplug(self, *lines: str) -> None: ...
    def plug(self, *lines: str) -> None: ...
    def replug(self, *lines: str) -> None: ...

    def exchange(self, one: str, other: str) -> None:
        """The daemon's two lines ask each other's device."""

    def repair(self) -> None:
        """No fault, all plugged in, no line exchanged."""


class Machine(ABC):
    """The shipped tripod at rest, with faults on every line, and its daemon.

    Attributes
    ----------
    injector : its lines. place_mm : where its links were driven last. state : the daemon's directory of state.
    """

    injector: Wires
    state: Path
    place_mm: tuple[float, ...] = (0.0, 0.0, 0.0)

    # --- time and the machine

    @property
    @abstractmethod
    def now_s(self) -> float:
        """Time, s, from any beginning."""

    @abstractmethod
    def rest_for(self, duration_s: float) -> None:
        """Let time pass, s."""

    @abstractmethod
    def drive(self, scale_mm: Sequence[float]) -> None:
        """Drive there, and return when the machine has come to rest and every gauge has been read again."""

    def drive_away(self) -> None:
        """Drive so that every link goes the same way: less far, a scale that is stuck cannot be told."""
        self.drive([mm + WAY_MM if mm < TURNS_MM else mm - WAY_MM for mm in self.place_mm])

    # --- the daemon

    @abstractmethod
    def kill(self, process: str) -> None:
        """End one of the daemon's processes."""

    @abstractmethod
    def stall(self, process: str, duration_s: float) -> None:
        """Stop one of the daemon's processes, or all of them for "", for so long; for ever where it is infinite."""

    @abstractmethod
    def attack(self, name: str) -> None:
        """A hostile client from now on."""

    @abstractmethod
    def reload(self, exchanged: tuple[str, str] | None) -> None:
        """Exchange the ports of two lines in the configuration, and let the daemon read it anew; None for its own."""

    @abstractmethod
    def ends(self) -> bool:
        """Wait for the daemon to end by itself; whether it did."""

    @abstractmethod
    def end_daemon(self) -> None:
        """End it, in whatever state it is."""

    @abstractmethod
    def start_daemon(self) -> None:
        """Start it again."""

    def restart(self, forget: bool = False) -> None:
        """End the daemon and start it anew.

        forget : what it knows of its gauges but for machine zero, so that they are believed as they are.
        """
        self.end_daemon()
        if forget:
            for path in self.state.iterdir():
                if path.name != MACHINE_ZERO:
                    path.unlink()
        self.start_daemon()

    @abstractmethod
    def repair(self) -> None:
        """No fault on any line, no hostile client, and a daemon that runs with its own configuration."""

    # --- clients

    @abstractmethod
    def watched(self) -> AbstractContextManager[Watched]:
        """A client that takes every setpoint."""

    @abstractmethod
    def accept(self) -> None:
        """A person has looked at every gauge. Raises DaemonError where that is refused."""

    @abstractmethod
    def ask_all(self) -> None:
        """Ask STATUS and MODEL. Raises DaemonError where one cannot be asked."""

    @abstractmethod
    def hold(self, seen: Sequence[Seen]) -> list[Held]:
        """Each of these setpoints against the truth of its time."""

    def until_ok(self, watcher: Watched, patience_s: float) -> bool:
        """Whether the state becomes ok within this time."""
        since, end_s = len(watcher.seen), self.now_s + patience_s
        while self.now_s < end_s:
            if any(seen["state"] == State.OK for seen in watcher.seen[since:]):
                return True
            self.rest_for(LOOK_EVERY_S)
        return False


def prepare(configuration: dict[str, Any]) -> None:
    """Change a configuration document as the matrix needs it."""
    configuration["loop"]["rate_hz"] = RATE_HZ
    configuration.setdefault("sockets", {})["valid_for_s"] = VALID_FOR_S
    add_votes(configuration)


def add_votes(configuration: dict[str, Any]) -> None:
    """Let the gauges of a configuration document be compared with each other, as far as they can."""
    configuration["votes"] = VOTES


def exchange_ports(configuration: dict[str, Any], one: str, other: str) -> None:
    """Two lines of a configuration document have each other's port."""
    first, second = (configuration["lines"][name] for name in (one, other))
    first["port"], second["port"] = second["port"], first["port"]
