"""The columns of a recording: names, units and decimals, and suggestions for unknown names."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from typing import NamedTuple

from compd.operation_settings import measured_distances
from compd.tables import ProblemList, Table
from compd.units import KNOWN_UNITS, REFERENCE_UNITS, conversion_text, unit_of

AXES = ("x", "y", "z")
ATTITUDES = ("rx", "ry", "rz")
ID_COLUMNS = ("session", "visit", "point", "ball", "pin", "reflector")
# Those whose ids may be texts.
TEXT_ID_COLUMNS = ("point", "ball", "pin", "reflector")
DISTANCE_COLUMN = "reference_distance_mm"
SKEW_COLUMN = "skew_s"
# What people read in place of time where none was recorded.
ROW_ORDER = "order of rows"
POSITION_COLUMNS = tuple(f"reference_{axis}_mm" for axis in AXES)
MODEL_COLUMNS = tuple(f"model_{axis}_mm" for axis in AXES)
ATTITUDE_COLUMNS = tuple(f"reference_{axis}_rad" for axis in ATTITUDES)
QUATERNION_COLUMNS = tuple(f"reference_q{part}" for part in "xyzw")
COMMANDED_COLUMNS = tuple(f"commanded_{axis}_mm" for axis in AXES)
COMMANDED_ATTITUDE_COLUMNS = tuple(f"commanded_{axis}_rad" for axis in ATTITUDES)
COMMANDED_QUATERNION_COLUMNS = tuple(f"commanded_q{part}" for part in "xyzw")
# Decimals by unit: a picometre, a microsecond, a tenth of a nanoradian. Finer than any gauge, and coarse enough
# that the conversion from mm to um leaves no digits of its own behind. Other units are written in full.
DECIMALS = {"mm": 9, "um": 6, "s": 6, "rad": 10}


class ColumnKind(NamedTuple):
    """A column of the format, or several of one kind.

    Attributes
    ----------
    names : as people write them, `<i>` for a number from 1.
    stem : what matches the name without its unit.
    unit : the unit that the format gives it; "" = no unit.
    meaning : for the reference.
    """

    names: str
    stem: re.Pattern[str]
    unit: str
    meaning: str

    @property
    def units(self) -> tuple[str, ...]:
        """The unit; for lengths of the reference and for derivatives also those that `reference.unit` allows."""
        of_reference = self.unit == "mm" and self.names.startswith(("reference_", "d_"))
        of_reference &= self.names != DISTANCE_COLUMN
        return tuple(REFERENCE_UNITS.values()) if of_reference else (self.unit,)


_SENSITIVITY_STEM = r"d_[A-Za-z]\w*_(?:[xyz]|link_[1-9]\d*)"
COLUMN_KINDS: tuple[ColumnKind, ...] = tuple(
    ColumnKind(names, re.compile(stem), unit, meaning)
    for names, stem, unit, meaning in (
        (
            "time_s",
            r"time",
            "s",
            "seconds from the start, different in every row; rows count in this order, however the file is sorted. "
            "Optional for poses at rest: nothing that depends on time can be told then",
        ),
        (
            "session",
            r"session",
            "",
            "number of an independent measuring session, which cross-validation leaves out as a whole; optional",
        ),
        (
            "visit",
            r"visit",
            "",
            "number of a visit: its rows are immediate repeats, and their scatter is the noise floor; optional",
        ),
        ("point", r"point", "", "number or name of the nominal target; optional"),
        ("scale_<i>_mm", r"scale_[1-9]\d*", "mm", "linear scale of link i, zero at machine zero"),
        (
            "commanded_x_mm, commanded_y_mm, commanded_z_mm",
            r"commanded_[xyz]",
            "mm",
            "in place of the scales, of a machine without: the tip that its controller was told, in {B0}, or on the "
            "work, in {P}, where the tool stands on the plate; those that its target fixes",
        ),
        (
            "commanded_rx_rad, commanded_ry_rad, commanded_rz_rad",
            r"commanded_r[xyz]",
            "rad",
            "the attitude that it was told: rotation vector of {P} in {B0}; left out: that of machine zero",
        ),
        (
            "commanded_qx, commanded_qy, commanded_qz, commanded_qw",
            r"commanded_q[xyzw]",
            "",
            "in place of the rotation vector: the same attitude as a quaternion of length 1, scalar last",
        ),
        ("joint_<k>_um", r"joint_[1-9]\d*", "um", "joint comparator k of the wiring, zero at machine zero"),
        (
            "frame_t<k>_um, frame_u<k>_um",
            r"frame_(?:t[1-3]|u[1-6])",
            "um",
            "frame comparators: change of the distances t1 to t3, u1 to u6 since machine zero",
        ),
        (
            "skew_s",
            r"skew",
            "s",
            "how much later than the oldest the newest length of the row was measured; optional, and no covariate",
        ),
        (
            "approach_<i>",
            r"approach_[1-9]\d*",
            "",
            "1 or -1: the direction in which link i, or axis i of an external model, last moved; without it, from the "
            "scales",
        ),
        (
            "reference_x_mm, reference_y_mm, reference_z_mm",
            r"(?:reference|model)_[xyz]",
            "mm",
            "the tip as the reference instrument measured it, in {M} or in the instrument's frame; any axes; with "
            "another `reference.unit` in the sidecar the name ends in it, as in reference_x_arcsec",
        ),
        (
            "reference_rx_rad, reference_ry_rad, reference_rz_rad",
            r"(?:reference|model)_r[xyz]",
            "rad",
            "the attitude as it was measured: rotation vector of {P} in {M}; optional",
        ),
        (
            "reference_qx, reference_qy, reference_qz, reference_qw",
            r"reference_q[xyzw]",
            "",
            "in place of the rotation vector: the same attitude as a quaternion of length 1, scalar last",
        ),
        (
            "reference_link_<i>_mm",
            r"(?:reference|model)_link_[1-9]\d*",
            "mm",
            "in place of the tip: the change of link i as an interferometer measured it; the unit as that of the tip",
        ),
        (
            "reference_distance_mm",
            r"reference_distance",
            "mm",
            "in place of the tip: the distance from the tip to a fixed ball, by a ballbar or a laser tracer",
        ),
        (
            "ball",
            r"ball",
            "",
            "in place of the tip: number of the ball of a calibrated ball plate that was touched; beside a distance "
            "number or name of the fixed end that it was measured from, optional where there is one",
        ),
        ("pin", r"pin", "", "in place of the tip: number or name of the fixed pin in which the tip was"),
        (
            "reflector",
            r"reflector",
            "",
            "beside a position: number or name of the reflector that was measured in place of the tip; its place is in "
            "the sidecar, `reference.reflectors`",
        ),
        ("temperature_<place>_degC", r"temperature_[a-z][a-z0-9_]*", "degC", "temperature of a part or of the room"),
        (
            "force_x_N, force_y_N, force_z_N",
            r"force_[xyz]",
            "N",
            "force on the tip, in {M}; where the tool stands on the plate, on the work",
        ),
        ("pressure_hPa", r"pressure", "hPa", "air pressure"),
        ("humidity_pct", r"humidity", "pct", "relative humidity of the air"),
        (
            "d_<name>_x_mm, d_<name>_y_mm, d_<name>_z_mm, d_<name>_link_<i>_mm",
            _SENSITIVITY_STEM,
            "mm",
            "derivative of the prediction by the parameter `name` of a model of your own, in mm per unit of the "
            "parameter (in arcsec, where the reference is: d_<name>_x_arcsec): for an effect with `sensitivity: name`, "
            "and for nothing else",
        ),
    )
)
# With `machine: external` there is also a column model_... for every column reference_...; and anything else that was
# measured is a column <name>_<unit>.
# A name that begins like a column of the format but is none: probably misspelt, so no covariate. The angle of a robot's
# joint or of a rotary table, joint_1_deg, is no comparator's or scale's length.
_RESERVED = re.compile(
    r"(?:reference|model|approach|commanded)(?![a-z])"
    r"|(?:scale|joint)(?!_[1-9]\d*_(?:rad|mrad|urad|deg|arcsec)$)(?:_?\d|(?:_[a-z])?_[mun]?m$|$)"
    r"|time(?:_[^_]+)?$|frame_?[tu](?:_?\d|_)|frame_\d"
)
_COVARIATE = re.compile(r"[a-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)+")


class ColumnName(NamedTuple):
    """The parts of a column's name: stem ("scale_1") and unit ("mm", or "" for a column without unit)."""

    stem: str
    unit: str


def scale_columns(links: int) -> tuple[str, ...]:
    """scale_1_mm ... for this many links."""
    return tuple(f"scale_{i}_mm" for i in range(1, links + 1))


def joint_columns(comparators: int) -> tuple[str, ...]:
    """joint_1_um ... for this many joint comparators."""
    return tuple(f"joint_{k}_um" for k in range(1, comparators + 1))


def frame_columns(count: int) -> tuple[str, ...]:
    """frame_t1_um ... frame_u6_um for this many frame comparators; see `measured_distances`."""
    return tuple(f"frame_{distance}_um" for distance in measured_distances(count))


_COMMON = ("time_s", SKEW_COLUMN, *ID_COLUMNS, *frame_columns(9), "pressure_hPa", "humidity_pct")


def approach_columns(links: int) -> tuple[str, ...]:
    """approach_1 ... for this many links."""
    return tuple(f"approach_{i}" for i in range(1, links + 1))


def link_reference_column(link: int) -> str:
    """The column of the change of link `link` (1-based) by interferometer."""
    return f"reference_link_{link}_mm"


def is_sensitivity(name: str) -> bool:
    """Whether `name` is the column of a derivative of a model's prediction by one of its parameters.

    Such a column belongs to an effect; it is nothing that was measured, and no covariate.
    """
    return re.fullmatch(rf"{_SENSITIVITY_STEM}_(?:{'|'.join(REFERENCE_UNITS.values())})", name) is not None


def decimals(name: str) -> int | None:
    """Decimals of the column `name` in a written file; None: written in full."""
    if is_sensitivity(name):  # mm per any unit may be small
        return None
    column = parse_name(name)
    return DECIMALS.get(column.unit if column else unit_of(name))


def number_text(value: float) -> str:
    """A number as a cell holds it: the shortest text that reads back as the same float, without a needless ".0"."""
    return repr(value).removesuffix(".0")


def parse_name(name: str) -> ColumnName | None:
    """The parts of a column name of the format; None for every other name."""
    for kind in COLUMN_KINDS:
        for unit in kind.units:
            stem = name.removesuffix(f"_{unit}") if unit else name
            if (stem != name or not unit) and kind.stem.fullmatch(stem):
                return ColumnName(stem, unit)
    return None


def is_covariate(name: str) -> bool:
    """Whether `name` may be another measured quantity: <name>_<unit>, unlike any column of the format."""
    return not _RESERVED.match(name) and bool(_COVARIATE.fullmatch(name)) and intended_column(name) in (None, name)


def is_header(cells: Sequence[str]) -> bool:
    """Whether these cells are a recording's header: the time, a reference, or mostly column names (even misspelt)."""
    filled = [cell for cell in cells if cell]
    intended = [intended_column(cell) for cell in filled]
    if any(name is not None and name.startswith("reference_") for name in intended):
        return True
    return "time_s" in intended or sum(name is not None for name in intended) * 2 > max(2, len(filled))


def intended_column(name: str) -> str | None:
    """The column of the format that `name` most probably means; None if there is none.

    Example: "Scale 01 [um]" -> "scale_1_mm", "Temp room °C" -> "temperature_room_degC".
    """
    if parse_name(name):
        return name
    tidy = name.strip().replace("°", "deg").replace("\u00b5", "u").replace("\u03bc", "u").replace("%", "pct")
    tidy = re.sub(r"[^A-Za-z0-9]+", "_", tidy).strip("_")
    tidy = re.sub(r"_0+(?=[1-9])", "_", tidy)
    for unit in sorted(["", *KNOWN_UNITS], key=len, reverse=True):
        if unit and not tidy.lower().endswith(f"_{unit.lower()}"):
            continue
        stem = tidy[: -len(unit) - 1] if unit else tidy
        stem = re.sub(r"(?<=[a-z])(?=\d)", "_", stem.lower())
        stem = re.sub(r"^temp_", "temperature_", stem)
        stem = re.sub(r"frame_(?:([tu])_|_)?(?=[tu1-9])", lambda m: f"frame_{m[1] or ''}", stem)
        for kind in COLUMN_KINDS:
            right = kind.unit
            if kind.stem.fullmatch(stem) and (not right or right == unit or not unit or _convertible(unit, right)):
                return f"{stem}_{right}" if right else stem
    close = difflib.get_close_matches(tidy.lower(), _COMMON, n=1, cutoff=0.85)
    return close[0] if close and not _RESERVED.match(name) else None


def _convertible(unit: str, right: str) -> bool:
    """Whether values in `unit` can be meant for a column in `right`; any unit can for a temperature."""
    return right == "degC" or bool(conversion_text(unit, right)) or unit == "1"


def correct_names(table: Table, problems: ProblemList) -> Table:
    """The table with the intended names; every name outside the format is reported.

    A corrected name is a problem all the same: its values may be in another unit. It is corrected so that the same
    mistake is not reported again as a missing column.
    """
    names: dict[str, str] = {}
    for name in table.letters:
        meant = intended_column(name)
        if meant == name or (meant is None and is_covariate(name)):
            names[name] = name
            if meant is None and not unit_of(name):
                problems.warn(
                    table.place(name),
                    "ends in no unit that is known",
                    name.rsplit("_", 1)[-1],
                    "mm, um, degC, N, hPa, pct, 1, ...",
                    "kept as it is; check the name",
                )
        elif meant is not None:
            problems.add(table.place(name), *_wrong_name(name, meant))
            if meant not in table.letters:
                names[name] = meant
        else:
            problems.add(
                table.place(name),
                "no column of the format",
                name,
                "a column of the format, or <name>_<unit> in lower case for anything else measured",
                "rename it, e.g. humidity_pct; a number without unit ends in _1; or delete it",
            )
    return Table(
        table.path,
        {names[name]: letters for name, letters in table.letters.items() if name in names},
        {names[name]: values for name, values in table.columns.items() if name in names},
        table.row,
        {names[name]: labels for name, labels in table.labels.items() if name in names},
        frozenset(names[name] for name in table.wrong if name in names),
    )


def _wrong_name(name: str, meant: str) -> tuple[str, str, str, str]:
    """(what, value, allowed, next step) for a name similar to a column of the format."""
    right = parse_name(meant)
    wanted = right.unit if right else ""
    unit = unit_of(name)
    if wanted and not unit and name == meant.removesuffix(f"_{wanted}"):
        return "has no unit in its name", name, meant, f"name it {meant} if the values are in {wanted}"
    if unit and wanted and unit != wanted:
        how = conversion_text(unit, wanted) or f"give the values in {wanted}"
        return f"is in {unit} by its name", name, meant, f"{how}, and name it {meant}"
    return "is not spelt as the format spells it", name, meant, f"name it {meant}"
