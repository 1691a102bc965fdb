#!/usr/bin/python3
"""HAL component `compd`: corrections of the compd daemon as pins, for as long as they may be used.

    loadusr -Wn compd /usr/bin/python3 ./compd_bridge.py --links 6 --limit 0.2 /run/compd/hexapod.sock

| pin                | type      | meaning                                                                          |
|--------------------|-----------|----------------------------------------------------------------------------------|
| compd.link.N.offset | float out | to be added to the command of link N, through limit3, mm                        |
| compd.link.N.asked  | float out | the last correction that compd asked for and that may be used, mm               |
| compd.heartbeat     | bit out   | toggles with every good setpoint, and else not                                   |
| compd.armed         | bit out   | corrections are applied                                                          |
| compd.fault         | bit out   | they were switched off by what `reason` says, or could not be switched on        |
| compd.reason        | u32 out   | number of the reason: `compd_bridge.py --reasons` prints them                    |
| compd.connected     | bit out   | the daemon has greeted                                                           |
| compd.age           | float out | since the last good setpoint, s                                                  |
| compd.arm           | bit in    | a rising edge arms, FALSE disarms                                                |
| compd.suspend       | bit in    | hold the offsets, during a measurement or a cut                                  |
| compd.clear         | bit in    | while not armed: offsets to 0                                                    |
| compd.machine-on    | bit in    | halui.machine.is-on                                                              |
| compd.homed         | bit in    | motion.is-all-homed                                                              |
| compd.base.N.x ..   | float out | with --live-base: how far base joint N has moved, mm                             |
| compd.pose.x .. c   | float in  | with --live-base: the commanded pose, axis.x.pos-cmd and so on                   |

The standard library and LinuxCNC's `hal` alone.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import hal
from compd_arming import REASONS, Arming, Inputs, Outputs
from compd_live_base import Hexapod, base_shifts_mm, length_changes_mm, read_geometry
from compd_setpoints import Judge, Refused, Setpoint, Stream

# A setpoint is read as soon as it comes; without one the loop looks at its pins so often.
PERIOD_S = 0.005


class Bridge:
    """The component, its connection to the daemon, and what the last messages were."""

    def __init__(
        self, component: hal.component, stream: Stream, links: int, limit_mm: float, live_base: Hexapod | None
    ) -> None:
        """live_base : nominal joints of genhexkins, whose base is to follow the frame; None to leave it."""
        self._pins = component
        self._live_base = live_base
        self._stream = stream
        self._links, self._limit_mm = links, limit_mm
        self._judge = self._new_judge()
        self._setpoint: Setpoint | None = None
        self._refusal = 0
        self._arming = Arming(time.monotonic())
        for link in range(links):
            for name in ("offset", "asked"):
                component.newpin(f"link.{link}.{name}", hal.HAL_FLOAT, hal.HAL_OUT)
        for name in ("heartbeat", "armed", "fault", "connected"):
            component.newpin(name, hal.HAL_BIT, hal.HAL_OUT)
        for name in ("arm", "suspend", "clear", "machine-on", "homed"):
            component.newpin(name, hal.HAL_BIT, hal.HAL_IN)
        component.newpin("reason", hal.HAL_U32, hal.HAL_OUT)
        component.newpin("age", hal.HAL_FLOAT, hal.HAL_OUT)
        if live_base is not None:
            for link in range(links):
                for axis in "xyz":
                    component.newpin(f"base.{link}.{axis}", hal.HAL_FLOAT, hal.HAL_OUT)
            for axis in "xyzabc":
                component.newpin(f"pose.{axis}", hal.HAL_FLOAT, hal.HAL_IN)

    def run(self) -> None:
        """Until the process is told to end."""
        while True:
            self._stream.wait(PERIOD_S)
            self.step()

    def step(self) -> None:
        """Read what has come and the pins, and write what follows."""
        self._read()
        self._write(self._arming.step(self._inputs()))

    def _new_judge(self) -> Judge:
        return Judge(self._links, self._limit_mm, self._stream.same_clock, self._live_base is not None)

    def _read(self) -> None:
        for message in self._stream.poll():
            if message.get("class") == "VERSION":
                self._judge, self._setpoint, self._refusal = self._new_judge(), None, 0
            elif message.get("class") == "SETPOINT":
                verdict = self._judge.judge(message, time.monotonic())
                if isinstance(verdict, Refused):
                    self._refusal = verdict.reason
                else:
                    self._setpoint, self._refusal = verdict, 0

    def _inputs(self) -> Inputs:
        pins = self._pins
        return Inputs(
            now_s=time.monotonic(),
            arm=pins["arm"],
            clear=pins["clear"],
            suspend=pins["suspend"],
            machine_on=pins["machine-on"],
            homed=pins["homed"],
            connected=self._stream.greeted,
            setpoint=self._setpoint,
            refusal=self._refusal,
        )

    def _write(self, outputs: Outputs) -> None:
        pins = self._pins
        if self._setpoint is not None:
            for link, asked_mm in enumerate(self._setpoint.correction_mm):
                pins[f"link.{link}.asked"] = asked_mm
        if outputs.zero:
            self._write_offsets([0.0] * self._links, [[0.0] * 3] * self._links)
        elif outputs.applied is not None:
            self._apply(outputs.applied)
        pins["armed"] = outputs.armed
        pins["fault"] = outputs.fault
        pins["reason"] = outputs.reason
        pins["connected"] = self._stream.greeted
        pins["age"] = outputs.age_s
        # last: a beat says that all of the above is written
        pins["heartbeat"] = outputs.heartbeat

    def _apply(self, setpoint: Setpoint) -> None:
        if self._live_base is None or setpoint.frame is None:
            self._write_offsets(setpoint.correction_mm, [])
            return
        pose = [self._pins[f"pose.{axis}"] for axis in "xyzabc"]
        shifts_mm = base_shifts_mm(self._live_base, setpoint.frame)
        made_mm = length_changes_mm(self._live_base, pose, shifts_mm)
        offsets_mm = [all_mm - base_mm for all_mm, base_mm in zip(setpoint.correction_mm, made_mm, strict=True)]
        self._write_offsets(offsets_mm, shifts_mm)

    def _write_offsets(self, offsets_mm: Sequence[float], shifts_mm: Sequence[Sequence[float]]) -> None:
        for link, offset_mm in enumerate(offsets_mm):
            self._pins[f"link.{link}.offset"] = offset_mm
        if self._live_base is not None:
            for link, shift_mm in enumerate(shifts_mm):
                for axis, way_mm in zip("xyz", shift_mm, strict=True):
                    self._pins[f"base.{link}.{axis}"] = way_mm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", nargs="?", help="the daemon's Unix socket, or host:port")
    parser.add_argument("--links", type=int, choices=(3, 6), default=6, help="links of the machine")
    parser.add_argument("--limit", type=float, default=0.2, help="largest correction of a link that is used, mm")
    parser.add_argument("--token-file", type=Path, help="the daemon's token, for host:port")
    parser.add_argument(
        "--live-base", metavar="GEOMETRY.hal", type=Path, help="let the base joints of genhexkins follow the frame"
    )
    parser.add_argument("--reasons", action="store_true", help="print what the numbers of the pin `reason` mean")
    options = parser.parse_args()
    if options.reasons:
        print("\n".join(f"{number:2}  {text}" for number, text in sorted(REASONS.items())))
        return
    if options.address is None:
        parser.error("address: the daemon's Unix socket is needed, or host:port")
    live_base = read_geometry(options.live_base.read_text()) if options.live_base else None
    token = options.token_file.read_text().strip() if options.token_file else None
    component = hal.component("compd")
    bridge = Bridge(component, Stream(options.address, token), options.links, options.limit, live_base)
    # LinuxCNC ends its components with SIGTERM
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    component.ready()
    try:
        bridge.run()
    except KeyboardInterrupt:
        pass
    finally:
        component.exit()


if __name__ == "__main__":
    main()
