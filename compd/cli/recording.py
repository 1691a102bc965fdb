"""`compd recording`: what is in a recording, and can it be used?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.recording.recording import Recording

recording = typer.Typer(no_args_is_help=True, help="Recordings: readings of the machine beside a reference.")


@recording.callback()
def _recording() -> None:
    """Recordings: readings of the machine beside a reference."""


@recording.command()
def check(
    path: Annotated[Path, typer.Argument(help="The recording, NAME.csv, with NAME.yaml beside it.")],
    machine: Annotated[
        Path | None,
        typer.Option("--machine", help="The machine's configuration; one that comes with compd is found by its name."),
    ] = None,
) -> None:
    """Check a recording; report every problem at once, with file, row, column, value, what is allowed, next step."""
    from compd.comparison.open import read_with_machine

    found, _ = read_with_machine(path, machine, needs_reference=False)
    for warning in found.warnings:
        typer.echo(f"warning: {warning}")
    for line in _summary(found):
        typer.echo(line)


def _summary(found: Recording) -> list[str]:
    """What a person wants to see before trusting a recording: sizes, reference, and every row that is not used."""
    gauges = [
        f"{values.shape[1]} {name}"
        for name, values in (
            ("scales", found.scale_mm),
            ("joint comparators", found.joint_mm),
            ("frame comparators", found.frame_mm),
        )
        if values is not None
    ]
    needed = (*found.gauge_columns, *found.reference_columns, *found.model_columns)
    usable = found.usable(needed)
    hours = (found.time_s[-1] - found.time_s[0]) / 3600.0
    lines = [
        f"{found.path}: {found.machine}, {found.rows} rows over {hours:.2f} h, {_sessions(found)}",
        f"    gauges: {', '.join(gauges) or 'none'}; {len(found.quantities)} other quantities; "
        f"approach {'recorded' if found.approach_measured else 'from the scales' if gauges else 'not known'}",
        f"    reference: {_reference(found)}",
        f"    {int(usable.mask.sum())} rows have all of these",
    ]
    lines += [f"    {count} rows left out: {why}" for why, count in {**found.left_out, **usable.left_out}.items()]
    reasons = dict.fromkeys(found.sidecar.excluded.values())
    lines += [f"    excluded: {reason}" for reason in reasons]
    return [*lines, f"    sha256 {found.sha256}"]


def _sessions(found: Recording) -> str:
    if found.session is None:
        return f"no sessions: {len(set(found.fold.tolist()))} blocks of time"
    return f"{len(set(found.session.tolist()))} sessions"


def _reference(found: Recording) -> str:
    reference = found.reference
    if reference is None:
        return "none yet; put an instrument's export beside it with `compd join`"
    parts = [reference.quantity, ", ".join(found.reference_columns)]
    if reference.quantity != "link_length":
        parts.append(f"in the {reference.frame}'s frame")
    sigma = ", ".join(f"{value:g}" for value in reference.sigma_um)
    parts.append("uncertainty not known" if sigma == "nan" else f"sigma {sigma} um")
    return "; ".join(parts)
