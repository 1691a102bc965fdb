"""The formats in which samples are written, by the name that `compd tracker --as` takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from compd.instruments.writers.blanks import write_blanks
from compd.instruments.writers.carto import write_carto
from compd.instruments.writers.delimited import write_csv, write_german, write_iso
from compd.instruments.writers.samples import Samples
from compd.instruments.writers.spatial_analyzer import write_spatial_analyzer
from compd.instruments.writers.workbook import write_workbook


class WrittenFormat(NamedTuple):
    """A format.

    Attributes
    ----------
    write : gives the file's bytes. what : in words, for the help.
    constant_rate : whether rows stand at equal distances in time, because they have no time of their own.
    says_unit : whether the file says the unit of its lengths.
    """

    write: Callable[[Samples], bytes]
    what: str
    constant_rate: bool = False
    says_unit: bool = True


FORMATS: Mapping[str, WrittenFormat] = {
    "csv": WrittenFormat(write_csv, "commas, decimal point, seconds"),
    "iso": WrittenFormat(write_iso, "commas, decimal point, ISO date stamps"),
    "german": WrittenFormat(write_german, "semicolons, decimal comma, German date stamps"),
    "sa": WrittenFormat(write_spatial_analyzer, "SpatialAnalyzer ASCII, stamps of whole seconds"),
    "blanks": WrittenFormat(write_blanks, "numbers between blanks, nothing else", constant_rate=True, says_unit=False),
    "carto": WrittenFormat(write_carto, "Renishaw CARTO .rtx, one link's length", constant_rate=True, says_unit=False),
    "xlsx": WrittenFormat(write_workbook, "an Excel list"),
}
