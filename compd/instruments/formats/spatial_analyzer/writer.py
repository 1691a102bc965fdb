"""SpatialAnalyzer ASCII: three comment lines, then collection, group, target, x, y, z and a stamp of a whole second."""

from __future__ import annotations

from compd.instruments.samples import Samples

_HEADER = (
    "// SpatialAnalyzer SA ( {version} )",
    "// Points Relative to Coordinate Frame '{frame}'",
    "// AXES = CARTESIAN: X,  Y,  Z ({unit})",
)
# Unit as SpatialAnalyzer writes it.
_UNITS = {"in": "inches", "inch": "inches", "m": "meters"}


def write_spatial_analyzer(
    samples: Samples, frame: str = "A::WORLD", collection: str = "A", version: str = "written by compd"
) -> bytes:
    """The file's bytes. Samples without names are numbered from 0, as a stream is; without a time rows have no stamp.

    The stamps are month/day/year and cut to whole seconds, as the program cuts them.
    """
    unit = _UNITS.get(samples.unit, samples.unit)
    lines = [line.format(version=version, frame=frame, unit=unit) for line in _HEADER]
    names = samples.names if samples.names is not None else [str(number) for number in range(len(samples.values))]
    stamps = samples.stamps()
    for k, (name, row) in enumerate(zip(names, samples.written_values.tolist(), strict=True)):
        cells = [collection, samples.group, name, *(f"{value:.6f}" for value in row)]
        if stamps is not None:
            cells.append(stamps[k].strftime("%m/%d/%y %H:%M:%S"))
        lines.append(",  ".join(cells))
    return ("\r\n".join(lines) + "\r\n").encode()
