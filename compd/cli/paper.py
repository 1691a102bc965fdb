"""`compd paper`: the paper's experiments again, on the simulated machine; nothing is tuned to hit its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.paper.reduction import Reduction
    from compd.report.page import Panel

Config = Annotated[Path | None, typer.Argument(help="The machine; the shipped tripod if left out.")]
Seed = Annotated[int, typer.Option(min=0, help="Joints, weather and noise follow from it.")]

app = typer.Typer(
    no_args_is_help=True, help="The paper's experiments (T. Oiwa, figures 18, 20, 21) on the simulated machine."
)

_FOOTER = (
    "Simulated machine with joints, frame and weather of its usual strengths; it shares no code with the model that "
    "reads its gauges. The paper: T. Oiwa, Accuracy improvement of parallel kinematic machine."
)


@app.command()
def fig18(
    config: Config = None,
    page: Annotated[Path, typer.Option(help="Where the page with the picture goes.")] = Path("out/fig18.html"),
    seed: Seed = 1,
) -> None:
    """One link under load and temperature: scale against laser interferometer, compensated or not."""
    from compd.configuration import load
    from compd.paper import link_experiment

    experiment = link_experiment.run(load(_machine(config)), seed)
    _tell(
        page,
        "Figure 18: scale unit against laser interferometer",
        link_experiment.reductions(experiment),
        link_experiment.panels(experiment),
    )


@app.command()
def fig20(
    config: Config = None,
    page: Annotated[Path, typer.Option(help="Where the page with the picture goes.")] = Path("out/fig20.html"),
    seed: Seed = 1,
) -> None:
    """Distances between the 17 balls of a 3D ball plate, joints compensated or not."""
    from compd.configuration import load
    from compd.paper import plate_experiment

    experiment = plate_experiment.run(load(_machine(config)), seed)
    _tell(
        page,
        "Figure 20: distances between the balls of a 3D ball plate",
        plate_experiment.reductions(experiment),
        plate_experiment.panels(experiment),
    )


@app.command()
def fig21(
    config: Config = None,
    page: Annotated[Path, typer.Option(help="Where the page with the picture goes.")] = Path("out/fig21.html"),
    seed: Seed = 1,
) -> None:
    """A reference ball on the surface plate, measured again and again while the machine warms up."""
    from compd.configuration import load
    from compd.paper import drift_experiment

    experiment = drift_experiment.run(load(_machine(config)), seed)
    _tell(
        page,
        "Figure 21: a ball on the surface plate during warm-up",
        drift_experiment.reductions(experiment),
        drift_experiment.panels(experiment),
    )


def _machine(config: Path | None) -> Path:
    from compd.configuration.shipped import shipped_configuration

    return config or shipped_configuration("tripod-cmm.yaml")


def _tell(page: Path, title: str, reductions: Sequence[Reduction], panels: Sequence[Panel]) -> None:
    """The table on the terminal, and the same with the picture on a page."""
    from rich.console import Console
    from rich.table import Table as TerminalTable

    from compd.paper.reduction import HEAD, row
    from compd.report.page import PageTable, Panel, write_page

    table = TerminalTable(*HEAD, title=title, title_justify="left")
    for reduction in reductions:
        table.add_row(*row(reduction))
    console = Console()
    console.print(table)
    first = reductions[0]
    verdict = (
        f"{first.what[0].upper()}{first.what[1:]}: {first.without_um:.2f} um without compensation, "
        f"{first.with_um:.2f} um with it, {first.percent:.0f} % less. The paper: {first.paper}."
    )
    page.parent.mkdir(parents=True, exist_ok=True)
    numbers = Panel(
        "In numbers",
        "What was measured here, beside what the paper states.",
        PageTable(HEAD, [row(reduction) for reduction in reductions]),
    )
    write_page(page, title, verdict, [*panels, numbers], _FOOTER)
    console.print(f"The same as a picture: {page}")
