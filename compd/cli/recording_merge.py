"""`compd recording merge`: what was measured first and what was measured next, as one recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def merge(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING RECORDING...", help="NAME.csv with NAME.yaml, in time's order.")
    ],
    out: Annotated[Path, typer.Option(help="The recording to write: NAME.csv, and NAME.yaml beside it.")],
    machine: Annotated[
        Path | None, typer.Option("--machine", help="The machine's configuration; a shipped one is found by its name.")
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Write over files that are there.")] = False,
) -> None:
    """Put recordings of one machine together, so that compare, diagnose and effect add learn from all of them."""
    from compd.comparison.open import read_with_machine
    from compd.errors import CompdError, Problem
    from compd.recording.merge import ASSUMED_GAP_S, merge_recordings

    if len(recordings) < 2:
        raise CompdError(
            Problem(where="compd recording merge", what="needs two recordings or more", value=str(recordings[0]))
        )
    problems: list[Problem] = []
    found = []
    for path in recordings:
        try:
            found.append(read_with_machine(path, machine)[0])
        except CompdError as error:
            problems += error.problems
    if problems:
        raise CompdError(list(dict.fromkeys(problems)))
    path = out if out.suffix == ".csv" else out.with_name(f"{out.name}.csv")
    merged = merge_recordings(found, path, overwrite)
    if not merged.gap_known:
        typer.echo(f"when each began is not recorded: {ASSUMED_GAP_S / 3600:g} h is put between them")
    each = ", ".join(f"{one.path} {rows}" for one, rows in zip(found, merged.rows, strict=True))
    typer.echo(f"written: {path}, {sum(merged.rows)} rows ({each})")
