"""A gauge driver that does what no driver may, when a test says so.

`Misdeeds` copies this file into a directory; the configuration names it as `driver: /directory/misbehaving.py:Dial`.
The gauge is a healthy thermometer until the test writes the name of one of `MISDEEDS` into the file `misdeed` beside
the driver, which looks into it at every poll. "NAME once" is done in one poll.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import structlog

from compd.gauge import ByteLine, Channel, Gauge, Reading, good

# The gauge in the configuration: the only one on its line.
DIAL = "dial"
DIAL_PROCESS = f"line {DIAL}"
DIAL_CHANNEL = f"{DIAL}.value"
ORDER = Path(__file__).with_name("misdeed")
SHOWN_DEGC = 20.0
HELD_S = 0.5
EATEN_BYTES = 50_000_000
FLOOD_LINES = 1000


class Dial(Gauge[ByteLine]):
    """A thermometer that asks no device. kept : what it never gives back."""

    def __init__(self, options: object) -> None:
        super().__init__(options)
        self.kept: list[bytes] = []

    @property
    def channels(self) -> Sequence[Channel]:
        return [Channel("value", "degC")]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        time_s = time.monotonic()
        name, _, times = ordered().partition(" ")
        if times == "once":
            ORDER.unlink()  # first: the misdeed may be the end of this process
        if name:
            MISDEEDS[name](self)
        return [good(SHOWN_DEGC, time_s)]


def ordered() -> str:
    """The order that stands now; "" for none."""
    try:
        return ORDER.read_text()
    except FileNotFoundError:
        return ""


def _keep_interpreter(dial: Dial) -> None:
    """A call into C that does not release the interpreter, as of a vendor's library."""
    ctypes.PyDLL(None).usleep(round(HELD_S * 1e6))


def _crash(dial: Dial) -> None:
    """SIGSEGV."""
    ctypes.string_at(0)


def _exit(dial: Dial) -> None:
    """What a library does that thinks it owns the program."""
    os._exit(3)


def _eat_memory(dial: Dial) -> None:
    dial.kept.append(b"\xa5" * EATEN_BYTES)  # written, so that the pages are there


def _flood_log(dial: Dial) -> None:
    print("\n".join(f"dial: {SHOWN_DEGC} degC, {i}" for i in range(FLOOD_LINES)), flush=True)
    structlog.get_logger().warning("dial read", value=SHOWN_DEGC)


def _raise_error(dial: Dial) -> None:
    raise RuntimeError("no such dial")


def _spin(dial: Dial) -> None:
    """For ever, as far as anybody but the test is concerned."""
    while ordered():
        for _ in range(3_000_000):
            pass


MISDEEDS: Mapping[str, Callable[[Dial], None]] = {
    "keep_interpreter": _keep_interpreter,
    "crash": _crash,
    "exit": _exit,
    "eat_memory": _eat_memory,
    "flood_log": _flood_log,
    "raise_error": _raise_error,
    "spin": _spin,
}


class Misdeeds:
    """The test's side: the copy of this file in `directory`, and the orders to it."""

    def __init__(self, directory: Path) -> None:
        self._file = directory / "misbehaving.py"
        shutil.copyfile(__file__, self._file)
        self._file.chmod(0o644)  # what others may write is refused as a driver

    @property
    def driver(self) -> str:
        """For the configuration."""
        return f"{self._file}:Dial"

    def begin(self, name: str, once: bool = False) -> None:
        """Do this at every poll from now on, or at the next one only."""
        assert name in MISDEEDS
        new = self._order.with_suffix(".new")
        new.write_text(f"{name} once" if once else name)
        new.rename(self._order)

    def end(self) -> None:
        """Be healthy again."""
        self._order.unlink(missing_ok=True)

    @property
    def _order(self) -> Path:
        return self._file.with_name(ORDER.name)
