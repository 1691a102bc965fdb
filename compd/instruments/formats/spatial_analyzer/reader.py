"""SpatialAnalyzer's ASCII export: three comment lines, then collection, group, target, coordinates and a stamp.

The comments name the version, the coordinate frame, and the axes with their unit::

    // SpatialAnalyzer SA 2024.2 ( x64 )
    // Points Relative to Coordinate Frame 'A::WORLD'
    // AXES = CARTESIAN: X,  Y,  Z (mm)
    A,  P1,  0,  1200.104312,  -300.201551,  80.005102,  02/12/25 16:52:45
"""

from __future__ import annotations

import re
from dataclasses import replace

from compd.instruments.cells import is_number_column
from compd.instruments.delimited import read_delimited
from compd.instruments.export import ReadOptions
from compd.instruments.formats.spatial_analyzer import AXES
from compd.instruments.raw_table import RawTable
from compd.instruments.text_file import TextFile
from compd.instruments.time_stamps import is_stamp
from compd.tables import ProblemList
from compd.units import unit_named

_FRAME = re.compile(r"coordinate\s+frame\s*:?\s*'?([^']*?)'?\s*$", re.IGNORECASE)
_AXES = re.compile(AXES, re.IGNORECASE)
_NAMES_BEFORE = {1: ("name",), 2: ("group", "name"), 3: ("collection", "group", "name")}


def read_spatial_analyzer(text: TextFile, options: ReadOptions) -> RawTable:
    """The table of such an export; without comments too (`number, x, y, z`). Raises RecordingError."""
    problems = ProblemList(text.path)
    assumed: dict[str, str] = {}
    unit = ""
    for i in [i for i, line in enumerate(map(str.lstrip, text.lines)) if line[:2] == "//"]:
        number, line = i + 1, text.lines[i]
        frame, axes = _FRAME.search(line), _AXES.search(line)
        if frame and assumed.setdefault("frame", frame[1]) != frame[1]:
            problems.add(
                number, f"another frame begins here, after {assumed['frame']}", frame[1], "one frame in a file"
            )
        if axes:
            own = unit_named(axes[3] or "")
            if axes[1].lower() != "cartesian" or [name.strip().lower() for name in axes[2].split(",")] != [
                "x",
                "y",
                "z",
            ]:
                problems.add(number, "the axes are not X, Y, Z", line.strip(), "CARTESIAN: X, Y, Z", "export these")
            elif unit and own != unit:
                problems.add(number, f"units are mixed: {own or 'none'} after {unit}", line.strip(), "one unit")
            elif axes[3] and not own:
                problems.add(number, "the unit is not known", axes[3], "mm, inch, m ...", "export in mm")
            unit = own
    problems.check()
    table = read_delimited(text, options, "sa")
    assumed = {**table.assumed, **assumed}
    roles = () if table.header else _roles(table)
    return replace(table, unit=unit or table.unit, assumed=assumed, roles=roles)


def _roles(table: RawTable) -> tuple[str, ...]:
    """Names, then x, y, z, then a stamp where there is one; empty where the rows have other columns."""
    stamped = is_stamp(table.columns[-1][0])
    before = len(table.columns) - 3 - stamped
    if before not in _NAMES_BEFORE or not all(map(is_number_column, table.columns[before : before + 3])):
        return ()
    return (*_NAMES_BEFORE[before], "x", "y", "z", *(("time",) if stamped else ()))
