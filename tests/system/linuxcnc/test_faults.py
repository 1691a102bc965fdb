"""What goes wrong while LinuxCNC moves the machine: no step, no motion beyond the clamp, no feed, nothing arms again.

The machine is moving with corrections when each fault comes. -rP prints how long the feed took to be inhibited.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import pytest

from controller import obstacle
from tests.injection.faults import Shows
from tests.support.corrected_linuxcnc import SETTLED_MM, CorrectedLinuxCnc, check_corrections, moved_mm
from tests.support.simulated import run_directory
from tests.support.watching import until

# Of the feed, from the fault, s; and of the times in the log, which are those of samples that come in bursts.
INHIBITED_S, LOG_S = 0.3, 0.03
# A program that was inhibited stops within its own deceleration: 20 mm/s at 100 mm/s2.
STOPPED_S = 0.4
STANDS_MM = 1e-5

pytestmark = [
    pytest.mark.long,
    pytest.mark.sample,
    pytest.mark.skipif(bool(obstacle()), reason=obstacle()),
]


@pytest.fixture(scope="module")
def machine() -> Iterator[CorrectedLinuxCnc]:
    with run_directory() as directory, CorrectedLinuxCnc(directory) as machine:
        yield machine


@pytest.fixture
def moving(machine: CorrectedLinuxCnc) -> Iterator[CorrectedLinuxCnc]:
    """Armed and on the move; after the test every sample since then is looked at."""
    machine.move_with_corrections()
    since_s = machine.now_s
    yield machine
    machine.controller.ask("abort")
    check_corrections(machine.samples(since_s))


def stands_inhibited(machine: CorrectedLinuxCnc, fault_s: float, within_s: float = INHIBITED_S) -> float:
    """The feed is inhibited in time, the machine stops, and stays so for a second. Returns how long it took."""
    inhibited_s = machine.inhibited_s(fault_s)
    assert inhibited_s - fault_s <= within_s + LOG_S
    samples = machine.until(
        "it stands",
        inhibited_s,
        lambda samples: samples if samples[-1].time_s > inhibited_s + STOPPED_S + 1.0 else None,
    )
    assert all(sample.inhibited for sample in samples)
    assert moved_mm([sample for sample in samples if sample.time_s > inhibited_s + STOPPED_S]) < STANDS_MM
    return inhibited_s - fault_s


def arms_only_when_asked(machine: CorrectedLinuxCnc, reason: int) -> None:
    """What was wrong is mended: nothing arms by itself in a second, with the button still down; then a person does."""
    machine.controller.wait_for("compd.armed", False)  # a bridge that was stopped disarms with its next step
    assert machine.controller.values(["compd.arm", "compd.armed"]) == {"compd.arm": True, "compd.armed": False}
    assert not any(sample.watched for sample in machine.for_s(1.0))
    assert machine.controller.value("compd.reason") == reason
    machine.controller.arm()
    assert not machine.controller.value("motion.feed-inhibit")


def test_a_bridge_that_is_stopped(moving: CorrectedLinuxCnc) -> None:
    pid, fault_s = moving.stop_bridge()
    try:
        print(f"bridge stopped: inhibited after {stands_inhibited(moving, fault_s):.3f} s")
    finally:
        os.kill(pid, signal.SIGCONT)
    arms_only_when_asked(moving, 13)


def test_a_daemon_that_is_killed(moving: CorrectedLinuxCnc) -> None:
    fault_s = time.monotonic()
    moving.kill_daemon()
    print(f"daemon killed: inhibited after {stands_inhibited(moving, fault_s):.3f} s")
    moving.restart_daemon()
    moving.controller.wait_for("compd.connected", True)

    def a_person_accepts() -> bool:
        """It moved on until the feed was inhibited, and nobody has seen how far."""
        with moving.daemon.connected() as client:
            client.accept("all")
            return bool(next(iter(client.watch(20)))["valid"])

    until("a person is asked for", lambda: moving.daemon.quality("scale_4.position") in ("distrusted", "ok"))
    until("the setpoints are valid", a_person_accepts)
    # no connection, expired, or an invalid setpoint as the last of a daemon whose processes end one by one
    assert moving.controller.value("compd.reason") in (2, 3, 4)
    arms_only_when_asked(moving, moving.controller.value("compd.reason"))


def test_a_scale_that_falls_silent(moving: CorrectedLinuxCnc) -> None:
    """The daemon uses its last reading for `loop.stale_after_s`; from its first invalid setpoint the time counts."""
    with moving.daemon.watched() as watcher:
        unplugged_s, since = time.monotonic(), watcher.now
        moving.injector.unplug("scale_4")
        invalid = watcher.until("it is invalid", lambda seen: not seen["valid"], since)
        took_s = stands_inhibited(moving, invalid["time_s"])
    print(f"scale silent: invalid after {invalid['time_s'] - unplugged_s:.3f} s, inhibited {took_s:.3f} s later")
    moving.injector.repair()
    with moving.daemon.connected() as client:
        # it moved on until the feed was inhibited: a person says that the scale can be believed
        until("the scale answers", lambda: moving.daemon.quality("scale_4.position") in ("distrusted", "ok"))
        client.accept("all")
        next(setpoint for setpoint in client.watch(20) if setpoint["valid"])
    arms_only_when_asked(moving, 3)


def test_a_frame_comparator_that_shows_nan(moving: CorrectedLinuxCnc) -> None:
    """The daemon takes the last good set back to zero; what the motors get is finite and within the slew."""
    since_s = moving.now_s
    moving.injector.fault("frame", Shows(("u1",), float("nan")))
    with moving.daemon.connected() as client:
        faded = next(setpoint for setpoint in client.watch(50) if setpoint["state"] == "fade" or not setpoint["valid"])
    assert faded["reason"]
    check_corrections(moving.samples(since_s))
    if moving.controller.value("compd.armed"):
        assert not any(sample.inhibited for sample in moving.samples(since_s))
    moving.injector.repair()
    with moving.daemon.connected() as client:
        next(setpoint for setpoint in client.watch(20) if setpoint["state"] in ("ok", "slewing"))
    print(f"NaN from a frame comparator: {faded['state']}")


def test_a_program_that_is_aborted_in_the_middle_of_a_move(moving: CorrectedLinuxCnc) -> None:
    since_s = moving.now_s
    moving.controller.do("abort")
    still = moving.for_s(1.0)
    assert moved_mm([sample for sample in still if sample.time_s > since_s + 1.0]) < STANDS_MM
    assert all(sample.watched and not sample.inhibited for sample in moving.samples(since_s))


def test_switching_off_and_on(moving: CorrectedLinuxCnc) -> None:
    fault_s = time.monotonic()
    moving.controller.do("off")
    print(f"switched off: inhibited after {stands_inhibited(moving, fault_s):.3f} s")
    moving.controller.do("on")
    arms_only_when_asked(moving, 11)


def test_homing_again(moving: CorrectedLinuxCnc) -> None:
    """At machine zero, where the shipped machine is homed: the offsets go to 0, limited, until a person arms."""
    moving.go_to_zero()
    fault_s = time.monotonic()
    moving.controller.do("unhome")
    stands_inhibited(moving, fault_s)
    moving.until(
        "the offsets are 0",
        fault_s,
        lambda samples: [sample for sample in samples[-20:] if sample.largest_mm < SETTLED_MM],
    )
    moving.controller.do("home")
    assert moving.for_s(0.5)[-1].largest_mm < SETTLED_MM
    arms_only_when_asked(moving, 12)
    moving.until(
        "corrections are back", fault_s, lambda samples: [s for s in samples[-20:] if s.largest_mm > SETTLED_MM]
    )


# The last of this file: LinuxCNC has to be started anew after it.
def test_a_bridge_that_is_killed(moving: CorrectedLinuxCnc) -> None:
    """The last offsets stay, the feed is inhibited, and nothing can be armed any more."""
    fault_s = time.monotonic()
    os.kill(moving.bridge_pid(), signal.SIGKILL)
    print(f"bridge killed: inhibited after {stands_inhibited(moving, fault_s):.3f} s")
    before = moving.samples(fault_s)[-1].largest_mm
    assert moving.for_s(1.0)[-1].largest_mm == pytest.approx(before, abs=1e-6)
