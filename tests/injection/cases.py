"""The fault matrix: what fails, what is injected for it, what must happen, and how the daemon comes out of it.

One table for the test (tests/system/test_fault_matrix.py), the run that measures (`python -m tests.injection`) and the
page of the documentation (docs/generate/faults.py). The machine is the shipped tripod, at rest with its scales at
`REST_MM`, unless a case says that it drives.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from compd.live.loop.states import State
from tests.injection import clients, faults
from tests.injection.rig import InjectedMachine

# Different for each scale, so that exchanged ones differ.
REST_MM = (2.0, 4.0, 7.0)
# What the links drive where a case moves them.
AWAY_MM = (9.0, 11.0, 14.0)
# At rest without a fault the largest error of thousands of valid setpoints is 0.3 um: gauge noise.
PUBLISHED_UM = 1.0


class Way(Enum):
    """How the daemon comes out of a fault once its cause has gone. The value is for people."""

    UNDISTURBED = "nothing to leave: the setpoints stay `ok`"
    ITSELF = "by itself"
    ACCEPTED = "by `compd accept`"
    UNSEEN = "nothing shows it"


@dataclass(frozen=True)
class Case:
    """One row of the matrix.

    group : heading on the page. fault : what fails, in a user's words. injected : what the injector does.
    begin : does it. must : what must happen. states : one of these must be seen. names : part of a reason that is then
    given. bound_um : of the error of any valid setpoint, from the beginning until the state is ok again.
    way : out of it. at_least_um : of what nothing shows, the error that it makes. watched_s : how long the fault lasts.
    lost : whether the daemon itself ends and the service manager starts it again. sample : runs in `make test`.
    """

    id: str
    group: str
    fault: str
    injected: str
    begin: Callable[[InjectedMachine], None]
    way: Way
    states: frozenset[State] = frozenset()
    names: str = ""
    bound_um: float = PUBLISHED_UM
    at_least_um: float = 0.0
    watched_s: float = 1.5
    lost: bool = False
    sample: bool = False


INVALID = frozenset({State.STOP, State.FAULT})
SUBSTITUTED = frozenset({State.HOLD, State.STOP, State.FAULT})


def on(line: str, make: Callable[[], faults.Fault]) -> Callable[[InjectedMachine], None]:
    """A fault of one line; made anew for every trial, since it keeps a state."""
    return lambda machine: machine.injector.fault(line, make())


def once(line: str, channel: str, mm: float) -> Callable[[InjectedMachine], None]:
    return on(line, lambda: faults.Off((channel,), mm, count=1))


def always(line: str, channel: str, mm: float) -> Callable[[InjectedMachine], None]:
    return on(line, lambda: faults.Off((channel,), mm))


def drifting(line: str, channel: str, mm_per_s: float) -> Callable[[InjectedMachine], None]:
    return on(line, lambda: faults.Off((channel,), drift_per_s=mm_per_s))


def shows(line: str, channel: str, number: float) -> Callable[[InjectedMachine], None]:
    return on(line, lambda: faults.Shows((channel,), number))


def away(*lines: str, s: float = 1.0) -> Callable[[InjectedMachine], None]:
    """Unplugged for so long, and plugged in again as they were."""

    def begin(machine: InjectedMachine) -> None:
        machine.injector.unplug(*lines)
        machine.truth.rest_for(s)
        machine.injector.plug(*lines)

    return begin


def back_with(line: str, channel: str, mm: float, s: float = 2.0) -> Callable[[InjectedMachine], None]:
    """Without power for so long; then the gauge shows another number than before."""

    def begin(machine: InjectedMachine) -> None:
        machine.injector.unplug(line)
        machine.truth.rest_for(s)
        machine.injector.fault(line, faults.Off((channel,), mm))
        machine.injector.plug(line)

    return begin


def while_driving(begin: Callable[[InjectedMachine], None]) -> Callable[[InjectedMachine], None]:
    def both(machine: InjectedMachine) -> None:
        begin(machine)
        machine.truth.drive(AWAY_MM)

    return both


def exchanged(one: str, other: str) -> Callable[[InjectedMachine], None]:
    return lambda machine: machine.injector.exchange(one, other)


def replugged_exchanged(one: str, other: str) -> Callable[[InjectedMachine], None]:
    def begin(machine: InjectedMachine) -> None:
        machine.injector.unplug(one, other)
        machine.injector.exchange(one, other)
        machine.truth.rest_for(0.5)
        machine.injector.plug(one, other)

    return begin


def flaps(*lines: str) -> Callable[[InjectedMachine], None]:
    def begin(machine: InjectedMachine) -> None:
        for _ in range(6):
            machine.injector.replug(*lines)
            machine.truth.rest_for(0.1)

    return begin


def sent(process: str, number: signal.Signals) -> Callable[[InjectedMachine], None]:
    return lambda machine: machine.signal(process, number)


def stopped(machine: InjectedMachine) -> None:
    """The whole daemon is stopped for a second."""
    machine.stop_for(1.0)


ONE_READING = "One reading"
FROM_NOW_ON = "From now on"
COMES_BACK = "A gauge that comes back"
LINE = "Lines"
NO_NUMBER = "Numbers that no gauge can show"
STUCK = "Stuck"
EXCHANGED = "Exchanged"
DRIFT = "Drift"
PROCESSES = "Processes"
CLIENTS = "Clients"

MATRIX: tuple[Case, ...] = (
    # --- one reading
    Case(
        "scale-digit",
        ONE_READING,
        "one digit of one reply of a scale is another one",
        "2.0000 read as 2.7000, once",
        on("scale_1", lambda: faults.OneDigit("position", -1)),
        Way.UNDISTURBED,
        sample=True,
    ),
    Case(
        "scale-1mm-once",
        ONE_READING,
        "one reading of a scale is far off",
        "scale 1 + 1 mm, once",
        once("scale_1", "position", 1.0),
        Way.UNDISTURBED,
    ),
    Case(
        "scale-50um-once",
        ONE_READING,
        "one reading of a scale is off",
        "scale 1 + 50 um, once",
        once("scale_1", "position", 0.05),
        Way.UNDISTURBED,
        sample=True,
    ),
    Case(
        "frame-u1-once",
        ONE_READING,
        "one reading of a frame comparator (Modbus RTU) is off, its CRC is right",
        "u1 + 50 um, once",
        once("frame_u", "u1", 0.05),
        Way.UNDISTURBED,
        sample=True,
    ),
    Case(
        "frame-t1-once",
        ONE_READING,
        "one reading of a frame comparator (Modbus TCP) is off",
        "t1 + 50 um, once",
        once("cabinet", "t1", 0.05),
        Way.UNDISTURBED,
    ),
    Case(
        "joint-once",
        ONE_READING,
        "one reading of a joint comparator is off",
        "head 1 + 50 um, once",
        once("joints", "1", 0.05),
        Way.UNDISTURBED,
    ),
    Case(
        "scale-two-bits",
        ONE_READING,
        "noise on a scale's line",
        "two bits turned in 2 % of the bytes of scale 1",
        on("scale_1", lambda: faults.FlippedBits(0.02, bits=2, seed=1)),
        Way.ITSELF,
        watched_s=4.0,
    ),
    # --- from now on
    Case(
        "scale-jumps",
        FROM_NOW_ON,
        "a scale jumps and stays there",
        "scale 1 + 1 mm from now on",
        always("scale_1", "position", 1.0),
        Way.ACCEPTED,
        INVALID,
        "scale 1",
        sample=True,
    ),
    Case(
        "scale-jumps-50um",
        FROM_NOW_ON,
        "a scale jumps a little and stays there",
        "scale 1 + 50 um from now on",
        always("scale_1", "position", 0.05),
        Way.ACCEPTED,
        INVALID,
        "scale 1",
    ),
    Case(
        "frame-jumps",
        FROM_NOW_ON,
        "a frame comparator is knocked",
        "u1 + 50 um from now on",
        always("frame_u", "u1", 0.05),
        Way.ACCEPTED,
        SUBSTITUTED,
        "u1",
    ),
    Case(
        "joint-jumps",
        FROM_NOW_ON,
        "a joint comparator is knocked",
        "head 1 + 50 um from now on",
        always("joints", "1", 0.05),
        Way.ACCEPTED,
        SUBSTITUTED,
        "joints.1",
    ),
    # --- comes back
    Case(
        "scale-counts-anew",
        COMES_BACK,
        "a scale display without power counts anew",
        "scale 1 unplugged for 2 s; then it shows 5 mm less",
        back_with("scale_1", "position", -5.0),
        Way.ACCEPTED,
        INVALID,
        "scale 1",
        sample=True,
    ),
    Case(
        "joint-back-off",
        COMES_BACK,
        "the joints' unit comes back with a head off",
        "joints unplugged for 2 s; then head 1 + 30 um",
        back_with("joints", "1", 0.03),
        Way.ACCEPTED,
        SUBSTITUTED,
        "joints.1",
    ),
    Case(
        "frame-back-off",
        COMES_BACK,
        "the frame's cabinet is restarted and comes back off",
        "cabinet unplugged for 2 s; then t1 + 20 um",
        back_with("cabinet", "t1", 0.02),
        Way.ACCEPTED,
        SUBSTITUTED,
        "t1",
    ),
    Case(
        "scale-unplugged",
        COMES_BACK,
        "a scale's cable is out and comes back, the machine at rest",
        "scale 1 unplugged for 1 s",
        away("scale_1"),
        Way.ITSELF,
        INVALID,
        "scale 1",
        sample=True,
    ),
    Case(
        "scale-unplugged-driving",
        COMES_BACK,
        "a scale's cable is out while the machine drives",
        "scale 1 unplugged; all links drive 7 mm; plugged in",
        lambda machine: (
            machine.injector.unplug("scale_1"),
            machine.truth.drive(AWAY_MM),
            machine.injector.plug("scale_1"),
        )[0],
        Way.ACCEPTED,
        INVALID,
        "scale 1",
        bound_um=3.0,
    ),
    Case(
        "joints-unplugged",
        COMES_BACK,
        "the joints' cable is out and comes back",
        "joints unplugged for 1 s",
        away("joints"),
        Way.ITSELF,
        SUBSTITUTED,
        "joints",
    ),
    Case(
        "cabinet-reset",
        COMES_BACK,
        "the cabinet's connection is reset, and nobody listens for a while",
        "cabinet unplugged for 1 s",
        away("cabinet"),
        Way.ITSELF,
        SUBSTITUTED,
        "t1",
    ),
    # --- lines
    Case(
        "scale-reply-lost",
        LINE,
        "one reply of a scale is lost",
        "one reply of scale 1 dropped",
        on("scale_1", lambda: faults.Lost(count=1)),
        Way.UNDISTURBED,
        sample=True,
    ),
    Case(
        "scale-short",
        LINE,
        "one reply of a scale is one byte short",
        "one reply of scale 1 without its last byte",
        on("scale_1", lambda: faults.Shorter(count=1)),
        Way.UNDISTURBED,
    ),
    Case(
        "scale-every-20th",
        LINE,
        "a scale's line loses replies now and then",
        "5 % of the replies of scale 1 dropped",
        on("scale_1", lambda: faults.Lost(probability=0.05, seed=2)),
        Way.ITSELF,
        watched_s=5.0,
    ),
    Case(
        "scale-mute",
        LINE,
        "a scale does not answer",
        "no reply of scale 1",
        on("scale_1", lambda: faults.Lost(probability=1.0)),
        Way.ITSELF,
        INVALID,
        "scale 1",
    ),
    Case(
        "joints-mute",
        LINE,
        "the joints' unit does not answer",
        "no reply of joints",
        on("joints", lambda: faults.Lost(probability=1.0)),
        Way.ITSELF,
        SUBSTITUTED,
        "joints",
    ),
    Case(
        "joints-and-frame-mute",
        LINE,
        "two lines at once do not answer",
        "no reply of joints and frame_u",
        lambda machine: [machine.injector.fault(line, faults.Lost(probability=1.0)) for line in ("joints", "frame_u")][
            0
        ],
        Way.ITSELF,
        SUBSTITUTED,
        "frame",
    ),
    Case(
        "scale-late",
        LINE,
        "replies of a scale come after their timeout",
        "replies of scale 1 after 0.2 s, not 0.15 s",
        on("scale_1", lambda: faults.Late(0.2)),
        Way.ITSELF,
        INVALID,
        "scale 1",
    ),
    Case(
        "scale-one-late",
        LINE,
        "one reply of a scale comes after its timeout",
        "one reply of scale 1 after 0.2 s",
        on("scale_1", lambda: faults.Late(0.2, count=1)),
        Way.UNDISTURBED,
    ),
    Case(
        "joints-late",
        LINE,
        "replies of the joints' unit come after their timeout",
        "replies of joints after 0.3 s",
        on("joints", lambda: faults.Late(0.3)),
        Way.ITSELF,
        SUBSTITUTED,
        "joints",
    ),
    Case(
        "scale-reply-behind",
        LINE,
        "a display answers each request with the reply to the one before, driving",
        "scale 1 one reply behind; all links drive 7 mm",
        while_driving(on("scale_1", faults.OneReplyLate)),
        Way.ITSELF,
        bound_um=3.0,
    ),
    Case(
        "frame-reply-behind",
        LINE,
        "Modbus RTU: each request gets the reply to the one before",
        "frame_u one behind",
        on("frame_u", faults.OneReplyLate),
        Way.ITSELF,
        SUBSTITUTED,
        "u1",
        sample=True,
    ),
    Case(
        "cabinet-reply-behind",
        LINE,
        "Modbus TCP: each request gets the reply to the one before",
        "cabinet one behind",
        on("cabinet", faults.OneReplyLate),
        Way.ITSELF,
        SUBSTITUTED,
        "t1",
    ),
    *(
        Case(
            f"{line}-garbage",
            LINE,
            f"random bytes in place of replies: {kind}",
            f"replies of {line} replaced",
            on(line, lambda: faults.Garbage(seed=3)),
            Way.ITSELF,
            states,
            names,
        )
        for line, kind, states, names in (
            ("scale_1", "a scale", INVALID, "scale 1"),
            ("joints", "joint comparators", SUBSTITUTED, "joints"),
            ("frame_u", "Modbus RTU", SUBSTITUTED, "u1"),
            ("cabinet", "Modbus TCP", SUBSTITUTED, "t1"),
        )
    ),
    Case(
        "frame-bits",
        LINE,
        "noise on Modbus RTU",
        "one bit turned in 2 % of the bytes of frame_u",
        on("frame_u", lambda: faults.FlippedBits(0.02, seed=4)),
        Way.ITSELF,
        watched_s=3.0,
    ),
    Case(
        "joints-bits",
        LINE,
        "noise on the joints' line",
        "one bit turned in 0.5 % of the bytes of joints",
        on("joints", lambda: faults.FlippedBits(0.005, seed=5)),
        Way.ITSELF,
        watched_s=4.0,
    ),
    Case(
        "bytes-1ms",
        LINE,
        "an adapter that passes on single bytes",
        "replies of scale 1 byte by byte, 1 ms apart",
        on("scale_1", lambda: faults.ByteByByte(0.001)),
        Way.UNDISTURBED,
    ),
    Case(
        "bytes-3ms",
        LINE,
        "the same, slower, with nine heads",
        "replies of joints byte by byte, 1.5 ms apart",
        on("joints", lambda: faults.ByteByByte(0.0015)),
        Way.UNDISTURBED,
    ),
    Case(
        "scale-flaps",
        LINE,
        "a plug with a loose contact",
        "scale 1 replugged six times",
        flaps("scale_1"),
        Way.ITSELF,
        INVALID,
        "scale 1",
    ),
    Case(
        "cabinet-flaps",
        LINE,
        "a network that comes and goes",
        "the cabinet's connection reset six times",
        flaps("cabinet"),
        Way.ITSELF,
    ),
    # --- no numbers
    Case(
        "register-nan",
        NO_NUMBER,
        "a register holds NaN",
        "u1 = NaN",
        shows("frame_u", "u1", float("nan")),
        Way.ITSELF,
        SUBSTITUTED,
        "u1",
        sample=True,
    ),
    Case(
        "register-inf",
        NO_NUMBER,
        "a register holds infinity",
        "t1 = inf",
        shows("cabinet", "t1", float("inf")),
        Way.ITSELF,
        SUBSTITUTED,
        "t1",
    ),
    Case(
        "register-huge",
        NO_NUMBER,
        "a register holds a number beyond all measure",
        "u1 = 1e30",
        shows("frame_u", "u1", 1e30),
        Way.ACCEPTED,
        SUBSTITUTED | {State.REFUSED},
        "u1",
    ),
    Case(
        "register-denormal",
        NO_NUMBER,
        "a register holds a number of the wrong byte order",
        "u1 = 2.7e-43",
        shows("frame_u", "u1", 2.7e-43),
        Way.ITSELF,
        SUBSTITUTED,
        "u1",
    ),
    # --- stuck
    Case(
        "scale-stuck-driving",
        STUCK,
        "a scale stands while the machine drives",
        "scale 1 repeats; all links drive 7 mm",
        while_driving(on("scale_1", faults.Stuck)),
        Way.ACCEPTED,
        INVALID,
        "scale 1",
        bound_um=3.0,
        sample=True,
    ),
    Case(
        "frame-stuck",
        STUCK,
        "frame comparators repeat their digits",
        "frame_u repeats one reply",
        on("frame_u", faults.Stuck),
        Way.ACCEPTED,
        SUBSTITUTED,
        "frame_u",
        watched_s=12.0,
    ),
    Case(
        "u1-zero",
        STUCK,
        "a frame comparator shows 0.000000 for ever",
        "u1 = 0",
        shows("frame_u", "u1", 0.0),
        Way.ACCEPTED,
        SUBSTITUTED,
        "u1",
        bound_um=2.0,
        watched_s=12.0,
    ),
    Case(
        "cabinet-stuck",
        STUCK,
        "the cabinet repeats its digits",
        "cabinet repeats one reply",
        on("cabinet", faults.Stuck),
        Way.ACCEPTED,
        SUBSTITUTED,
        "cabinet",
        watched_s=12.0,
    ),
    Case(
        "joints-stuck-driving",
        STUCK,
        "the joints' unit repeats one reply while the machine drives",
        "joints repeats; all links drive 7 mm",
        while_driving(on("joints", faults.Stuck)),
        Way.ACCEPTED,
        SUBSTITUTED,
        "joints",
        bound_um=10.0,
    ),
    Case(
        "cabinet-reply-behind-reframed",
        STUCK,
        "a gateway passes on the reply before, with the right transaction",
        "cabinet one reply behind, transaction right",
        on("cabinet", lambda: faults.OneReplyLate(reframed=True)),
        Way.UNSEEN,
    ),
    # --- exchanged
    Case(
        "scales-exchanged",
        EXCHANGED,
        "two scales' cables are exchanged under power",
        "scale 1 and scale 2 exchanged",
        exchanged("scale_1", "scale_2"),
        Way.ACCEPTED,
        INVALID,
        "scale",
        sample=True,
    ),
    Case(
        "scales-replugged",
        EXCHANGED,
        "two scales are unplugged and come back exchanged",
        "scale 1 and scale 2 unplugged, exchanged, plugged in",
        replugged_exchanged("scale_1", "scale_2"),
        Way.ACCEPTED,
        INVALID,
        "scale",
    ),
    Case(
        "heads-exchanged",
        EXCHANGED,
        "two heads are exchanged at their unit",
        "heads 1 and 4 exchanged",
        on("joints", lambda: faults.Exchanged("1", "4")),
        Way.ACCEPTED,
        SUBSTITUTED,
        "joints",
    ),
    # --- drift
    Case(
        "scale-drifts",
        DRIFT,
        "a scale drifts: nothing else measures its link",
        "scale 1 drifts 10 um/s for 3 s",
        drifting("scale_1", "position", 0.01),
        Way.UNSEEN,
        bound_um=60.0,
        at_least_um=20.0,
        watched_s=3.0,
    ),
    Case(
        "joint-drifts",
        DRIFT,
        "a spherical joint's comparator drifts",
        "head 1 drifts 10 um/s for 3 s",
        drifting("joints", "1", 0.01),
        Way.UNSEEN,
        bound_um=60.0,
        at_least_um=20.0,
        watched_s=3.0,
    ),
    Case(
        "ra-drifts",
        DRIFT,
        "a revolute joint's comparator drifts away from the other one",
        "head 2 drifts 10 um/s",
        drifting("joints", "2", 0.01),
        Way.ACCEPTED,
        SUBSTITUTED,
        "joints",
        bound_um=40.0,
        watched_s=8.0,
    ),
    Case(
        "frame-drifts",
        DRIFT,
        "a frame comparator drifts",
        "u1 drifts 10 um/s",
        drifting("frame_u", "u1", 0.01),
        Way.ACCEPTED,
        SUBSTITUTED,
        "u1",
        bound_um=40.0,
        watched_s=8.0,
    ),
    # --- processes
    *(
        Case(
            f"{process}-{number.name.lower()}",
            PROCESSES,
            f"the process `{process}` {verb}",
            f"{number.name}",
            sent(process, number),
            Way.ITSELF,
            watched_s=1.0,
            lost=process in ("service", "supervisor"),
            sample=process == "loop" and number is signal.SIGKILL,
        )
        for process, number, verb in (
            ("loop", signal.SIGKILL, "is killed"),
            ("loop", signal.SIGSTOP, "hangs"),
            ("acquisition", signal.SIGKILL, "is killed"),
            ("acquisition", signal.SIGSTOP, "hangs"),
            ("service", signal.SIGKILL, "is killed"),
            ("supervisor", signal.SIGKILL, "is killed"),
        )
    ),
    Case(
        "daemon-stopped",
        PROCESSES,
        "the whole daemon is stopped and goes on",
        "SIGSTOP, 1 s later SIGCONT",
        stopped,
        Way.ITSELF,
        watched_s=1.0,
    ),
    # --- clients
    *(
        Case(f"client-{name}", CLIENTS, what, injected, clients.attack(name), Way.UNDISTURBED, sample=name == "status")
        for name, (what, injected) in clients.ATTACKS.items()
    ),
)
