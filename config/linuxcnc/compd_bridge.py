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

The standard library and LinuxCNC's `hal` alone.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from pathlib import Path

import hal
from compd_arming import REASONS, Arming, Inputs, Outputs
from compd_setpoints import Judge, Refused, Setpoint, Stream

# A setpoint is read as soon as it comes; without one the loop looks at its pins so often.
PERIOD_S = 0.005


class Bridge:
    """The component, its connection to the daemon, and what the last messages were."""

    def __init__(self, component: hal.component, stream: Stream, links: int, limit_mm: float) -> None:
        self._pins = component
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

    def run(self) -> None:
        """Until the process is told to end."""
        while True:
            self._stream.wait(PERIOD_S)
            self._read()
            self._write(self._arming.step(self._inputs()))

    def _new_judge(self) -> Judge:
        return Judge(self._links, self._limit_mm, self._stream.same_clock)

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
        for link in range(self._links):
            if self._setpoint is not None:
                pins[f"link.{link}.asked"] = self._setpoint.correction_mm[link]
            if outputs.zero:
                pins[f"link.{link}.offset"] = 0.0
            elif outputs.applied is not None:
                pins[f"link.{link}.offset"] = outputs.applied.correction_mm[link]
        pins["armed"] = outputs.armed
        pins["fault"] = outputs.fault
        pins["reason"] = outputs.reason
        pins["connected"] = self._stream.greeted
        pins["age"] = outputs.age_s
        # last: a beat says that all of the above is written
        pins["heartbeat"] = outputs.heartbeat


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", nargs="?", help="the daemon's Unix socket, or host:port")
    parser.add_argument("--links", type=int, choices=(3, 6), default=6, help="links of the machine")
    parser.add_argument("--limit", type=float, default=0.2, help="largest correction of a link that is used, mm")
    parser.add_argument("--token-file", type=Path, help="the daemon's token, for host:port")
    parser.add_argument("--reasons", action="store_true", help="print what the numbers of the pin `reason` mean")
    options = parser.parse_args()
    if options.reasons:
        print("\n".join(f"{number:2}  {text}" for number, text in sorted(REASONS.items())))
        return
    if options.address is None:
        parser.error("address: the daemon's Unix socket is needed, or host:port")
    token = options.token_file.read_text().strip() if options.token_file else None
    component = hal.component("compd")
    bridge = Bridge(component, Stream(options.address, token), options.links, options.limit)
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
