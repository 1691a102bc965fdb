"""Draw how often a stated probability was right: `python -m docs.pictures.reliability`, from docs/reliability.json."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from compd.report import COLOURS

PICTURE = Path(__file__).with_name("reliability.svg")
# Written by `python -m tests.scoreboard --figures docs/reliability.json`.
FIGURES = PICTURE.parent.parent / "reliability.json"
WIDTH, HEIGHT = 560, 500
LEFT, RIGHT, TOP, BOTTOM = 80, 500, 30, 430
# Wanted: the share of right ones is so near to what was stated.
WANTED = 0.07
# Two-sided 95 % of a normal distribution.
SIGMAS = 1.96


def place(stated: float, right: float) -> tuple[float, float]:
    """Pixels of a point."""
    return LEFT + stated * (RIGHT - LEFT), BOTTOM - right * (BOTTOM - TOP)


def draw(figures: Mapping[str, Any]) -> str:
    """The picture as SVG: a point for each bin, with the 95 % interval of its share."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img" '
        'font-family="system-ui, \'DejaVu Sans\', sans-serif" font-size="13">',
        "<title>Share of right verdicts by the probability that they stated</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#fff"/>',
        _band(),
    ]
    for tenth in range(0, 11, 2):
        share = tenth / 10
        (x, y), zero = place(share, share), place(0.0, 0.0)
        parts.append(f'<line x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{BOTTOM}" stroke="#dfe3e8"/>')
        parts.append(f'<line x1="{LEFT}" y1="{y:.1f}" x2="{RIGHT}" y2="{y:.1f}" stroke="#dfe3e8"/>')
        parts.append(_text(x, zero[1] + 20, f"{share:.1f}", "middle"))
        parts.append(_text(zero[0] - 8, y + 4, f"{share:.1f}", "end"))
    (x0, y0), (x1, y1) = place(0.0, 0.0), place(1.0, 1.0)
    parts.append(f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="#9aa2ab" stroke-dasharray="7 5"/>')
    for each in figures["bins"]:
        parts += _point(each)
    parts.append(_text((LEFT + RIGHT) / 2, HEIGHT - 22, "probability that was stated", "middle"))
    middle = (TOP + BOTTOM) / 2
    turn = f' transform="rotate(-90 24 {middle:.0f})"'
    parts.append(_text(24, middle, "share in which the named set was right", "middle", turn))
    brier = f"Brier score {figures['brier']:.3f}, of a constant {figures['constant_brier']:.3f}"
    parts.append(_text(LEFT + 12, TOP + 20, f"{figures['cases']} cases. {brier}"))
    return "\n".join([*parts, "</svg>", ""])


def _band() -> str:
    """Where a bin is as wanted."""
    corners = [(0.0, 0.0), (0.0, WANTED), (1 - WANTED, 1.0), (1.0, 1.0), (1.0, 1 - WANTED), (WANTED, 0.0)]
    points = " ".join("{:.1f},{:.1f}".format(*place(*corner)) for corner in corners)
    return f'<polygon points="{points}" fill="#eef3f8"/>'


def _point(each: Mapping[str, float]) -> list[str]:
    x, y = place(each["stated"], each["right"])
    # Wilson's interval of a share, which is one at 0 and at 1, too
    count, square = each["cases"], SIGMAS**2
    middle = (each["right"] + square / (2 * count)) / (1 + square / count)
    half = (
        SIGMAS / (1 + square / count) * math.sqrt(each["right"] * (1 - each["right"]) / count + square / count**2 / 4)
    )
    (_, low), (_, high) = place(0.0, middle - half), place(0.0, middle + half)
    colour = COLOURS["plain"]
    return [
        f'<line x1="{x:.1f}" y1="{low:.1f}" x2="{x:.1f}" y2="{high:.1f}" stroke="{colour}" stroke-width="2"/>',
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{colour}"/>',
        _text(x + 9, y + 16, f"{count:.0f}"),
    ]


def _text(x: float, y: float, words: str, anchor: str = "start", more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="#1c2126"{more}>{words}</text>'


def picture() -> str:
    """The picture of what was counted."""
    return draw(json.loads(FIGURES.read_text(encoding="utf-8")))


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
