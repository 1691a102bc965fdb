"""The page of a calibration: the error before and after on poses that took no part, each number, and what is left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from plotly.graph_objects import Bar, Figure, Heatmap, Scatter, Scatter3d
from plotly.subplots import make_subplots

from compd.arrays import BoolArray, FloatArray, rms
from compd.calibration import CalibratedNumber, Calibration, PoseErrors, PredictionMap, PredictionSlice
from compd.display_unit import format_error
from compd.report.figures import ARROW_SHARE, ARROWS
from compd.report.page import COLOURS, Panel, style_figure, write_page
from compd.report.page_table import PageTable
from compd.report.small_multiples import NOT_RECORDED, thin
from compd.text import join_words, number_text
from compd.units import UM_PER_MM

# Height of a slice of the map.
MAP_PX = 330
# Names and colours of the two states, on every figure of the page.
STATES = (("as drawn", COLOURS["worst"]), ("calibrated", COLOURS["best"]))
# A smaller range of turns is not mentioned: a decimal of a degree would not show it.
_SEEN_DEG = 0.1
LOOK = (
    "A number counts as needed where held-out poses are predicted better with its block; as held where these poses "
    "tell it less than twice as well as the tolerance does. The standard error is that after the poses, the "
    "tolerance as prior."
)


def write_calibration_page(path: Path, calibration: Calibration, built: str = "") -> None:
    """Write the page. built : the file of the machine as built, for the footer; "" where there is none."""
    judged = [*calibration.held_out, *calibration.sealed]
    panels = [
        Panel(
            "Error before and after",
            "As drawn, and calibrated: at poses that took no part in the fit, and in the last rows at those that did. "
            "Rms per coordinate and per link, the largest in space. Each instrument is registered first.",
            _errors([*judged, *calibration.learned]),
        ),
        *_arrows(judged),
        *_links(judged),
        _prediction(calibration.prediction),
        Panel("Each number", LOOK, _numbers(calibration)),
        Panel(
            "Which numbers were needed",
            "Error of held-out poses in standard deviations of the noise, without and with each block of numbers.",
            _blocks(calibration),
        ),
        Panel(
            "What these poses cannot tell",
            "Combinations that stay at the drawing, and what would tell them.",
            _held(calibration),
        ),
        Panel("What is left", _left(calibration), _remarks(calibration)),
    ]
    recordings = ", ".join(Path(name).name for name in calibration.recordings)
    footer = f"Learned from {recordings}." + (f" The machine as built: {built}." if built else "")
    write_page(path, f"Calibration: {calibration.machine}", calibration.verdict, panels, footer)


def _errors(parts: Sequence[PoseErrors]) -> PageTable:
    head = ("poses", "rows", "tip, rms", "tip, largest", "attitude, rms", "links, rms")
    return PageTable(
        head,
        [
            [
                one.what,
                str(len(one.rows)),
                _fall(_um(one.before_rms_um), _um(one.after_rms_um)),
                _fall(_um(_largest_um(one.before_mm)), _um(_largest_um(one.after_mm))),
                _fall(_urad(one.before_rms_urad), _urad(one.after_rms_urad)),
                _fall(_um(_rms_um(one.before_links_mm)), _um(_rms_um(one.after_links_mm))),
            ]
            for one in parts
        ],
    )


def _fall(before: str, after: str) -> str:
    """As drawn, and calibrated."""
    return "-" if before == after == "-" else f"{before} to {after}"


def _arrows(parts: Sequence[PoseErrors]) -> Iterator[Panel]:
    """Errors of the tip as arrows, all with one enlargement, so that their lengths compare."""
    shown = [one for one in parts if _known(one).any()]
    if not shown:
        yield Panel("Errors of the tip", "The tip was not measured whole.", NOT_RECORDED)
        return
    reach_mm = max(float(np.ptp(one.place_mm[_known(one)], axis=0).max()) for one in shown) or 1.0
    typical_mm = max(rms(np.linalg.norm(one.before_mm[_known(one)], axis=1)) for one in shown)
    enlarged = _round_down(ARROW_SHARE * reach_mm / max(typical_mm, 1e-9))
    for one in shown:
        yield Panel(
            f"Errors of the tip: {one.what}",
            f"Measured less modelled, enlarged {enlarged:g} times in both states and in all figures of this page: "
            f"{_um(one.before_rms_um)} as drawn, {_um(one.after_rms_um)} calibrated, rms per coordinate.",
            _arrow_figure(one, enlarged),
        )


def _arrow_figure(errors: PoseErrors, enlarged: float) -> Figure:
    chosen = thin(np.flatnonzero(_known(errors)), ARROWS)
    place = errors.place_mm[chosen]
    figure = Figure()
    for (name, colour), vector_mm in zip(STATES, (errors.before_mm[chosen], errors.after_mm[chosen]), strict=True):
        end = place + enlarged * vector_mm
        path = np.stack([place, end, np.full_like(place, np.nan)], axis=1).reshape(-1, 3)
        hover = [
            f"row {row}, {name}: {', '.join(f'{value:+.3g}' for value in vector * UM_PER_MM)} um"
            for row, vector in zip(errors.rows[chosen], vector_mm, strict=True)
        ]
        x, y, z = path.T
        figure.add_trace(
            Scatter3d(x=x, y=y, z=z, mode="lines", name=name, line={"width": 4, "color": colour}, hoverinfo="skip")
        )
        x, y, z = end.T
        figure.add_trace(
            Scatter3d(
                x=x,
                y=y,
                z=z,
                mode="markers",
                showlegend=False,
                text=hover,
                hoverinfo="text",
                marker={"size": 2, "color": colour},
            )
        )
    style_figure(figure, "", "", 560)
    return figure.update_layout(
        scene={**{f"{axis}axis_title": f"{axis}, mm" for axis in "xyz"}, "aspectmode": "data"},
        margin={"l": 0, "r": 0, "t": 30, "b": 0},
    )


def _links(parts: Sequence[PoseErrors]) -> Iterator[Panel]:
    """The error of each link before and after, on one scale."""
    shown = [one for one in parts if np.isfinite(one.before_links_mm).any()]
    if not shown:
        return
    figure = make_subplots(1, len(shown), shared_yaxes=True, subplot_titles=[one.what for one in shown])
    for column, one in enumerate(shown, start=1):
        for (name, colour), links_mm in zip(STATES, (one.before_links_mm, one.after_links_mm), strict=True):
            names = [f"{i}" for i in range(1, links_mm.shape[1] + 1)]
            sizes = [_rms_um(links_mm[:, [i]]) for i in range(links_mm.shape[1])]
            bars = Bar(x=names, y=sizes, name=name, marker_color=colour, showlegend=column == 1)
            figure.add_trace(bars, row=1, col=column)
        figure.update_xaxes(title_text="link", type="category", row=1, col=column)
    style_figure(figure, "link", "error of length, um rms", 340).update_layout(margin={"t": 70}, legend={"y": 1.12})
    yield Panel("Errors of the links", "The errors of lengths that explain those of the poses, on one scale.", figure)


def _prediction(prediction: PredictionMap | None) -> Panel:
    """The standard error of the prediction: slices through the workspace, one scale of colours for each unit."""
    name = "How uncertain the prediction is"
    if prediction is None or not prediction.slices:
        return Panel(name, "Not computed: the machine has no places of its own to plan.", NOT_RECORDED)
    slices = prediction.slices
    # an attitude that no target fixes follows from the place, and needs no map of its own
    stds = {"um": [one.std_um for one in slices], "urad": [one.std_urad for one in slices]}
    kinds = ["um", "urad"] if prediction.turn_rad.any() else ["um"]
    poses = np.concatenate([prediction.measured_mm, np.degrees(prediction.measured_rad)], axis=1)
    poses = poses[thin(np.arange(len(poses)), ARROWS)]
    figures = [
        _slice_figure(one, std, kind, float(np.nanmax(stds[kind])), poses)
        for kind in kinds
        for one, std in zip(slices, stds[kind], strict=True)
    ]
    text = (
        f"{prediction.words} It follows from the covariance of all numbers; what is held counts with its tolerance. "
        "Left out are the noise of a measurement and a motion of the whole machine. Dots: measured poses, seen along "
        "the slice's normal. White: not reached." + _turned(prediction.measured_rad)
    )
    return Panel(name, text, figures)


def _slice_figure(one: PredictionSlice, std: FloatArray, kind: str, largest: float, poses: FloatArray) -> Figure:
    """One slice. largest : end of the scale of colours. poses : (N, 6), mm and degrees."""
    (across, across_title), (up, up_title) = _side(one.across, one.across_at), _side(one.up, one.up_at)
    cells = Heatmap(
        x=across,
        y=up,
        z=std,
        zmin=0.0,
        zmax=largest,
        colorscale="Viridis",
        colorbar={"title": kind, "thickness": 12},
        hovertemplate=f"%{{z:.3g}} {kind} at %{{x:.4g}}, %{{y:.4g}}<extra></extra>",
    )
    dots = Scatter(
        x=poses[:, "xyzabc".index(one.across)],
        y=poses[:, "xyzabc".index(one.up)],
        mode="markers",
        marker={"size": 5, "color": "white", "line": {"width": 1, "color": "black"}},
        hoverinfo="skip",
    )
    figure = style_figure(Figure([cells, dots]), across_title, up_title, MAP_PX)
    title = f"{'tip' if kind == 'um' else 'attitude'}, {kind}" + (f", at {one.held}" if one.held else "")
    figure.update_yaxes(title_standoff=2)
    return figure.update_layout(
        title={"text": title, "font": {"size": 13}}, showlegend=False, margin={"t": 50, "l": 60}
    )


def _turned(turn_rad: FloatArray) -> str:
    """What the turns (N, 3) of the measured poses mean for the slices; "" where there are none."""
    ends = [(axis, *np.degrees([own.min(), own.max()])) for axis, own in zip("xyz", turn_rad.T, strict=True)]
    ranges = [f"{low:.1f} to {high:.1f} deg about {axis}" for axis, low, high in ends if high - low >= _SEEN_DEG]
    if not ranges:
        return ""
    return f" A slice holds for the pose in its title; the measured poses turn by {join_words(ranges, 'and')}."


def _side(name: str, at: FloatArray) -> tuple[FloatArray, str]:
    """Values and title of an axis: mm of a place, degrees of a turn."""
    if name in "xyz":
        return at, f"{name}, mm"
    return np.degrees(at), f"turn about {'xyz'['abc'.index(name)]}, deg"


def _numbers(calibration: Calibration) -> PageTable:
    head = (
        "number",
        "drawing",
        "as built",
        "change",
        "standard error",
        "unit",
        "largest correlation",
        "needed",
        "held",
    )
    return PageTable(
        head,
        [
            [
                number.element,
                _stated(number.drawing, number.unit),
                _stated(number.value, number.unit),
                _change(number),
                f"{number.std:.2g}",
                number.unit,
                f"{number.correlation:+.2f} {number.with_whom}" if number.with_whom else "-",
                "yes" if number.needed else "no",
                "yes" if number.needed and number.held else "",
            ]
            for number in calibration.numbers
        ],
    )


def _change(number: CalibratedNumber) -> str:
    """Less than a billionth of the tolerance is the rounding of value less drawing."""
    return "0" if abs(number.change) < 1e-9 * number.prior_std else f"{number.change:+.3g}"


def _stated(value: float, unit: str) -> str:
    """A place to 0.1 um, any other number with four digits."""
    return f"{value:.4f}" if unit == "mm" else f"{value:.4g}"


def _blocks(calibration: Calibration) -> PageTable:
    head = ("block", "needed", "without", "with", "why")
    return PageTable(
        head,
        [
            [one.words, "yes" if one.needed else "no", _three(one.without), _three(one.with_it), one.why]
            for one in calibration.blocks
        ],
    )


def _held(calibration: Calibration) -> PageTable:
    rows = [[one.words, f"{one.share:.2f}", one.remedy] for one in calibration.held]
    return PageTable(("combination", "after over before", "what tells it"), rows or [["none", "", ""]])


def _left(calibration: Calibration) -> str:
    """What is left beside the noise, and whether to look for its cause."""
    if np.isnan(calibration.left_over):
        return "Nothing says how much noise the measurement has, so that what is left cannot be judged."
    times = f"What is left at held-out poses is {calibration.left_over**0.5:.3g} times the noise"
    if calibration.diagnose_next:
        return f"{times}: `compd diagnose` looks for its cause."
    return f"{times}: there is nothing for `compd diagnose` to find."


def _remarks(calibration: Calibration) -> PageTable:
    rows = [["warning", text] for text in calibration.warnings]
    rows += [
        ["left out", f"{pose.recording} row {pose.row}: {format_error(pose.error_mm * UM_PER_MM, 'um', 3)} off"]
        for pose in calibration.gross
    ]
    noise = "not known" if np.isnan(calibration.noise_um) else _um(calibration.noise_um)
    return PageTable(("", "in words"), [*rows, ["noise", f"{noise} per coordinate"]])


def _known(errors: PoseErrors) -> BoolArray:
    return np.asarray(np.isfinite(errors.before_mm).all(axis=1) & np.isfinite(errors.after_mm).all(axis=1))


def _largest_um(vector_mm: FloatArray) -> float:
    sizes = np.linalg.norm(vector_mm, axis=1)
    return float(sizes[np.isfinite(sizes)].max(initial=0.0) * UM_PER_MM) if np.isfinite(sizes).any() else float("nan")


def _rms_um(values_mm: FloatArray) -> float:
    known = values_mm[np.isfinite(values_mm)]
    return rms(known) * UM_PER_MM if len(known) else float("nan")


def _round_down(value: float) -> float:
    """To 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def _um(value: float) -> str:
    return "-" if np.isnan(value) else format_error(value, "um", 3)


def _urad(value: float) -> str:
    return "-" if np.isnan(value) else f"{_three(value)} urad"


def _three(value: float) -> str:
    return number_text(value, digits=3)
