"""Options about an instrument's export, and the report on its reading."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

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


class ExportForm(NamedTuple):
    """The form of an instrument's export."""

    shape: Annotated[
        Shape | None,
        typer.Option(
            "--as",
            help="The export's format, for a file that is mistaken for another: "
            + ", ".join(f"{declared.name} ({declared.title})" for declared in instrument_formats().values())
            + ".",
        ),
    ] = None
    columns: Annotated[
        str | None,
        typer.Option(
            help="Roles of the columns, in order: time, date, x, y, z, rx, ry, rz, length, name, visit, "
            "reflector, group, collection, or - for one that is not used: name,x,y,z,-. With a unit: time[ms],x[inch].",
        ),
    ] = None
    unit: Annotated[str | None, typer.Option(help="Unit of the lengths, if the file has none.")] = None
    angle_unit: Annotated[str | None, typer.Option(help="Unit of rx, ry, rz, if the file has none.")] = None
    angles: Annotated[
        str | None,
        typer.Option(
            metavar="ORDER",
            help="What rx, ry, rz are: vector; or the order of turning: xyz about fixed axes, XYZ about turned ones.",
        ),
    ] = None
    decimal: Annotated[str | None, typer.Option(help="The decimal mark, '.' or ',', if the file is ambiguous.")] = None
    dates: Annotated[DateOrder | None, typer.Option(help="Order of day, month and year, if the file is ambiguous.")] = (
        None
    )
    rate_hz: Annotated[float | None, typer.Option(help="Rows per second, if rows have no time.")] = None
    clock_set_back: Annotated[
        bool,
        typer.Option(
            "--clock-set-back", help="The times fall by an hour, as summer time ended: the rows after it get one."
        ),
    ] = False
    group: Annotated[
        str | None, typer.Option(help="The group of points to take, if there are several; all for all.")
    ] = None
    sheet: Annotated[str | None, typer.Option(help="The sheet of a workbook, if there are several.")] = None

    def read_as(self, names: Mapping[str, str | None], prefix: str = "--") -> ReadOptions:
        """The options of the reader. Raises typer.BadParameter for an invalid decimal mark.

        names : role -> a column's name.  prefix : of the options of this file.
        """
        from compd.instruments import ReadOptions

        if self.decimal not in (None, ".", ","):
            raise typer.BadParameter("is . or ,", param_hint=f"{prefix}decimal")
        given: dict[str, Any] = self._asdict()
        given |= {key: each.value for key, each in given.items() if isinstance(each, StrEnum)}
        given["columns"] = tuple(self.columns.split(",")) if self.columns else ()
        return ReadOptions(**given, names={role: name for role, name in names.items() if name is not None})


class LogForm(NamedTuple):
    """The form of the machine's own log: each as the one of the export without `log_`."""

    log_shape: Annotated[Shape | None, typer.Option("--log-as", help="The log's format, as --as of the export.")] = None
    log_sheet: Annotated[str | None, typer.Option(help="The log's sheet, if it has several.")] = None
    log_decimal: Annotated[str | None, typer.Option(help="The log's decimal mark, if it is ambiguous.")] = None
    log_dates: Annotated[DateOrder | None, typer.Option(help="The log's order of dates, if it is ambiguous.")] = None
    log_angles: Annotated[
        str | None, typer.Option(metavar="ORDER", help="What the log's angles are, as --angles of the export.")
    ] = None
    log_clock_set_back: Annotated[
        bool, typer.Option("--log-clock-set-back", help="The log's times fall by an hour, as summer time ended.")
    ] = False

    @property
    def read_as(self) -> ReadOptions:
        """The options of the reader."""
        export = ExportForm(**{key.removeprefix("log_"): value for key, value in self._asdict().items()})
        return export.read_as({}, "--log-")


def echo_taken(path: Path, shape: str, taken: Mapping[str, str], left_out: Mapping[str, int]) -> None:
    """Print the contents of an export, column by column, and its unused rows."""
    typer.echo(f"{path}: read as {shape}")
    width = max(map(len, taken), default=0)
    for role, text in taken.items():
        typer.echo(f"    {role:<{width}}  {text}")
    for reason, count in left_out.items():
        typer.echo(f"    {count} row{'s' * (count != 1)} not used: {reason}")
