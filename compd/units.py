"""Units: the factor between millimetres and micrometres, units of a reference, and those in which column names end."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

# Micrometres in a millimetre: what people read is in um, what is computed in mm.
UM_PER_MM = 1e3

# Units in which a reference and its errors may be given, and what the names of their columns end in. Of "um" the
# columns are in mm; of every other unit the number is computed with as if the unit were a micrometre.
REFERENCE_UNITS: Mapping[str, str] = {
    "um": "mm",
    "arcsec": "arcsec",
    "deg": "deg",
    "mrad": "mrad",
    "urad": "urad",
    "um/m": "um_per_m",
}

# Factor to the first unit of each kind (SI brochure, 9th edition; kgf, inch and foot by definition).
UNIT_KINDS: tuple[Mapping[str, float], ...] = (
    {"mm": 1.0, "nm": 1e-6, "um": 1e-3, "cm": 10.0, "m": 1000.0, "in": 25.4, "inch": 25.4, "ft": 304.8},
    {"s": 1.0, "us": 1e-6, "ms": 1e-3, "min": 60.0, "h": 3600.0, "day": 86400.0},
    {"rad": 1.0, "urad": 1e-6, "mrad": 1e-3, "deg": 0.017453292519943295, "arcsec": 4.84813681109536e-6},
    {"N": 1.0, "mN": 1e-3, "kN": 1000.0, "kgf": 9.80665},
    {"hPa": 1.0, "Pa": 0.01, "kPa": 10.0, "mbar": 1.0, "bar": 1000.0, "mmHg": 1.33322387415},
)
_TEMPERATURES = {
    "degC": "",
    "C": "the values stay",
    "degF": "convert the values: (value - 32) / 1.8",
    "F": "convert the values: (value - 32) / 1.8",
    "K": "convert the values: value - 273.15",
}
# Others that a covariate may end in; a name that ends in no unit of this module gets a warning, not a refusal.
_OTHERS = (
    *("1", "pct", "ppm", "counts"),
    *("V", "mV", "A", "mA", "W"),
    *("Hz", "kHz", "rpm"),
    *("Nm", "g", "kg"),
    *("mm_per_s", "um_per_m", "m_per_s", "m_per_s2", "l_per_min", "K_per_h"),
)
# How other programs write these units, in lower case; one name of a unit here for each.
_SPELLINGS: Mapping[str, str] = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("um", "\u00b5m", "\u03bcm", "micron", "microns"), "um"),
    **dict.fromkeys(("micrometer", "micrometers", "micrometre", "micrometres", "mikrometer"), "um"),
    **dict.fromkeys(("nm", "nanometer", "nanometers", "nanometre", "nanometres"), "nm"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres", "zentimeter"), "cm"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("in", "inch", "inches", "zoll", '"'), "inch"),
    **dict.fromkeys(("ft", "foot", "feet"), "ft"),
    **dict.fromkeys(("sec", "secs", "second", "seconds", "sekunde", "sekunden"), "s"),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds", "millisekunden"), "ms"),
    **dict.fromkeys(("us", "usec", "\u00b5s", "\u03bcs", "microsecond", "microseconds", "mikrosekunden"), "us"),
    **dict.fromkeys(("min", "minute", "minutes", "minuten"), "min"),
    **dict.fromkeys(("hour", "hours", "stunde", "stunden"), "h"),
    **dict.fromkeys(("day", "days", "tag", "tage"), "day"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
    **dict.fromkeys(("mrad", "milliradian", "milliradians"), "mrad"),
    **dict.fromkeys(("deg", "degree", "degrees", "\u00b0"), "deg"),
    **dict.fromkeys(("arcsec", "arcseconds"), "arcsec"),
}
KNOWN_UNITS = frozenset([*(unit for kind in UNIT_KINDS for unit in kind), *_TEMPERATURES, *_OTHERS])


@cache
def unit_of(name: str) -> str:
    """The longest known unit in which `name` ends; "" if it ends in none. Example: "flow_l_per_min" -> "l_per_min"."""
    units = [unit for unit in KNOWN_UNITS if name.endswith(f"_{unit}")]
    return max(units, key=len, default="")


def unit_named(text: str) -> str:
    """The unit of a length, a time or an angle that `text` is, as this module names it; "" if it is none.

    Example: "Millimeters" is "mm", "Zoll" is "inch". Single letters count in lower case alone.
    """
    text = text.strip()
    if len(text) == 1 and text in ("m", "s", "h"):
        return text
    return _SPELLINGS.get(text.lower(), "")


def unit_factor(unit: str, wanted: str) -> float | None:
    """The factor from values in `unit` to values in `wanted`; None where these are units of different kinds.

    Example: "um" to "mm" is 1e-3. Temperatures are not converted by a factor: None.
    """
    for kind in UNIT_KINDS:
        if unit in kind and wanted in kind:
            return kind[unit] / kind[wanted]
    return None


def conversion_text(unit: str, wanted: str) -> str:
    """How a person converts values in `unit` into `wanted`, in words; "" where these are units of different kinds."""
    if wanted == "degC":
        return _TEMPERATURES.get(unit, "")
    ratio = unit_factor(unit, wanted)
    if ratio is None:
        return "the values stay" if (unit, wanted) == ("%", "pct") else ""
    if ratio == 1.0:
        return "the values stay"
    return f"divide the values by {1 / ratio:.10g}" if ratio < 1 else f"multiply the values by {ratio:.10g}"
