"""`compd demo`: the main job on a simulated machine, on real wires, in twenty seconds."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from compd.demo import DemoSession


def demo(
    config: Annotated[Path | None, typer.Argument(help="The machine; default: the shipped tripod.")] = None,
    seconds: Annotated[float, typer.Option(min=10, help="Duration, s.")] = 20.0,
    page: Annotated[Path, typer.Option(help="File of the page with the pictures.")] = Path("out/demo.html"),
    seed: Annotated[int, typer.Option(help="Random seed of weather, joints and targets.")] = 1,
    live: Annotated[
        bool, typer.Option("--live", help="Show the machine in the browser instead, until Ctrl-C.")
    ] = False,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="With --live: TCP port of the page; 0: any free port.")
    ] = 7760,
) -> None:
    """Run a simulated machine, the daemon and a controller; show the gain by compensation."""
    if live:
        _show_live(config, seed, port)
        return
    from rich.console import Console
    from rich.live import Live as LiveText

    from compd.configuration import load, shipped_configuration
    from compd.demo import SPEEDUP, progress, run_demo, summarise, verdict
    from compd.extras import EXTRAS, install_line

    drawn = all(find_spec(package) for package in EXTRAS["report"])
    if drawn:
        from compd.report import check_page_path

        page.parent.mkdir(parents=True, exist_ok=True)
        check_page_path(page)
    console = Console()
    configuration = load(config or shipped_configuration("tripod-cmm.yaml"))
    console.print(
        f"[bold]{configuration.machine}[/]: {len(configuration.gauges)} gauges on {len(configuration.lines)} lines, "
        f"each speaking its own protocol on a real pty or TCP port; weather {SPEEDUP:g} times faster than real."
    )
    _load_daemon()
    console.print("Starting the simulated machine and the daemon ...")
    with LiveText(console=console, refresh_per_second=8) as text:

        def show(session: DemoSession, elapsed_s: float, setpoint: dict[str, Any]) -> None:
            text.update(progress(session, elapsed_s, seconds, setpoint))

        session = run_demo(configuration, seconds, seed, show)
        if session.shortcoming:
            text.update("")
    if session.shortcoming:
        console.print(verdict(session), markup=False)
        raise typer.Exit(1)
    console.print(summarise(session))
    console.print(verdict(session))
    if not drawn:
        console.print(f"The same as pictures, with one package more: {install_line('report')}", markup=False)
        return
    from compd.demo import write_demo_page

    write_demo_page(page, session)
    console.print(f"The same as pictures: {page}")


def _load_daemon() -> None:
    """Compile the kernels at the first start on a machine, with a message, so that the daemon's start does not wait."""
    import_module("compd.live.run_daemon")


def _show_live(config: Path | None, seed: int, port: int) -> None:
    from compd.configuration import load, shipped_configuration
    from compd.demo import LIVE_SPEEDUP, run_live
    from compd.page import Token, hashed, new_token, run_page

    configuration = load(config or shipped_configuration("tripod-cmm.yaml"))
    token = new_token()
    typer.echo(
        f"{configuration.machine}, simulated; its weather {LIVE_SPEEDUP:g} times faster than real. "
        "Starting it and the daemon ..."
    )
    _load_daemon()
    tokens = [Token("this computer", "operate", hashed(token))]

    def serve(unix_socket: str) -> None:
        run_page(
            unix_socket,
            Path("recordings").absolute(),
            "127.0.0.1",
            port,
            tokens,
            lambda origin: typer.echo(f"open {origin}/?token={token} (Ctrl-C ends all three)"),
            configuration.path.absolute().parent,
            machine=configuration.path,
        )

    run_live(configuration, seed, serve)
