"""An instrument's export, read: points or a track of positions or lengths, each with its line in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from compd.arrays import FloatArray, IntArray
from compd.instruments.read_limits import GENEROUS, ReadLimits


@dataclass(frozen=True)
class ReadOptions:
    """What a person says about an export; None and empty: to be found in the file."""

    shape: str | None = None  #: name of the format (`--as`)
    #: roles of the columns in their order (`--columns`): those of `ROLES`; `-` for one that is not used
    columns: tuple[str, ...] = ()
    #: role -> a column's name in the header (`--time`, `--x`, ...).
    names: Mapping[str, str] = field(default_factory=dict)
    unit: str | None = None  #: of the lengths (`--unit`)
    angle_unit: str | None = None  #: of the attitude (`--angle-unit`)
    angles: str | None = None  #: what rx, ry, rz are, one of `ANGLE_ORDERS` (`--angles`)
    decimal: str | None = None  #: "." or "," (`--decimal`).
    dates: str | None = None  #: "dmy", "mdy" or "ymd" (`--dates`)
    rate_hz: float | None = None  #: samples per second where rows have no time (`--rate-hz`)
    #: from where the times fall on, they are an hour later than they say (`--clock-set-back`)
    clock_set_back: bool = False
    group: str | None = None  #: which group of points (`--group`)
    sheet: str | None = None  #: of a workbook (`--sheet`)
    limits: ReadLimits = GENEROUS  #: how much the file may hold


@dataclass(frozen=True)
class InstrumentExport:
    """What was measured, in the order of the file."""

    path: Path  #: the file
    shape: str  #: name of its format
    line: IntArray  #: (N,) line of the file, or row of the sheet, from 1; the number of the sample in a binary file
    axes: tuple[str, ...]  #: of `values`: a subset of x, y, z, all of them with rx, ry, rz, or "length" alone
    values: FloatArray  #: (N, d) mm; attitude: rotation vector, rad
    time_s: FloatArray | None = None  #: (N,) on the instrument's clock; None where rows have no time
    #: standard uncertainty of one time, beside the offset of the clock, s; 0 for stamps as fine as needed
    time_std_s: float = 0.0
    name: tuple[str, ...] | None = None  #: (N,) names of the points; None if they have none
    #: (N,) which rows are repeats of one visit, where the file says it: those with the same text; None without
    visit: tuple[str, ...] | None = None
    reflector: tuple[str, ...] | None = None  #: (N,) names of the reflectors that were measured; None without
    #: what was taken for what, in words for a person: role -> "column 4 'X', mm by the header"
    taken: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)  #: reason -> rows that are not there
