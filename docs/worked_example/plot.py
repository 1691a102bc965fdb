"""A plot as SVG: axes, points, lines and bars; the little that the pictures of a page need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

from compd.report import COLOURS

INK, SOFT, GRID = "#1c2126", "#555c64", "#e3e7eb"


@dataclass(eq=False)
class Plot:
    """One pair of axes at a place of the picture, in pixels; x and y : lowest and highest value shown."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]
    parts: list[str] = field(default_factory=list)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of a point."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return self.left + across * self.width, self.top + (1 - up) * self.height

    def axes(self, x_ticks: Sequence[float], y_ticks: Sequence[float], x_name: str, y_name: str) -> None:
        """Lines of a grid with their values, and the names of the axes."""
        for value in x_ticks:
            x, _ = self.at(value, 0)
            self.parts.append(
                f'<line x1="{x:.1f}" y1="{self.top}" x2="{x:.1f}" y2="{self.top + self.height}" stroke="{GRID}"/>'
            )
            self.parts.append(text(x, self.top + self.height + 17, f"{value:g}", "middle", SOFT))
        for value in y_ticks:
            _, y = self.at(0, value)
            self.parts.append(
                f'<line x1="{self.left}" y1="{y:.1f}" x2="{self.left + self.width}" y2="{y:.1f}" stroke="{GRID}"/>'
            )
            self.parts.append(text(self.left - 7, y + 4, f"{value:g}", "end", SOFT))
        self.parts.append(text(self.left + self.width / 2, self.top + self.height + 36, x_name, "middle"))
        self.parts.append(text(self.left - 34, self.top - 10, y_name, "start"))

    def dots(self, xs: Sequence[float], ys: Sequence[float], colour: str, radius: float = 2.4) -> None:
        """Points."""
        for x, y in zip(xs, ys, strict=True):
            across, down = self.at(x, y)
            self.parts.append(
                f'<circle cx="{across:.1f}" cy="{down:.1f}" r="{radius}" fill="{colour}" fill-opacity="0.65"/>'
            )

    def line(self, xs: Sequence[float], ys: Sequence[float], colour: str, dashed: bool = False) -> None:
        """A line through points."""
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self.at, xs, ys))
        dash = ' stroke-dasharray="6 4"' if dashed else ""
        self.parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')

    def bar(self, x: tuple[float, float], y: tuple[float, float], colour: str) -> None:
        """A filled rectangle."""
        (x1, y1), (x2, y2) = self.at(x[0], y[1]), self.at(x[1], y[0])
        self.parts.append(
            f'<rect x="{x1:.1f}" y="{y1:.1f}" width="{x2 - x1:.1f}" height="{max(y2 - y1, 0.5):.1f}" fill="{colour}"/>'
        )

    def note(self, x: float, y: float, words: str, anchor: str = "start", colour: str = INK) -> None:
        """A text at a point."""
        across, down = self.at(x, y)
        self.parts.append(text(across, down, words, anchor, colour))


def text(x: float, y: float, words: str, anchor: str = "start", colour: str = INK) -> str:
    """One text at pixels."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">{escape(words)}</text>'


def picture(title: str, width: int, height: int, plots: Sequence[Plot], more: Sequence[str] = ()) -> str:
    """The SVG of some plots."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        'font-family="system-ui, \'DejaVu Sans\', sans-serif" font-size="13">'
    )
    body = [part for plot in plots for part in plot.parts]
    background = f'<rect width="{width}" height="{height}" rx="8" fill="#fff"/>'
    return "\n".join([head, f"<title>{escape(title)}</title>", background, *body, *more, "</svg>", ""])


BEFORE, AFTER, QUIET, PLAIN, MIDDLE = (COLOURS[name] for name in ("worst", "best", "quiet", "plain", "middle"))
