"""The columns that a formula may name: what every machine has, what each link has, and every measured quantity."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.errors import Problem
from compd.link_count import scale_count
from compd.model.effects import Observations, Port
from compd.model.formula.program import ColumnCodes
from compd.model.kernels import formula as machine_code

PER_LINK: tuple[Port, ...] = ("scale", "link", "base_joint", "platform_joint")
READING_PORTS: tuple[Port, ...] = ("scale", "joint", "frame")

# Columns that every machine has: at ports with one value per link, at ports of readings, and at all ports.
OF_LINK: Mapping[str, str] = {
    "scale_mm": "reading of the link's scale since machine zero, mm",
    "link_mm": "length of the link, mm",
    "direction": "1 or -1 as the link last moved, 0 where that is not known",
    "velocity_mm_per_s": "speed of the link, mm/s",
    "axial_force_N": "axial force in the link, N, tension positive; needs the force on the tip",
    "temperature_link": "temperature of the link, degC; any other quantity `NAME_link_<i>_UNIT` likewise as "
    "`NAME_link_UNIT`",
}
OF_READING: Mapping[str, str] = {"reading_mm": "the comparator's or the scale's own reading since machine zero, mm"}
ANYWHERE: Mapping[str, str] = {
    "time_s": "time since the recording's first row, s",
    "tip_x_mm": "x of the tip in {M}, mm",
    "tip_y_mm": "y of the tip in {M}, mm",
    "tip_z_mm": "z of the tip in {M}, mm",
}
_NEEDS_OF_LINK: Mapping[str, tuple[str, ...]] = {
    "direction": ("direction",),
    "velocity_mm_per_s": ("motion",),
    "axial_force_N": ("kinematics", "force"),
    "temperature_link": ("temperature_link_{link}_degC",),
    "scale_mm": ("scale",),
    "link_mm": ("kinematics",),
}
_PER_LINK_COLUMN = re.compile(r"^[a-z][a-z0-9_]*_link_[A-Za-z]\w*$")
_OF_ONE_LINK = re.compile(r"_link_\d+_")
_QUANTITY = re.compile(r"^[a-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)+$")


def column_needs(name: str, port: Port) -> tuple[str, ...] | Problem:
    """What has to be measured for a column of a formula at this port, or why there is no such column."""
    if name in ANYWHERE:
        return ("time",) if name == "time_s" else ()
    if name in OF_READING and port in READING_PORTS:
        return ("scale",) if port == "scale" else ()
    per_link = name in OF_LINK or _PER_LINK_COLUMN.match(name) is not None
    if per_link and port not in PER_LINK:
        return Problem("", f"is one per link, and the port {port} has no links", allowed=", ".join(ANYWHERE))
    if per_link:
        needs = _NEEDS_OF_LINK.get(name, (name.replace("_link_", "_link_{link}_", 1),))
        return tuple(need.replace("{link}", "{scale}") for need in needs) if port == "scale" else needs
    if not _QUANTITY.match(name):
        columns = ", ".join((*ANYWHERE, *(OF_LINK if port in PER_LINK else ())))
        return Problem("", "is no column", allowed=f"a measured quantity with its unit (humidity_pct), {columns}")
    return (name,)


def link_column(quantity: str) -> str:
    """How a formula names a quantity that each link has: temperature_link_2_degC as temperature_link_degC."""
    return _OF_ONE_LINK.sub("_link_", quantity, count=1)


_OF_PLACE: Mapping[str, int] = {
    "scale_mm": machine_code.SCALE,
    "link_mm": machine_code.LINK,
    "direction": machine_code.DIRECTION,
    "velocity_mm_per_s": machine_code.VELOCITY,
    "axial_force_N": machine_code.AXIAL_FORCE,
}
_READINGS: Mapping[Port, int] = {
    "scale": machine_code.SCALE,
    "joint": machine_code.JOINT,
    "frame": machine_code.FRAME,
}


_MEASURED = frozenset({machine_code.QUANTITY, machine_code.QUANTITY_OF_PLACE, machine_code.AXIAL_FORCE})


def column_codes(
    names: Sequence[str], port: Port, links: int, quantities: Sequence[str], since_zero: bool
) -> ColumnCodes:
    """What formulas' columns are to a kernel.

    quantities : those that the effect needs, in their order, on a machine with so many links.
    since_zero : whether measured quantities count from machine zero.
    """
    codes: dict[str, tuple[int, int]] = {}
    own: set[str] = set()
    for name in names:
        if name == "reading_mm" or name in _OF_PLACE:
            kind = _READINGS[port] if name == "reading_mm" else _OF_PLACE[name]
            at_scale = machine_code.AT_SCALE if port == "scale" else machine_code.AT_LINK
            codes[name] = (kind, quantities.index("force_x_N") if name == "axial_force_N" else at_scale)
            own.add(name)
        elif name == "time_s":
            codes[name] = (machine_code.TIME, 0)
        elif name in ANYWHERE:
            codes[name] = (machine_code.TIP, "xyz".index(name[4]))
        elif name == "temperature_link" or _PER_LINK_COLUMN.match(name):
            quantity = "temperature_link_degC" if name == "temperature_link" else name
            first = quantity.replace("_link_", "_link_1_", 1)
            codes[name] = (machine_code.QUANTITY_OF_PLACE, quantities.index(first) if links else 0)
            own.add(name)
        else:
            codes[name] = (machine_code.QUANTITY, quantities.index(name))
    measured = {name for name, (kind, _) in codes.items() if since_zero and kind in _MEASURED}
    return ColumnCodes(codes, frozenset(own), frozenset(measured))


def column_values(rows: Observations, name: str, port: Port) -> FloatArray:
    """The values of a column: (N, places of the port), or (N, 1) where all places have the same."""
    if name == "reading_mm":
        return {"scale": rows.scale_mm, "joint": rows.joint_mm, "frame": rows.frame_mm}[port]
    if name in ("scale_mm", "direction", "velocity_mm_per_s"):
        of_scales: FloatArray = getattr(rows, name)
        return of_scales if port == "scale" else rows.of_links(of_scales)
    if name in ("link_mm", "axial_force_N"):
        return np.asarray(getattr(rows, name))
    if name == "time_s":
        return rows.time_s[:, None]
    if name in ANYWHERE:
        return rows.tip_M_mm[:, ["xyz".index(name[4])]]
    if name == "temperature_link":
        name = "temperature_link_degC"
    if _PER_LINK_COLUMN.match(name):
        names = [name.replace("_link_", f"_link_{i + 1}_", 1) for i in range(_places(rows, port))]
        return np.stack([rows.quantity(link_name) for link_name in names], axis=1)
    return rows.quantity(name)[:, None]


def _places(rows: Observations, port: Port) -> int:
    """Number of places of a port that has one for each scale or for each link."""
    return scale_count(rows.links) if port == "scale" else rows.links
