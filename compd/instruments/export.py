"""An instrument's export, read: points or a track of positions or lengths, each with its line in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from compd.arrays import FloatArray, IntArray
from compd.instruments.read_limits import GENEROUS, ReadLimits


@dataclass(frozen=True)
class ReadOptions:
    """What a person says about an export; None and empty: to be found in the file.

    Attributes
    ----------
    shape : name of the format (`--as`).
    columns : roles of the columns in their order (`--columns`): those of `ROLES`; `-` for one that is not used.
    names : role -> a column's name in the header (`--time`, `--x`, ...).
    unit : of the lengths (`--unit`). angle_unit : of the attitude (`--angle-unit`). decimal : "." or "," (`--decimal`).
    angles : what rx, ry, rz are, one of `ANGLE_ORDERS` (`--angles`).
    dates : "dmy", "mdy" or "ymd" (`--dates`). rate_hz : samples per second where rows have no time (`--rate-hz`).
    clock_set_back : from where the times fall on, they are an hour later than they say (`--clock-set-back`).
    group : which group of points (`--group`). sheet : of a workbook (`--sheet`).
    limits : how much the file may hold.
    """

    shape: str | None = None
    columns: tuple[str, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    unit: str | None = None
    angle_unit: str | None = None
    angles: str | None = None
    decimal: str | None = None
    dates: str | None = None
    rate_hz: float | None = None
    clock_set_back: bool = False
    group: str | None = None
    sheet: str | None = None
    limits: ReadLimits = GENEROUS


@dataclass(frozen=True)
class InstrumentExport:
    """What was measured, in the order of the file.

    Attributes
    ----------
    path : the file. shape : name of its format.
    line : (N,) line of the file, or row of the sheet, from 1; the number of the sample in a binary file.
    axes : of `values`: a subset of x, y, z, all of them with rx, ry, rz, or "length" alone.
    values : (N, d) mm; attitude: rotation vector, rad.
    time_s : (N,) on the instrument's clock; None where rows have no time.
    time_std_s : standard uncertainty of one time, beside the offset of the clock, s; 0 for stamps as fine as needed.
    name : (N,) names of the points; None if they have none.
    visit : (N,) which rows are repeats of one visit, where the file says it: those with the same text; None without.
    reflector : (N,) names of the reflectors that were measured; None without.
    taken : what was taken for what, in words for a person: role -> "column 4 'X', mm by the header".
    left_out : reason -> rows that are not there.
    """

    path: Path
    shape: str
    line: IntArray
    axes: tuple[str, ...]
    values: FloatArray
    time_s: FloatArray | None = None
    time_std_s: float = 0.0
    name: tuple[str, ...] | None = None
    visit: tuple[str, ...] | None = None
    reflector: tuple[str, ...] | None = None
    taken: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)
