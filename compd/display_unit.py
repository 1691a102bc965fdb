"""The unit in which people read a residual: um, or what the recording's sidecar names as `reference.unit`.

Computed is in um and mm throughout; of a reference in another unit, such as arcsec, one unit counts as one um. So a
number in um is shown as it is, with the recording's unit, and a place in mm is shown in um of that unit::

    format_error(12.34, "arcsec")  # "12 arcsec"
    place_unit("um"), place_unit("arcsec")  # "mm", "arcsec"
"""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.text import number_text
from compd.units import REFERENCE_UNITS, UM_PER_MM

# The coordinates of a measured attitude, and their unit.
ATTITUDE_LABELS = ("rx", "ry", "rz")
ATTITUDE_UNIT = "urad"
# mm that stand for a radian: 1 urad counts as 1 um.
MM_PER_RAD = 1e3


def format_error(value: float, unit: str = "um", figures: int = 2) -> str:
    """A value with its unit, with so many figures and without powers of ten where it is large: "0.12 um", "1234 um"."""
    return number_text(value, unit, figures)


def place_unit(unit: str) -> str:
    """The unit in which places are shown: mm where the residual is in um, else the residual's own."""
    return "mm" if unit == "um" else unit


def in_place_unit(place_mm: FloatArray, unit: str) -> FloatArray:
    """Places in mm as numbers in `place_unit`."""
    return place_mm if unit == "um" else place_mm * UM_PER_MM


def residual_ending(unit: str) -> str:
    """What the name of a column of residuals ends in: "um", "arcsec", "um_per_m"."""
    return "um" if unit == "um" else REFERENCE_UNITS[unit]
