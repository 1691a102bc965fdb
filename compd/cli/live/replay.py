"""`compd replay`: compute a recorded run again by the live path."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

# Most cells of the CSV in the list; a file saved by another program differs everywhere.
_MAX_CELLS = 5


def replay(
    name: Annotated[Path, typer.Argument(help="NAME of `compd record` (all parts), or one part.")],
    machine: Annotated[Path, typer.Option("--machine", help="The daemon's configuration during the recording.")],
    model: Annotated[
        list[Path] | None,
        typer.Option("--model", help="A model file of the run without a copy beside the recording."),
    ] = None,
    setpoints: Annotated[bool, typer.Option(help="Print the resulting setpoints, one per line.")] = False,
) -> None:
    """Compute a recorded run again and compare its setpoints with the sent ones, bit for bit.

    Orders that clients gave meanwhile are listed. Exit code 1 when one differs, when rows of the CSV have no cycle, or
    when a cell of the CSV is not what its cycle says.
    """
    from compd.configuration import load
    from compd.live.record import RecordedCycles, ReplayedCycle, differing_cells, replay_cycles

    configuration = load(machine)
    transcripts = RecordedCycles(name)
    cycles = differing = 0
    first: ReplayedCycle | None = None
    for cycle in replay_cycles(configuration, transcripts, model or ()):
        cycles += 1
        if cycle.differs:
            differing += 1
            first = first or cycle
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
        typer.echo(f"{cycles} cycles replayed; every setpoint is the one that was sent{same}{changed}", err=True)
        if lacking or cells:
            raise typer.Exit(1)
        return
    typer.echo(f"{differing} of {cycles} setpoints differ; the first is tick {first.tick}, {first.where}", err=True)
    typer.echo(f"    sent     {first.sent.decode().rstrip()}", err=True)
    typer.echo(f"    replayed {first.replayed.decode().rstrip()}", err=True)
    if others:
        typer.echo(another, err=True)
    raise typer.Exit(1)


def _order_text(order: Mapping[str, Any]) -> str:
    """One line: time, order, client and outcome."""
    words = [f"order at {order.get('time_s', 0):.3f} s:", order.get("order", ""), order.get("subject", "")]
    words += ["from", order.get("client", "?"), f"({order['by']})" if order.get("by") else ""]
    return " ".join(filter(None, map(str, words))) + ("" if order.get("done") else ", refused")
