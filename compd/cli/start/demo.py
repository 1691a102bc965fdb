"""`compd demo`: the main job on a simulated machine, on real wires, in twenty seconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from compd.demo.session import DemoSession


def demo(
    config: Annotated[Path | None, typer.Argument(help="The machine; the shipped tripod if left out.")] = None,
    seconds: Annotated[float, typer.Option(min=5, help="How long it runs.")] = 20.0,
    page: Annotated[Path, typer.Option(help="Where the page with the pictures goes.")] = Path("out/demo.html"),
    seed: Annotated[int, typer.Option(help="Weather, joints and targets follow from it.")] = 1,
) -> None:
    """Run a simulated machine, the daemon and a controller; show what compensation gains."""
    from rich.console import Console
    from rich.live import Live

    from compd.configuration import load
    from compd.configuration.shipped import shipped_configuration
    from compd.demo.page import progress, summarise, verdict, write_demo_page
    from compd.demo.session import SPEEDUP, run_demo
    from compd.report.page import check_page_path

    page.parent.mkdir(parents=True, exist_ok=True)
    check_page_path(page)
    console = Console()
    configuration = load(config or shipped_configuration("tripod-cmm.yaml"))
    console.print(
        f"[bold]{configuration.machine}[/]: {len(configuration.gauges)} gauges on {len(configuration.lines)} lines, "
        f"each speaking its own protocol on a real pty or TCP port; weather {SPEEDUP:g} times faster than real."
    )
    console.print("Starting the simulated machine and the daemon (the very first start compiles the kernels) ...")
    with Live(console=console, refresh_per_second=8) as live:

        def show(session: DemoSession, elapsed_s: float, setpoint: dict[str, Any]) -> None:
            live.update(progress(session, elapsed_s, seconds, setpoint))

        session = run_demo(configuration, seconds, seed, show)
    console.print(summarise(session))
    console.print(verdict(session))
    write_demo_page(page, session)
    console.print(f"The same as pictures: {page}")
