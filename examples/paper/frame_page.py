"""The instantaneous frame beside the exact one in words, as a table and as a page of pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from plotly.graph_objects import Figure

from compd.arrays import FloatArray
from compd.report import COLOURS, PageTable, Panel, check_page_path, style_figure, write_page
from compd.units import UM_PER_MM
from frame_experiment import (
    DIRECTIONS,
    ROWS_PER_CALL,
    SIZES_MM,
    WARM_UP_HOURS,
    Difference,
    FrameResult,
    crossing_mm,
    order,
)

# Each cell but the first holds the median and the largest, over directions or, for the warm-up, over time.
HEAD = ("largest change", "{B} displaced", "{B} rotated", "tip")
CAPTION = f"Instantaneous less exact: median and largest of {DIRECTIONS} directions; of the warm-up, over time."
_FOOTER = (
    "Equations (4) and (5) of T. Oiwa, Accuracy improvement of parallel kinematic machine, against the exact solution "
    "of equations (2) and (3). The warm-up is that of the simulated machine, which shares no code with the model."
)


def title(result: FrameResult) -> str:
    """Title of table and page."""
    return f"Equations (4) and (5) against the exact frame: {result.machine}"


def table_rows(result: FrameResult) -> list[tuple[str, ...]]:
    """Cells under HEAD: a row for each size of the change, and one for the warm-up."""
    rows = [
        (length_text(size_mm), *_cells(Difference(*(values[i] for values in result.by_size))))
        for i, size_mm in enumerate(SIZES_MM)
    ]
    warm_up = f"{length_text(_warm_up_change_mm(result))}, warm-up"
    return [*rows, (warm_up, *_cells(result.warm_up))]


def sentences(result: FrameResult) -> list[str]:
    """Conclusions from the numbers, the most important first."""
    return [_order_text(result), _crossing_text(result), _warm_up_text(result), _cost_text(result)]


def _order_text(result: FrameResult) -> str:
    solved = np.isfinite(result.by_size.tip_mm.max(axis=1))
    sizes_mm = SIZES_MM[solved]
    text = (
        f"The difference grows with the power {order(result):.2f} of the change (line fitted to the largest ones of "
        f"the tip, {length_text(sizes_mm[0])} to {length_text(sizes_mm[-1])}): what equations (4) and (5) leave out "
        "is of second order."
    )
    if solved.all():
        return text
    failed = ", ".join(length_text(size_mm) for size_mm in SIZES_MM[~solved])
    return f"{text} At {failed} some directions have no exact frame near machine zero; they are left out."


def _crossing_text(result: FrameResult) -> str:
    return (
        f"Noise of the nine frame gauges ({result.noise_source}) moves the tip by "
        f"{length_text(result.noise_um / UM_PER_MM)} (standard deviation). In the worst of {DIRECTIONS} directions the "
        f"difference is as large at a change of {length_text(crossing_mm(result))}: below it the simpler way is good "
        "enough."
    )


def _warm_up_text(result: FrameResult) -> str:
    largest_mm = float(result.warm_up.tip_mm.max())
    return (
        f"A simulated warm-up of {WARM_UP_HOURS:g} h changes a distance by up to "
        f"{length_text(_warm_up_change_mm(result))}; the two ways then differ by at most {length_text(largest_mm)} at "
        f"the tip, {100 * largest_mm * UM_PER_MM / result.noise_um:.2g} % of that noise."
    )


def _cost_text(result: FrameResult) -> str:
    single, many = result.single, result.many
    return (
        f"One frame per call costs {single.exact_us:.1f} us exactly and {single.instantaneous_us:.1f} us by equation "
        f"(5), ratio {single.ratio:.1f}; in one call of {ROWS_PER_CALL} frames {many.exact_us:.2f} us and "
        f"{many.instantaneous_us:.3f} us each, ratio {many.ratio:.1f}. The exact one takes "
        f"{single.exact_us * result.rate_hz / 1e4:.2f} % of a cycle at {result.rate_hz:g} Hz."
    )


def panels(result: FrameResult) -> list[Panel]:
    """The tip's difference, displacement and rotation by size, the warm-up by time, and the table."""
    tip = _by_size(result.by_size.tip_mm * UM_PER_MM)
    tip.add_scatter(
        x=SIZES_MM[[0, -1]],
        y=[result.noise_um] * 2,
        name="noise of the gauges",
        mode="lines",
        line={"color": COLOURS["worst"], "dash": "dash"},
    )
    tip.add_scatter(
        x=[_warm_up_change_mm(result)],
        y=[float(result.warm_up.tip_mm.max()) * UM_PER_MM],
        name="warm-up, largest",
        mode="markers",
        marker={"color": COLOURS["best"], "size": 13, "symbol": "diamond"},
    )
    size = "largest change of a distance, mm"
    warm = Figure()
    warm.add_scatter(
        x=result.time_h, y=result.warm_up.tip_mm * UM_PER_MM * 1e3, mode="lines", line={"color": COLOURS["best"]}
    )
    return [
        Panel(
            "At the tip",
            f"Instantaneous less exact, over {DIRECTIONS} random directions of the nine changes. Both axes are "
            "logarithmic: a straight line of slope 2 is an error of second order.",
            _logarithmic(style_figure(tip, size, "difference at the tip, um", 460)),
        ),
        Panel(
            "Displacement of {B}",
            "Of the origin of {B}, the centre of the three supports.",
            _logarithmic(
                style_figure(_by_size(result.by_size.displacement_mm * UM_PER_MM), size, "difference, um", 380)
            ),
        ),
        Panel(
            "Rotation of {B}",
            "Length of the difference of the two rotation vectors.",
            _logarithmic(style_figure(_by_size(result.by_size.rotation_rad * 1e6), size, "difference, urad", 380)),
        ),
        Panel(
            "During a warm-up",
            _warm_up_text(result),
            style_figure(warm, "time since switch-on, h", "difference at the tip, nm", 300),
        ),
        Panel("In numbers", _cost_text(result), PageTable(HEAD, table_rows(result), CAPTION)),
    ]


def write_frame_page(result: FrameResult, path: Path) -> None:
    """Write sentences, pictures and table as one HTML file; its directory is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    check_page_path(path)
    verdict = f"{_order_text(result)} {_crossing_text(result)}"
    write_page(path, title(result), verdict, panels(result), _FOOTER)


def length_text(mm: float) -> str:
    """A length with two significant digits, in the unit that suits it: "0.14 nm", "62 nm", "1.4 um", "0.62 mm"."""
    factor, unit = (1.0, "mm") if mm >= 0.1 else (UM_PER_MM, "um") if mm >= 1e-4 else (1e6, "nm")
    return f"{_two_digits(mm * factor)} {unit}"


def _by_size(values: FloatArray) -> Figure:
    """Median and largest of values (sizes, directions) by the size of the change."""
    figure = Figure()
    for name, statistic, colour in (("median", np.median, "plain"), ("largest", np.max, "middle")):
        figure.add_scatter(
            x=SIZES_MM,
            y=statistic(values, axis=1),
            name=f"{name} of {values.shape[1]} directions",
            mode="lines+markers",
            line={"color": COLOURS[colour]},
        )
    return figure


def _logarithmic(figure: Figure) -> Figure:
    """Both axes logarithmic, with a tick at each power of ten."""
    for axis in (figure.update_xaxes, figure.update_yaxes):
        axis(type="log", dtick=1, exponentformat="power")
    return figure


def _warm_up_change_mm(result: FrameResult) -> float:
    """The largest change of any distance during the warm-up."""
    return float(np.abs(result.warm_up_change_mm).max())


def _cells(difference: Difference) -> list[str]:
    def angle_text(rad: float) -> str:
        return f"{_two_digits(rad * 1e6)} urad"

    return [
        _statistics(difference.displacement_mm, length_text),
        _statistics(difference.rotation_rad, angle_text),
        _statistics(difference.tip_mm, length_text),
    ]


def _statistics(values: FloatArray, text: Callable[[float], str]) -> str:
    """Median and largest of the known values."""
    known = values[np.isfinite(values)]
    return f"{text(float(np.median(known)))}, {text(float(known.max()))}" if len(known) else "-"


def _two_digits(value: float) -> str:
    """Two significant digits, never with an exponent: 0.00039, 62, 140."""
    text = np.format_float_positional(value, precision=2, fractional=False, trim="-")
    return text.rstrip(".")
