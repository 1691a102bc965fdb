"""Converter for a column of numbers in a description, as narrow as the captured numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence

# Signs in front of a number, blanks among them.
_SIGNED = re.compile(rb" *[+-]")


def number_converter(texts: Sequence[bytes], mark: str, name: str, shown_decimals: int | None) -> tuple[str, str]:
    """The converter of a number, and a note for looking up in the manual ("" for none).

    texts : the number in every reply. mark : its decimal mark. name : its channel, "" if there is one.
    shown_decimals : how many decimals belong to the number; the digits behind them are skipped.
    """
    exponent = any(b"e" in text.lower() for text in texts)
    decimals = {len(re.split(rb"[eE]", text)[0].partition(mark.encode())[2]) for text in texts}
    signed = all(_SIGNED.match(text) for text in texts)
    blank = all(text[:1] in b"+- " for text in texts) and not signed
    fixed = len({len(text) for text in texts}) == 1
    zeros = fixed and all(re.match(rb"[+-]?0\d", text) for text in texts)
    note = head = tail = ""
    if not fixed:
        blanks = min(len(text) - len(text.lstrip(b" ")) for text in texts)
        head, blank = " " * blanks, False
        note = f"{name or 'the number'} has no fixed width: a digit lost on the wire cannot be found"
    (places,) = decimals if len(decimals) == 1 else (None,)
    width = len(texts[0]) if fixed else None
    point = any(mark.encode() in text for text in texts)
    if point and places is None:
        note = f"{name or 'the number'} has no fixed count of decimals: a digit lost on the wire cannot be found"
    elif width and places and shown_decimals is not None and 0 < shown_decimals < places:
        skipped = places - shown_decimals
        width, places, tail = width - skipped, shown_decimals, f"%*{skipped}[0-9]"
        note = f"the {skipped} digits behind {name or 'the number'} are skipped: a checksum in them is not checked"
    kind = "e" if exponent else "f" if point else "d"
    flag = "+" if signed else " " if blank else ""
    precision = f".{places}" if places is not None and (places or exponent) else ""
    channel = f"({name})" if name else ""
    return f"{head}%{channel}{flag}{'0' if zeros else ''}{width or ''}{precision}{kind}{tail}", note


def skipped_converter(texts: Sequence[bytes], mark: str) -> str:
    """The converter that skips a column of numbers."""
    whole = all(text.isdigit() for text in texts)
    characters = (
        "0-9" if whole else f" +0-9{mark}" + ("Ee" if any(b"e" in text.lower() for text in texts) else "") + "-"
    )
    lengths = {len(text) for text in texts}
    return f"%*{lengths.pop() if len(lengths) == 1 else ''}[{characters}]"
