"""Input of the votes, ten times a second."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from compd.arrays import FloatArray
from compd.live.memory import TrustMemory


class WiredLength(NamedTuple):
    """Kind of a channel: a length, or any other quantity.

    kind : of the gauge. meaning : for people, as "scale 1". sign : +1 or -1. link : from 1, of a scale or a joint; 0.
    role : S, Ra, Rb or B of a joint comparator; "". length_mm : of the distance that a frame comparator measures; nan.
    noise : standard deviation of a reading, mm; of a quantity in its unit; nan where it is not declared.
    """

    kind: Literal["scale", "joint", "frame", "quantity"]
    meaning: str
    sign: int
    link: int
    role: str
    length_mm: float
    noise: float


class MachineView(NamedTuple):
    """The gauges at one time."""

    now_s: float  #: monotonic time, s
    memory: TrustMemory  #: of the channels, with how often each has repeated its digits
    wired: tuple[WiredLength, ...]  #: what each channel measures, (n): lengths, then quantities
    value: FloatArray  #: (n), as read, mm; of quantities in their unit
    believed: npt.NDArray[np.bool_]  #: (n), whether it is
    change: FloatArray  #: (n), mm since machine zero, with its sign; nan without a machine zero, and of quantities
    quantities: Mapping[str, float]  #: temperatures and the rest that are good, by name
    setpoint: Mapping[str, Any] | None  #: the newest SETPOINT message; None before the first

    def of_unit(self, unit: str) -> list[int]:
        """The quantities of this unit."""
        return [i for i in self.of_kind("quantity") if self.memory.unit(i) == unit]

    def of_kind(self, kind: str) -> list[int]:
        """The channels of this kind."""
        return [i for i, wired in enumerate(self.wired) if wired.kind == kind]


class Contradiction(NamedTuple):
    """A channel (by number) that others contradict, with the evidence in words."""

    channel: int
    evidence: str


class Remark(NamedTuple):
    """A believed channel (by number) to be inspected, with the reason; repeated at each look while it lasts."""

    channel: int
    text: str


class Vote(Protocol):
    """One kind of contradiction. A channel that is not believed takes no part, and begins anew when it is again."""

    def look(self, view: MachineView) -> Iterator[Contradiction | Remark]:
        """The channels that are contradicted now, or to be inspected."""
        ...
