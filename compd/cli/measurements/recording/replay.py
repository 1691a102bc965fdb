"""`compd recording replay`: compute a recorded run again by the live path."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

# Most cells of the CSV in the list; a file saved by another program differs everywhere.
_MAX_CELLS = 5


def replay(
    name: Annotated[Path, typer.Argument(help="NAME of `compd recording start` (all parts), or one part.")],
    machine: Annotated[Path, typer.Option("--machine", help="The daemon's configuration during the recording.")],
    model: Annotated[
        list[Path] | None,
        typer.Option("--model", help="A model file of the run without a copy beside the recording."),
    ] = None,
    setpoints: Annotated[bool, typer.Option(help="Print the resulting setpoints, one per line.")] = False,
) -> None:
    """Compute a recorded run again and compare its setpoints with the sent ones, which are one of three.

    The same to the last bit; within 1e-12 mm by another kernel, whose versions are named; or different. Orders that
    clients gave meanwhile are listed. Exit code 1 when a setpoint is different, when rows of the CSV have no cycle, or
    when a cell of the CSV is not what its cycle says.
    """
    from compd.configuration import load
    from compd.kernel_versions import versions_text_here
    from compd.live.record import Agreement, RecordedCycles, ReplayedCycle, differing_cells, replay_cycles

    configuration = load(machine)
    transcripts = RecordedCycles(name)
    cycles = differing = rounded = 0
    first: ReplayedCycle | None = None
    kernels: dict[str, None] = {}  # in the order in which they computed
    for cycle in replay_cycles(configuration, transcripts, model or ()):
        cycles += 1
        if cycle.differs:
            differing += 1
            first = first or cycle
        rounded += cycle.agreement is Agreement.ANOTHER_KERNEL
        if cycle.agreement is not Agreement.SAME:
            kernels[cycle.computed_by] = None
        if setpoints:
            typer.echo(cycle.replayed, nl=False)
    for order in transcripts.orders:
        typer.echo(_order_text(order), err=True)
    if transcripts.torn_lines:
        typer.echo(f"{transcripts.torn_lines} torn line at the end left out: the recorder was killed", err=True)
    lacking = transcripts.rows_without_cycle()
    for table, rows in lacking.items():
        typer.echo(f"{table}: {rows} rows have no cycle beside them, and cannot be replayed", err=True)
    cells = list(islice(differing_cells(RecordedCycles(name)), _MAX_CELLS))
    for cell in cells:
        text = f"{cell.cell or 'no value'}, by the cycle {cell.recorded or 'no value'}"
        typer.echo(f"{cell.where} was changed: {text}", err=True)
    others = transcripts.config_hashes() - {configuration.config_hash}
    another = f"recorded with another configuration ({', '.join(sorted(others))}, this is {configuration.config_hash})"
    if first is None:
        same = f", though {another}" if others else ""
        changed = "; the CSV is not what was recorded" if cells else ""
        agrees = Agreement.SAME if not rounded else Agreement.ANOTHER_KERNEL
        some = f" ({rounded} of them; the others to the last bit)" if 0 < rounded < cycles else ""
        text = f"every setpoint is the one that was sent, {agrees}{some}"
        typer.echo(f"{cycles} cycles replayed; {text}{same}{changed}", err=True)
        _tell_kernels(kernels, versions_text_here())
        if lacking or cells:
            raise typer.Exit(1)
        return
    typer.echo(f"{differing} of {cycles} setpoints differ; the first is tick {first.tick}, {first.where}", err=True)
    typer.echo(f"    sent     {first.sent.decode().rstrip()}", err=True)
    typer.echo(f"    replayed {first.replayed.decode().rstrip()}", err=True)
    _tell_kernels(kernels, versions_text_here())
    if others:
        typer.echo(another, err=True)
    raise typer.Exit(1)


def _tell_kernels(kernels: Iterable[str], here: str) -> None:
    """Which kernels computed setpoints that are not the same to the last bit, where they are not those of `here`."""
    if others := [text for text in kernels if text != here]:
        for text in others:
            typer.echo(f"    recorded by {text}", err=True)
        typer.echo(f"    replayed by {here}", err=True)


def _order_text(order: Mapping[str, Any]) -> str:
    """One line: time, order, client and outcome."""
    words = [f"order at {order.get('time_s', 0):.3f} s:", order.get("order", ""), order.get("subject", "")]
    words += ["from", order.get("client", "?"), f"({order['by']})" if order.get("by") else ""]
    return " ".join(filter(None, map(str, words))) + ("" if order.get("done") else ", refused")
