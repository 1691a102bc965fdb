"""Compares a plan played with the kernels of this processor and with those of any: `NUMBA_CPU_NAME=generic`.

`python -m tests.worlds.compare` plays the plan on its stdin and writes one row for each setpoint to its stdout.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import IO, NamedTuple

import numpy as np

from tests.worlds.plan import Plan
from tests.worlds.run import play
from tests.worlds.sight import Sight

# Kernels for any processor.
GENERIC: Mapping[str, str] = {"NUMBA_CPU_NAME": "generic"}
# Setpoints of both may differ by so much, mm.
SAME_MM = 1e-9


class Row(NamedTuple):
    """One setpoint. numbers_mm : its lengths and its bound, mm; empty for an invalid one."""

    seq: int
    time_s: float
    state: str
    numbers_mm: tuple[float, ...]


class Difference(NamedTuple):
    """First setpoint that is not the same. by_mm : largest difference; nan where the states differ."""

    here: Row | None
    there: Row | None
    by_mm: float

    def __str__(self) -> str:
        if self.here is None or self.there is None:
            return "one of them ends earlier"
        where = f"setpoint {self.here.seq} at {self.here.time_s:.6f} s"
        if self.here.state != self.there.state:
            return f"{where}: {self.here.state} here, {self.there.state} with kernels for any processor"
        return f"{where}: differs by {self.by_mm:.3g} mm"


def first_difference(plan: Plan) -> Difference | None:
    """Play a plan twice at once; None where all setpoints are the same within `SAME_MM`."""
    with _playing(plan, {}) as here, _playing(plan, GENERIC) as there:
        assert here.stdout is not None
        assert there.stdout is not None
        try:
            for a, b in zip_longest(_rows(here.stdout), _rows(there.stdout)):
                if (difference := compared(a, b)) is not None:
                    return difference
        finally:
            here.kill()
            there.kill()
    return None


def compared(here: Row | None, there: Row | None) -> Difference | None:
    """The difference of two rows; None where they are the same."""
    if here is None or there is None:
        return Difference(here, there, float("nan"))
    if (here.seq, here.state, len(here.numbers_mm)) != (there.seq, there.state, len(there.numbers_mm)):
        return Difference(here, there, float("nan"))
    by_mm = float(np.nanmax(np.abs(np.subtract(here.numbers_mm, there.numbers_mm)), initial=0.0))
    return None if by_mm <= SAME_MM else Difference(here, there, by_mm)


def _playing(plan: Plan, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """A process that plays a plan and writes its rows."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.worlds.compare"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **environment},
    )
    assert process.stdin is not None
    process.stdin.write(plan.to_json().encode())
    process.stdin.close()
    return process


def _rows(stream: IO[bytes]) -> Iterator[Row]:
    while True:
        try:
            yield Row(*pickle.load(stream))
        except EOFError:
            return


def _row(sight: Sight) -> Row:
    setpoint, told = sight.setpoint, sight.told
    numbers: tuple[float, ...] = ()
    if setpoint.values is not None:
        values = setpoint.values
        lengths = (values.tip_M_mm, values.link_length_mm, values.scale_setpoint_mm, values.correction_mm)
        numbers = (*np.concatenate(lengths).tolist(), 1e-3 * told.u_tip_um)
    return Row(setpoint.seq, told.time_s, told.state.value, numbers)


def main() -> None:
    """Play the plan on stdin."""
    out = sys.stdout.buffer
    play(Plan.from_json(sys.stdin.read()), hear=lambda sight: pickle.dump(tuple(_row(sight)), out))
    out.flush()


if __name__ == "__main__":
    main()
