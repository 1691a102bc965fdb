"""`compd paper`: the paper's experiments on the simulated machine, without tuning to its numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.configuration import Configuration
    from compd.paper import Reproduction

Config = Annotated[Path | None, typer.Argument(help="The machine; default: the shipped tripod.")]
Page = Annotated[Path, typer.Option(help="File of the page with the picture.")]
Seed = Annotated[int, typer.Option(min=0, help="Random seed of joints, weather and noise.")]

Machine = Annotated[Path | None, typer.Option("--machine", help="The machine; default: the shipped tripod.")]

paper = typer.Typer(
    no_args_is_help=True,
    help="The paper's experiments (T. Oiwa, figures 18, 20, 21) and its equations (4), (5) on the simulated machine.",
)


@paper.command()
def fig18(config: Config = None, page: Page = Path("out/fig18.html"), seed: Seed = 1) -> None:
    """One link under load and temperature: scale against laser interferometer, compensated or not."""
    from compd.paper import reproduce_link

    _show(reproduce_link(_configuration(config), seed), page)


@paper.command()
def fig20(config: Config = None, page: Page = Path("out/fig20.html"), seed: Seed = 1) -> None:
    """Distances between the 17 balls of a 3D ball plate, joints compensated or not."""
    from compd.paper import reproduce_plate

    _show(reproduce_plate(_configuration(config), seed), page)


@paper.command()
def fig21(config: Config = None, page: Page = Path("out/fig21.html"), seed: Seed = 1) -> None:
    """A reference ball on the surface plate, measured again and again while the machine warms up."""
    from compd.paper import reproduce_drift

    _show(reproduce_drift(_configuration(config), seed), page)


@paper.command()
def instantaneous(machine: Machine = None, page: Page = Path("out/instantaneous.html"), seed: Seed = 1) -> None:
    """Equations (4) and (5): difference of the instantaneous from the exact frame, by the size of the change."""
    from rich.console import Console
    from rich.table import Table

    from compd.paper import frame_table, run_frame_experiment, write_frame_page

    result = run_frame_experiment(_configuration(machine), seed)
    summary = frame_table(result)
    table = Table(*summary.head, title=summary.title, title_justify="left")
    table.caption, table.caption_justify = summary.caption, "left"
    for row in summary.rows:
        table.add_row(*row)
    console = Console()
    console.print(table)
    for sentence in summary.sentences:
        console.print(sentence, highlight=False)
    write_frame_page(result, page)
    console.print(f"The same as a picture: {page}")


def _configuration(config: Path | None) -> Configuration:
    from compd.configuration import load, shipped_configuration

    return load(config or shipped_configuration("tripod-cmm.yaml"))


def _show(reproduction: Reproduction, page: Path) -> None:
    """The table on the terminal, and the same with the picture on a page."""
    from rich.console import Console
    from rich.table import Table

    from compd.paper import HEAD

    table = Table(*HEAD, title=reproduction.title, title_justify="left")
    for reduction in reproduction.reductions:
        table.add_row(*reduction.row)
    console = Console()
    console.print(table)
    reproduction.write_page(page)
    console.print(f"The same as a picture: {page}")
