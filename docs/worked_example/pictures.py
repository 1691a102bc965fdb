"""The pictures of the worked example."""

from __future__ import annotations

import numpy as np

from docs.worked_example.example import Example
from docs.worked_example.plot import AFTER, BEFORE, INK, MIDDLE, PLAIN, QUIET, SOFT, Plot, picture, text
from docs.worked_example.sheets import FIRST, Sheets
from docs.worked_example.spreadsheet import Address

SECTOR_COLOURS = (PLAIN, BEFORE, AFTER, MIDDLE, "#cc79a7")
# Which session the pictures leave out.
LEFT_OUT = 3


def pictures(example: Example, sheets: Sheets) -> dict[str, str]:
    """SVG by name."""
    return {
        "noise": noise(sheets),
        "left-out": rows_left_out(example),
        "prediction": prediction(example, sheets),
        "scores": scores(sheets),
        "blocks": blocks(example, sheets),
    }


def noise(sheets: Sheets) -> str:
    """Differences of repeats, and the normal distribution of the noise floor."""
    cells = sheets.book.sheets["Noise"]
    count = sum(1 for row, column in cells if column == 4 and row >= FIRST)
    values = [
        sheets.book.number(Address("Noise", row, column))
        for row in range(FIRST, FIRST + count)
        for column in (4, 5, 6)
    ]
    sigma = sheets.book.number(sheets.results["floor"])
    edges = np.arange(-0.65, 0.66, 0.05)
    heights, _ = np.histogram(values, edges)
    top = float(np.ceil(heights.max() / 10) * 10)
    plot = Plot(60, 40, 600, 230, (-0.65, 0.65), (0, top))
    plot.axes(
        [-0.6, -0.4, -0.2, 0, 0.2, 0.4, 0.6],
        np.arange(0, top + 1, 10).tolist(),
        "difference of two looks at one point, divided by the root of 2, um",
        "number of differences",
    )
    for low, height in zip(edges[:-1], heights, strict=True):
        plot.bar((low + 0.003, low + 0.047), (0, float(height)), PLAIN)
    x = np.linspace(-0.65, 0.65, 131)
    curve = len(values) * 0.05 / (sigma * np.sqrt(2 * np.pi)) * np.exp(-0.5 * (x / sigma) ** 2)
    plot.line(x.tolist(), curve.tolist(), BEFORE)
    plot.note(0.2, top * 0.9, f"normal, standard deviation {sigma:.3f} um", "start", BEFORE)
    return picture("Differences of repeats", 720, 325, [plot])


def rows_left_out(example: Example) -> str:
    """Sessions over time, sectors over the workspace."""
    aligned = example.problem.aligned
    time_h = aligned.rows.time_s / 3600
    tip_mm = aligned.rows.tip_M_mm
    session, sector = (split.tolist() for split in example.splits)
    by_time = Plot(60, 40, 330, 260, (0, float(np.ceil(time_h.max()))), (-105, 105))
    ticks = [float(tick) for tick in range(0, int(np.ceil(time_h.max())) + 1, max(1, int(time_h.max() // 6)))]
    by_time.axes(ticks, [-100, -50, 0, 50, 100], "time, h", "x of the tip, mm: four sessions")
    by_place = Plot(460, 40, 260, 260, (-105, 105), (-105, 105))
    by_place.axes([-100, -50, 0, 50, 100], [-100, -50, 0, 50, 100], "x of the tip, mm", "y of the tip, mm: five sectors")
    for k, colour in enumerate(SECTOR_COLOURS):
        rows = [i for i, fold in enumerate(session) if fold == k]
        by_time.dots(time_h[rows].tolist(), tip_mm[rows, 0].tolist(), colour)
        rows = [i for i, fold in enumerate(sector) if fold == k]
        by_place.dots(tip_mm[rows, 0].tolist(), tip_mm[rows, 1].tolist(), colour)
    return picture("Rows that are left out together", 760, 355, [by_time, by_place])


def prediction(example: Example, sheets: Sheets) -> str:
    """The residual against what the effect would make of it, learned without one session."""
    rows = example.problem.rows
    theta = sheets.book.number(Address("Folds", FIRST + LEFT_OUT, 11))
    predicted = theta * example.candidates[0].columns_um[:, 1, 0]
    residual = example.problem.comparison.residual_um[:, 1]
    out = example.splits[0] == LEFT_OUT
    limit = float(np.ceil(np.abs(np.concatenate([predicted[rows], residual[rows]])).max() * 2) / 2)
    limits, ticks = (-limit, limit), np.arange(-limit, limit + 0.1, 0.5).tolist()
    plots = []
    for number, (chosen, colour, words) in enumerate(
        [(~out, QUIET, "fitted: three sessions"), (out, BEFORE, "left out: the fourth")]
    ):
        plot = Plot(70 + 350 * number, 45, 270, 270, limits, limits)
        plot.axes(ticks, ticks, "predicted by the fit, um", f"residual of y, um; {words}")
        plot.dots(predicted[rows & chosen].tolist(), residual[rows & chosen].tolist(), colour)
        plot.line(limits, limits, INK, dashed=True)
        plots.append(plot)
    return picture("Fitted on three sessions, tried on the fourth", 720, 370, plots)


def scores(sheets: Sheets) -> str:
    """Log loss and prices of the sets, one on the other."""
    names = {"0": "nothing", "a": "a: link_elasticity", "ab": "a and b: frame_rod_expansion", "c": "c: joint_contact"}
    plot = Plot(220, 30, 440, 190, (0, 2.2), (0, 4))
    plot.axes([0, 0.5, 1, 1.5, 2], [], "score: the less, the better", "")
    for k, (name, words) in enumerate(names.items()):
        row, middle = 2 + k, 3.5 - k
        log_loss, prices = (sheets.book.number(Address("Verdict", row, column)) for column in (3, 4))
        plot.bar((0, log_loss), (middle - 0.28, middle + 0.28), PLAIN)
        plot.bar((log_loss, log_loss + prices), (middle - 0.28, middle + 0.28), MIDDLE)
        plot.parts.append(text(212, plot.at(0, middle)[1] + 4, words, "end"))
        plot.note(log_loss + prices + 0.02, middle - 0.08, f"{log_loss + prices:.3f}")
    legend = [
        f'<rect x="420" y="262" width="12" height="12" fill="{PLAIN}"/>',
        text(438, 273, "log of the loss"),
        f'<rect x="550" y="262" width="12" height="12" fill="{MIDDLE}"/>',
        text(568, 273, "prices"),
    ]
    return picture("Scores of four sets of effects", 720, 285, [plot], legend)


def blocks(example: Example, sheets: Sheets) -> str:
    """What each block of rows gains by the first effect and by a second."""
    count = int(example.block.max()) + 1
    plots = []
    for number, (letter, column, words) in enumerate([("a", 2, "gain of a"), ("b", 3, "gain of b beside a")]):
        by_block = [sheets.book.number(Address("Blocks", FIRST + k, column)) for k in range(count)]
        gain, std = (sheets.book.number(sheets.results[f"{name}_{letter}"]) for name in ("gain", "std"))
        values = sheets.book.number(sheets.results["values"])
        top = float(max(by_block)) * 1.05
        low = min(0.0, float(min(by_block)) * 1.2)
        plot = Plot(70 + 350 * number, 45, 270, 200, (0, count), (low, top))
        step = 10.0 ** np.floor(np.log10(top))
        ticks = np.arange(0.0, top, step * (2 if top / step > 5 else 1)).tolist()
        plot.axes([5, 10, 15, 20], ticks, "block of neighbouring rows", f"{words}, squares of the noise")
        for k, value in enumerate(by_block):
            plot.bar((k + 0.15, k + 0.85), (min(value, 0.0), max(value, 0.0)), AFTER if value > 0 else BEFORE)
        mean = gain * values / count
        plot.line((0, count), (mean, mean), INK, dashed=True)
        plot.parts.append(
            text(plot.left, 300, f"{gain:.2g} per value, {gain / std:.1f} standard errors", "start", SOFT)
        )
        plots.append(plot)
    return picture("Gain in each block of rows", 720, 315, plots)
