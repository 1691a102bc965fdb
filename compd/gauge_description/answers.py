"""A person's answers to the questions that a gauge's replies leave open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from compd.errors import CompdError
from compd.gauge_description.capture import unescaped

SKIPPED = "-"
UNKNOWN: Literal["unknown"] = "unknown"
Range = tuple[float, float] | Literal["unknown"]


@dataclass(frozen=True)
class Answers:
    """Each is an option of `compd gauge learn`; an omitted one is asked if the replies leave it open."""

    #: of the numbers on the wire, one for each channel or one for all; () where the replies say them
    units: tuple[str, ...] = ()
    #: of the numbers in the replies, SKIPPED for one that is not read; () for "value", or 1, 2 ...
    names: tuple[str, ...] = ()
    #: [lowest, highest] that each channel can measure, in the unit that compd gives (mm, degC), or UNKNOWN; one for
    #: each channel or one for all
    ranges: tuple[Range, ...] = ()
    #: whole error replies without their terminator, and their quality
    errors: Mapping[bytes, str] = field(default_factory=dict)
    ignored: str = ""  #: letters and signs that may vary beside a number and do not touch its value
    #: words beside a number that multiply it, in the manner of a description: "mm=1|um=0.001", "+=1|-=-1".
    factors: tuple[str, ...] = ()
    constants: tuple[str, ...] = ()  #: digits in front of a number that are no part of it: an address
    #: how many the device shows: digits behind them are skipped; of whole numbers, how many are decimals
    decimals: int | None = None
    decimal_mark: str = ""  #: "." or ","; "" if the replies say it.
    skipped_end: int = 0  #: how many characters at the end of every reply are skipped
    plain: bool = False  #: every digit belongs to its number: no address, checksum or status is glued to it


def range_of(text: str) -> Range:
    """LOWEST,HIGHEST as two numbers, or UNKNOWN. CompdError for anything else."""
    if text == UNKNOWN:
        return UNKNOWN
    try:
        lowest, highest = map(float, text.split(","))
    except ValueError as error:
        allowed = f"--range=-25,25, or --range {UNKNOWN} where the manual does not say"
        raise CompdError.of("--range", "is no range", value=text, allowed=allowed) from error
    return lowest, highest


def error_reply(text: str) -> tuple[bytes, str]:
    """REPLY=QUALITY as the reply's bytes, which may have escapes, and the quality. CompdError for anything else."""
    reply, _, quality = text.rpartition("=")
    try:
        if reply:
            return unescaped(reply), quality
        problem = "has no reply"
    except ValueError as error:
        problem = str(error)
    raise CompdError.of("--error", problem, value=text, allowed="'ERR0=sensor_fault'")


def factor_words(text: str) -> tuple[str, ...]:
    """The words of "mm=1|um=0.001"."""
    return tuple(part.rpartition("=")[0] for part in text.split("|"))
