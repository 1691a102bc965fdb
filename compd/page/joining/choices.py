"""The choices made in the page, as arguments of the reader and the join, and as a command line."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from compd.errors import CompdError, Problem
from compd.instruments import ANGLE_ORDERS, ReadLimits, ReadOptions, instrument_formats
from compd.joining import JOIN_BY, Instrument, JoinOptions, LogOptions, reflector_places

Value = TypeVar("Value", str, float, int)

_MAX_TEXT = 200
_MAX_COLUMNS = 500
# Most rows of an export in the page, so that an answer takes at most a minute or two.
LIMITS = ReadLimits(lines=2_000_000, cells=8_000_000, sheet_cells=1_000_000, unpacked_bytes=150_000_000)
# Control characters and surrogates.
_NO_TEXT = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]")
_DATES = ("dmy", "mdy", "ymd")
_FRAMES = ("instrument", "machine")


@dataclass(frozen=True)
class Choices:
    """read : options of the export's reader. join : options for matching its rows with the gauges.
    reflectors : where each of several is, as a person wrote it, NAME=X,Y,Z.
    log : of the machine's own log, whose columns are named by `log_roles` in their order; None where a recording of
        the gauges is joined.
    """

    read: ReadOptions
    join: JoinOptions
    log: LogOptions | None = None
    reflectors: tuple[str, ...] = ()
    log_roles: tuple[str, ...] = ()

    def command(self, gauges: Path, export: Path, out: Path) -> str:
        """The equivalent command line."""
        read, join = self.read, self.join
        instrument = join.instrument
        options = {
            "--as": read.shape,
            "--columns": ",".join(read.columns) or None,
            "--unit": read.unit,
            "--angle-unit": read.angle_unit,
            "--angles": read.angles,
            "--decimal": read.decimal,
            "--dates": read.dates,
            "--rate-hz": read.rate_hz,
            "--group": read.group,
            "--sheet": read.sheet,
            "--by": join.by,
            "--offset": join.offset_s,
            "--frame": instrument.frame if instrument.frame != Instrument().frame else None,
            "--sigma-um": instrument.sigma_um,
            "--sigma-urad": instrument.sigma_urad,
            "--link": instrument.link,
            "--ball": instrument.ball,
            "--machine": join.machine,
            "--plan": join.plan,
        }
        words = ["compd", "recording", "join", str(gauges), str(export), str(out)]
        for option, value in options.items():
            if value is not None:
                words += [option, repr(value) if isinstance(value, float) else str(value)]
        words += [word for text in self.reflectors for word in ("--reflector-place", text)]
        flags = {"--moving": join.moving, "--clock-set-back": read.clock_set_back}
        words += [flag for flag, is_set in flags.items() if is_set]
        return shlex.join([*words, *([] if self.log is None else _log_words(self.log))])


def _log_words(log: LogOptions) -> list[str]:
    read = log.read
    options = {
        "--log-as": read.shape,
        "--log-sheet": read.sheet,
        "--log-decimal": read.decimal,
        "--log-dates": read.dates,
        "--log-angles": read.angles,
    }
    words = [word for text in log.named for word in ("--log", text)]
    words += [word for option, value in options.items() if value is not None for word in (option, value)]
    return [*words, *["--log-clock-set-back"] * read.clock_set_back]


def read_choices(keys: Mapping[str, Any], machine: Path | None, plan: Path | None) -> Choices:
    """The choices in a browser's order; a key that is missing, null or "" is detected.

    Raises CompdError with every key that is of a wrong kind.
    """
    problems: list[Problem] = []

    def choice(name: str, kind: type[Value], allowed: str, among: tuple[str, ...] = ()) -> Value | None:
        value = keys.get(name)
        if value is None or value == "":
            return None
        if (among and value in among) or (not among and _is(value, kind)):
            return kind(value)
        problems.append(Problem(name, "is not understood", value=ascii(value)[:80], allowed=allowed))
        return None

    def text(name: str, among: tuple[str, ...] = ()) -> str | None:
        return choice(name, str, ", ".join(among) or "a short text", among)

    def roles(name: str) -> tuple[str, ...]:
        columns = keys.get(name) or []
        if (
            not isinstance(columns, list)
            or len(columns) > _MAX_COLUMNS
            or not all(_is(role, str) and "," not in role for role in columns)
        ):
            problems.append(Problem(name, "is not understood", allowed="a role for each column"))
            return ()
        return tuple(columns)

    log = None
    if keys.get("log"):
        log_read = ReadOptions(
            shape=text("log_shape", tuple(instrument_formats())),
            angles=text("log_angles", tuple(ANGLE_ORDERS)),
            decimal=text("log_decimal", (".", ",")),
            dates=text("log_dates", _DATES),
            clock_set_back=keys.get("log_clock_set_back") is True,
            sheet=text("log_sheet"),
            limits=LIMITS,
        )
        log = LogOptions(read=log_read)
    read = ReadOptions(
        shape=text("shape", tuple(instrument_formats())),
        columns=roles("columns"),
        unit=text("unit"),
        angle_unit=text("angle_unit"),
        angles=text("angles", tuple(ANGLE_ORDERS)),
        decimal=text("decimal", (".", ",")),
        dates=text("dates", _DATES),
        rate_hz=choice("rate_hz", float, "a number, Hz"),
        clock_set_back=keys.get("clock_set_back") is True,
        group=text("group"),
        sheet=text("sheet"),
        limits=LIMITS,
    )
    reflectors = tuple(filter(None, map(str.strip, (text("reflectors") or "").split(";"))))
    places: Mapping[str, Any] = {}
    try:
        places = reflector_places(reflectors)
    except CompdError as error:
        problems += error.problems
    instrument = Instrument(
        frame="machine" if text("frame", _FRAMES) == "machine" else "instrument",
        sigma_um=choice("sigma_um", float, "a number, um"),
        link=choice("link", int, "the number of a link"),
        sigma_urad=choice("sigma_urad", float, "a number, urad"),
        ball=_positive("ball", choice("ball", int, "the number of a ball, from 1"), problems),
        reflectors=places,
    )
    by = text("by", JOIN_BY)
    join = JoinOptions(
        instrument,
        by=next((known for known in JOIN_BY if known == by), None),
        offset_s=choice("offset_s", float, "a number, s"),
        moving=keys.get("moving") is True,
        machine=machine,
        plan=plan,
    )
    log_roles = roles("log_columns")
    if problems:
        raise CompdError(problems)
    return Choices(read, join, log, reflectors, log_roles)


def _is(value: Any, kind: type) -> bool:
    """Checks of a JSON value: a short text on one line, a finite number, a whole number."""
    if kind is str:
        return isinstance(value, str) and len(value) <= _MAX_TEXT and not _NO_TEXT.search(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 1e15 and math.isfinite(value) and (kind is float or float(value).is_integer())


def _positive(name: str, number: int | None, problems: list[Problem]) -> int | None:
    if number is not None and number < 1:
        problems.append(Problem(name, "is not understood", value=str(number), allowed="1 or more"))
    return number
