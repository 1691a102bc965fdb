"""`compd sim run`: a simulated machine on real ports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from compd.cli.paths import PathKind

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from compd.configuration import Configuration
    from compd.simulation import Simulation, SizedCause

LOOK_EVERY_S = 0.25


def run(
    config: Annotated[Path, typer.Argument(help="The machine's configuration; it is read, never written.")],
    directory: Annotated[
        Path | None,
        typer.Option(help="Directory of ports, sockets and the daemon's configuration; default: a new one."),
        PathKind.FOLDER,
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of weather, joints and points.")] = 1,
    speedup: Annotated[float, typer.Option(min=0.001, max=100_000, help="Speed-up of weather and warm-up.")] = 1.0,
    zero_hold: Annotated[
        float, typer.Option(min=0, help="Seconds at machine zero before switch-on, for taking machine zero.")
    ] = 60.0,
    seconds: Annotated[float | None, typer.Option(min=0, help="Stop after this many seconds.")] = None,
    hidden: Annotated[
        list[int] | None,
        typer.Option(
            min=0,
            help="Hide a random cause by this seed, in a machine whose gauges measure all else.",
        ),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID[=STRENGTH]", help="Hide this cause likewise; default strength: three times the noise."
        ),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(help="After machine zero go through these rows, written by `compd plan --out`."),
    ] = None,
    zero_degC: Annotated[
        float, typer.Option("--zero-temperature", help="Temperature of machine and room at switch-on, degC.")
    ] = 20.0,
    broker: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="The MQTT broker to which lines of kind mqtt publish.")
    ] = None,
) -> None:
    """Run the simulated machine: it moves, warms up, bends, and serves every gauge in its own protocol.

    Without a plan it visits points for ever. With one it visits them once, so that `compd recording join` finds the
    clocks, then goes through the plan's rows: sets the load, holds parts and room as planned, comes from the planned
    side, waits (--speedup takes that much of it away), dwells; then it stands still.

    `compd sim fault` breaks a line of it. At the end the daemon's configuration, ports, sockets and machine zero are
    removed; only the sealed answer of --hidden and --effect stays, until the next machine is simulated there.
    """
    import contextlib
    import math
    import signal
    import tempfile
    import threading

    from rich.console import Console
    from rich.live import Live

    from compd.clock import MonotonicClock
    from compd.configuration import load
    from compd.live.system import use_fifo
    from compd.simulation import (
        FULLY_MEASURED,
        SEALED_ANSWER,
        AirAtZero,
        Mechanism,
        Simulation,
        World,
        read_plan,
        seen_by,
        write_answer,
    )

    configuration = load(config)
    measured = [quantity.name for quantity in configuration.wiring.quantities]
    rows = () if plan is None else read_plan(plan, Mechanism(configuration.geometry), measured)
    sized = _hidden(configuration, seed, hidden or (), effect or ())
    world = World(
        configuration.geometry,
        configuration.wiring,
        seed,
        speedup,
        zero_hold,
        strengths=seen_by(FULLY_MEASURED, len(configuration.wiring.joint)) if sized else None,
        causes=[cause.cause for cause in sized],
        rows=rows,
        air_at_zero=AirAtZero(zero_degC),
    )
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: stop.set())
    clock = MonotonicClock()
    console = Console()
    with contextlib.ExitStack() as stack:
        if directory is None:
            directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="compd-")))
        directory.mkdir(parents=True, exist_ok=True)
        simulation = Simulation(configuration, world, directory.resolve(), clock, _address(broker))
        stack.callback(simulation.stop)
        # real devices are not late on a busy computer: priority below the polling daemon, above all other processes
        use_fifo(configuration.loop.priority // 8)
        daemon = simulation.start()
        if sized:
            write_answer(directory / SEALED_ANSWER, sized, [], seed)
        console.print(_lines(simulation))
        console.print(_next_commands(simulation, daemon), highlight=False, soft_wrap=True)
        done = not rows
        end_s = math.inf if seconds is None else clock.monotonic() + seconds
        with Live(console=console, auto_refresh=False, transient=True) as live:
            while not clock.wait(stop, LOOK_EVERY_S) and clock.monotonic() < end_s:
                if console.is_terminal:
                    live.update(_status(simulation), refresh=True)
                if not done and simulation.truth().get("plan", {}).get("done"):
                    console.print(f"The plan is done: {plan}, {len(rows)} rows. It stands still; Ctrl-C ends.")
                    done = True


def _address(broker: str | None) -> tuple[str, int] | None:
    if broker is None:
        return None
    host, _, port = broker.rpartition(":")
    if not host or not port.isdigit():
        raise typer.BadParameter(f"{broker} is not HOST:PORT, such as 127.0.0.1:1884", param_hint="--broker")
    return host, int(port)


def _hidden(configuration: Configuration, seed: int, numbers: Sequence[int], texts: Sequence[str]) -> list[SizedCause]:
    """The causes to be hidden: drawn from numbers, or stated."""
    from compd.simulation import CauseSizer, draw_hidden, parse_hidden

    wiring = configuration.wiring
    sizer = CauseSizer(configuration.geometry, wiring, seed)
    drawn = [draw_hidden(number, sizer.mechanism, wiring) for number in numbers]
    return [sizer.size(cause) for cause in (*drawn, *parse_hidden(texts))]


def _lines(simulation: Simulation) -> Table:
    """Served lines and their addresses."""
    from rich.table import Table

    configuration = simulation.configuration
    table = Table(title=f"{configuration.machine}, simulated in {simulation.directory}", title_justify="left")
    for column in ("line", "kind", "port", "baud", "gauges"):
        table.add_column(column, overflow="fold")
    for name, settings in configuration.lines.items():
        port = simulation.ports[name]
        gauges = [
            f"{gauge} ({options.driver})" for gauge, options in configuration.gauges.items() if options.line == name
        ]
        table.add_row(
            name,
            settings.kind,
            port.removeprefix(f"{simulation.directory}/") if isinstance(port, str) else f"{port[0]}:{port[1]}",
            str(getattr(settings, "baud", "")),
            ", ".join(gauges),
        )
    return table


def _next_commands(simulation: Simulation, daemon: Configuration) -> str:
    hold_s, socket = simulation.world.zero_hold_s, daemon.sockets.unix.path
    return (
        "The daemon cannot tell it from the real machine. In other terminals:\n"
        f"    compd run {daemon.path}\n"
        f"    compd zero --daemon {socket}    (it stands at machine zero for the next {hold_s:.0f} s)\n"
        f"    compd watch --daemon {socket}\n"
        f"    compd sim tracker {simulation.directory} --out track.csv    (a laser tracker looks at the tip)\n"
        f"    compd sim fault {simulation.directory} LINE FAULT    (breaks a line; without LINE: which, and how)\n"
        f"Truth and commands: {simulation.directory / 'control.sock'}. Ctrl-C ends, and removes what is there."
    )


def _planned(plan: Mapping[str, Any]) -> str:
    """Progress of the plan."""
    doing = {
        "walk": "a walk first, for the clocks",
        "way": "on the way",
        "settle": "parts settle",
        "wait": "waiting",
        "look": "at the row",
    }
    if plan.get("done", True):
        return "the plan is done, standing still"
    return f"row {plan['row']} of {plan['rows']}, {plan['purpose']}: {doing[plan['doing']]}"


def _status(simulation: Simulation) -> Text:
    """One line: action, tip, temperatures, displacement of the frame."""
    from rich.text import Text

    from compd.units import UM_PER_MM

    truth, sense = simulation.truth(), simulation.world.sense
    doing = {
        "zero": f"at machine zero, {truth['zero_hold_s']:.0f} s more",
        "tour": f"{truth['phase']}, point {truth['point']}",
        "plan": _planned(truth.get("plan", {})),
        "commanded": f"commanded, {truth['phase']}",
        "following": f"following a controller, {truth['phase']}",
        "blocked": "blocked: the links cannot meet there",
    }[truth["mode"]]
    tip = " ".join(f"{value:9.4f}" for value in truth["tip_mm"])
    frame_mm = [sense(name) for name in simulation.world.names if name.startswith("frame_")]
    frame = f"  frame {max(frame_mm, key=abs) * UM_PER_MM:+.1f} um at most" if frame_mm else ""
    return Text(
        f"{truth['time_s']:8.1f} s  {doing:<28} tip in {{{truth['tip_frame']}}} {tip} mm  "
        f"room {sense('temperature_room_degC'):.2f}, link 1 {sense('temperature_link_1_degC'):.2f} degC{frame}",
        no_wrap=True,
        overflow="ellipsis",
    )
