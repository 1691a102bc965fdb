"""Options about an instrument's export, and the report on its reading."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.instruments import instrument_formats

if TYPE_CHECKING:
    from compd.instruments import ReadOptions

    class Shape(StrEnum):
        """Formats of exports."""

else:
    Shape = StrEnum("Shape", {name: name for name in instrument_formats()})


class DateOrder(StrEnum):
    """Orders of day, month and year."""

    DMY = "dmy"
    MDY = "mdy"
    YMD = "ymd"


ShapeOption = Annotated[
    Shape | None,
    typer.Option(
        "--as",
        help="The export's format, for a file that is mistaken for another: "
        + ", ".join(f"{declared.name} ({declared.title})" for declared in instrument_formats().values())
        + ".",
    ),
]
ColumnsOption = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="Roles of the columns, in order: time, date, x, y, z, rx, ry, rz, length, name, visit, "
        "reflector, group, collection, or - for one that is not used: name,x,y,z,-. With a unit: time[ms],x[inch].",
    ),
]
UnitOption = Annotated[str | None, typer.Option("--unit", help="Unit of the lengths, if the file has none.")]
AngleUnitOption = Annotated[str | None, typer.Option("--angle-unit", help="Unit of rx, ry, rz, if the file has none.")]
AnglesOption = Annotated[
    str | None,
    typer.Option(
        "--angles",
        metavar="ORDER",
        help="What rx, ry, rz are: vector; or the order of turning: xyz about fixed axes, XYZ about turned ones.",
    ),
]
DecimalOption = Annotated[
    str | None, typer.Option("--decimal", help="The decimal mark, '.' or ',', if the file is ambiguous.")
]
DatesOption = Annotated[
    DateOrder | None, typer.Option("--dates", help="Order of day, month and year, if the file is ambiguous.")
]
RateOption = Annotated[float | None, typer.Option("--rate-hz", help="Rows per second, if rows have no time.")]
ClockSetBackOption = Annotated[
    bool,
    typer.Option(
        "--clock-set-back", help="The times fall by an hour, as summer time ended: the rows after it get one."
    ),
]
GroupOption = Annotated[
    str | None, typer.Option("--group", help="The group of points to take, if there are several; all for all.")
]
SheetOption = Annotated[str | None, typer.Option("--sheet", help="The sheet of a workbook, if there are several.")]


def read_options(
    shape: Shape | None,
    columns: str | None,
    names: Mapping[str, str | None],
    unit: str | None,
    angle_unit: str | None,
    decimal: str | None,
    dates: DateOrder | None,
    rate_hz: float | None,
    group: str | None,
    sheet: str | None,
    clock_set_back: bool = False,
    angles: str | None = None,
    prefix: str = "--",
) -> ReadOptions:
    """The options of the reader. Raises typer.BadParameter for an invalid decimal mark.

    names : role -> a column's name.  prefix : of the options of this file.
    """
    from compd.instruments import ReadOptions

    if decimal not in (None, ".", ","):
        raise typer.BadParameter("is . or ,", param_hint=f"{prefix}decimal")
    return ReadOptions(
        shape=shape.value if shape else None,
        columns=tuple(columns.split(",")) if columns else (),
        names={role: name for role, name in names.items() if name is not None},
        unit=unit,
        angle_unit=angle_unit,
        angles=angles,
        decimal=decimal,
        dates=dates.value if dates else None,
        rate_hz=rate_hz,
        group=group,
        sheet=sheet,
        clock_set_back=clock_set_back,
    )


def echo_taken(path: Path, shape: str, taken: Mapping[str, str], left_out: Mapping[str, int]) -> None:
    """Print the contents of an export, column by column, and its unused rows."""
    typer.echo(f"{path}: read as {shape}")
    width = max(map(len, taken), default=0)
    for role, text in taken.items():
        typer.echo(f"    {role:<{width}}  {text}")
    for reason, count in left_out.items():
        typer.echo(f"    {count} row{'s' * (count != 1)} not used: {reason}")
