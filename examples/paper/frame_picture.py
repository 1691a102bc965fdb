"""Draw what `reproduce.py instantaneous` finds for the documentation: `python examples/paper/frame_picture.py`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import frame_experiment
from compd.configuration import load, shipped_configuration
from compd.report import COLOURS
from compd.units import UM_PER_MM
from frame_experiment import SIZES_MM, FrameResult
from frame_page import length_text

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "instantaneous-frame.svg"
WIDTH, HEIGHT = 720, 420
LEFT, RIGHT, TOP, BOTTOM = 90, 690, 30, 350
# Powers of ten at the ends of the axes: change in mm, difference in um.
CHANGE, DIFFERENCE = (-2, 1), (-4, 3)
UNITS = {-4: "0.1 nm", -3: "1 nm", -2: "10 nm", -1: "0.1 um", 0: "1 um", 1: "10 um", 2: "0.1 mm", 3: "1 mm"}


def place(change_mm: float, difference_um: float) -> tuple[float, float]:
    """Pixels of a point of the logarithmic plot."""
    across = (math.log10(change_mm) - CHANGE[0]) / (CHANGE[1] - CHANGE[0])
    up = (math.log10(difference_um) - DIFFERENCE[0]) / (DIFFERENCE[1] - DIFFERENCE[0])
    return LEFT + across * (RIGHT - LEFT), BOTTOM - up * (BOTTOM - TOP)


def text(x: float, y: float, words: str, anchor: str = "start", colour: str = "#1c2126", more: str = "") -> str:
    """One text."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"{more}>{words}</text>'


def line(differences_um: Sequence[float], colour: str, name: str) -> list[str]:
    """A curve by SIZES_MM, with its name below its last but one point."""
    points = [place(change, difference) for change, difference in zip(SIZES_MM, differences_um, strict=True)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>' for x, y in points]
    return [f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>', *dots, name]


def draw(result: FrameResult) -> str:
    """The picture as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="system-ui, \'DejaVu Sans\', sans-serif" font-size="13">',
        "<title>Difference of instantaneous and exact frame at the tip, by the size of the change</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#fff"/>',
    ]
    for power in range(CHANGE[0], CHANGE[1] + 1):
        x, _ = place(10.0**power, 1.0)
        parts.append(f'<line x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{BOTTOM}" stroke="#dfe3e8"/>')
        parts.append(text(x, BOTTOM + 20, f"{10.0**power:g} mm", "middle"))
    for power in range(DIFFERENCE[0], DIFFERENCE[1] + 1):
        _, y = place(1.0, 10.0**power)
        parts.append(f'<line x1="{LEFT}" y1="{y:.1f}" x2="{RIGHT}" y2="{y:.1f}" stroke="#dfe3e8"/>')
        parts.append(text(LEFT - 8, y + 4, UNITS[power], "end"))
    parts.append(text((LEFT + RIGHT) / 2, HEIGHT - 18, "largest change of the nine distances", "middle"))
    middle = (TOP + BOTTOM) / 2
    turn = f' transform="rotate(-90 18 {middle:.0f})"'
    parts.append(text(18, middle, "difference at the tip", "middle", more=turn))

    tip_um = result.by_size.tip_mm * UM_PER_MM
    slope = frame_experiment.order(result)
    x, y = place(1.0, float(tip_um[4].max()))
    largest = text(x - 10, y - 6, f"largest of {tip_um.shape[1]} directions, slope {slope:.2f}", "end", "#9a6a00")
    parts += line(tip_um.max(axis=1).tolist(), COLOURS["middle"], largest)
    x, y = place(1.0, float(np.median(tip_um[4])))
    parts += line(
        np.median(tip_um, axis=1).tolist(), COLOURS["plain"], text(x + 12, y + 12, "median", "start", "#0072b2")
    )

    _, y = place(1.0, result.noise_um)
    dashed = f'stroke="{COLOURS["worst"]}" stroke-width="2" stroke-dasharray="7 5"'
    parts.append(f'<line x1="{LEFT}" y1="{y:.1f}" x2="{RIGHT}" y2="{y:.1f}" {dashed}/>')
    noise = f"noise of the frame gauges at the tip, {length_text(result.noise_um / UM_PER_MM)}"
    parts.append(text(RIGHT - 6, y + 18, noise, "end", COLOURS["worst"]))

    warm_up_um = float(result.warm_up.tip_mm.max()) * UM_PER_MM
    x, y = place(float(np.abs(result.warm_up_change_mm).max()), warm_up_um)
    parts.append(f'<path d="M{x:.1f} {y - 8:.1f}l8 8l-8 8l-8 -8z" fill="{COLOURS["best"]}"/>')
    warm_up = f"a warm-up of ten hours: {length_text(warm_up_um / UM_PER_MM)}"
    parts.append(text(x + 14, y + 5, warm_up, colour="#00795a"))
    return "\n".join([*parts, "</svg>", ""])


def picture() -> str:
    """The picture of the shipped tripod, seed 1, as the command's default is."""
    return draw(frame_experiment.run_frame_experiment(load(shipped_configuration("tripod-cmm.yaml")), 1))


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
