"""Result of a reproduced experiment: errors without and with compensation beside the paper's, and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from compd.report import PageTable, Panel, check_page_path, write_page

HEAD = ("", "without", "with", "reduction", "the paper")
_FOOTER = (
    "Simulated machine with joints, frame and weather of its usual strengths; it shares no code with the model that "
    "reads its gauges. The paper: T. Oiwa, Accuracy improvement of parallel kinematic machine."
)


@dataclass(frozen=True)
class Reduction:
    """An error without and with compensation (um), and the paper's statement about it."""

    what: str
    without_um: float
    with_um: float
    paper: str

    @property
    def percent(self) -> float:
        """Share of the error that compensation removes."""
        return 100 * (1 - self.with_um / self.without_um)

    @property
    def row(self) -> tuple[str, ...]:
        """Cells of a table under HEAD."""
        return (
            self.what,
            f"{self.without_um:.2f} um",
            f"{self.with_um:.2f} um",
            f"{self.percent:.0f} %",
            self.paper,
        )


@dataclass(frozen=True)
class Reproduction:
    """A reproduced figure of the paper. reductions : the most important first. panels : its pictures."""

    title: str
    reductions: Sequence[Reduction]
    panels: Sequence[Panel]

    @property
    def verdict(self) -> str:
        """The first reduction in one sentence."""
        first = self.reductions[0]
        return (
            f"{first.what[0].upper()}{first.what[1:]}: {first.without_um:.2f} um without compensation, "
            f"{first.with_um:.2f} um with it, {first.percent:.0f} % less. The paper: {first.paper}."
        )

    def write_page(self, path: Path) -> None:
        """Write verdict, pictures and table as one HTML file; its directory is made."""
        path.parent.mkdir(parents=True, exist_ok=True)
        check_page_path(path)
        numbers = Panel(
            "In numbers",
            "The errors measured here beside the paper's statements.",
            PageTable(HEAD, [reduction.row for reduction in self.reductions]),
        )
        write_page(path, self.title, self.verdict, [*self.panels, numbers], _FOOTER)
