"""`compd recording`: check, change and merge recordings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.cli.options import MachineOption

if TYPE_CHECKING:
    from compd.data_fault import DataFault
    from compd.recording import Recording

recording = typer.Typer()

RecordingArgument = Annotated[
    Path, typer.Argument(help="The recording, NAME.csv or NAME.parquet, with NAME.yaml beside it.")
]


@recording.command()
def check(
    path: RecordingArgument,
    machine: MachineOption = None,
) -> None:
    """Check a recording; report every problem at once, with file, row, column, value, what is allowed, next step."""
    from compd.comparison import read_with_machine

    loaded, _ = read_with_machine(path, machine, needs_reference=False)
    for warning in loaded.warnings:
        typer.echo(f"warning: {warning}")
    for fault in _faults(loaded, path, machine):
        typer.echo(f"look: {fault.text}")
    for line in _summary(loaded):
        typer.echo(line)


@recording.command()
def merge(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING RECORDING...",
            help="The recordings, NAME.csv or NAME.parquet with NAME.yaml, in the order of time.",
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="The recording to write: NAME.csv or NAME.parquet, and NAME.yaml beside it.")
    ],
    machine: MachineOption = None,
    overwrite: Annotated[bool, typer.Option(help="Overwrite existing files.")] = False,
) -> None:
    """Merge recordings of one machine, so that compare, diagnose and model add learn from all of them."""
    from compd.comparison import read_with_machine
    from compd.errors import CompdError, Problem
    from compd.recording import ASSUMED_GAP_S, merge_recordings
    from compd.table_file import written_path

    if len(recordings) < 2:
        raise CompdError.of("compd recording merge", "needs two recordings or more", value=str(recordings[0]))
    problems: list[Problem] = []
    parts = []
    for path in recordings:
        try:
            parts.append(read_with_machine(path, machine)[0])
        except CompdError as error:
            problems += error.problems
    if problems:
        raise CompdError(list(dict.fromkeys(problems)))
    path = written_path(out)
    merged = merge_recordings(parts, path, overwrite)
    if not merged.gap_known:
        typer.echo(f"when each began is not recorded: {ASSUMED_GAP_S / 3600:g} h is put between them")
    counts = ", ".join(f"{part.path} {rows}" for part, rows in zip(parts, merged.rows, strict=True))
    typer.echo(f"written: {path}, {sum(merged.rows)} rows ({counts})")


@recording.command()
def convert(
    source: Annotated[
        Path,
        typer.Argument(
            help="The recording, NAME.csv or NAME.parquet, with NAME.yaml beside it; or NAME.arrow, left by a "
            "`compd recording start` that was killed."
        ),
    ],
    destination: Annotated[Path, typer.Argument(help="What to write: NAME.parquet or NAME.csv.")],
    overwrite: Annotated[bool, typer.Option(help="Overwrite existing files.")] = False,
) -> None:
    """Write a recording of any length as Parquet or as CSV: the same numbers in the same rows, the same sidecar."""
    from compd.cli.progress import count_shown
    from compd.recording import convert_recording, rows_to_convert

    with count_shown(rows_to_convert(source), "rows") as progress:
        rows = convert_recording(source, destination, overwrite, progress)
    typer.echo(f"written: {destination}, {rows} rows")


RowsOption = Annotated[
    str, typer.Option(help="Rows as a spreadsheet shows them, the header being row 1: 17-20,25.", metavar="ROWS")
]


@recording.command()
def exclude(
    path: RecordingArgument,
    rows: RowsOption,
    reason: Annotated[str, typer.Option(help="Reason, kept in NAME.yaml.")],
) -> None:
    """Leave rows out of a recording, with a reason; only its sidecar is changed."""
    from compd.recording import exclude_rows, rows_of_text

    numbers = rows_of_text(rows, "--rows")
    exclude_rows(path, numbers, reason)
    typer.echo(f"{path.with_suffix('.yaml')}: left out: {len(numbers)} rows, {reason}")


@recording.command()
def include(
    path: RecordingArgument,
    rows: RowsOption,
) -> None:
    """Let rows count again after leaving them out."""
    from compd.recording import include_rows, rows_of_text

    numbers = rows_of_text(rows, "--rows")
    include_rows(path, numbers)
    typer.echo(f"{path.with_suffix('.yaml')}: {len(numbers)} rows count again")


def _faults(contents: Recording, path: Path, machine: Path | None) -> tuple[DataFault, ...]:
    """What is wrong with the data; of a recording with a reference also what its comparison with the model shows."""
    from compd.comparison import compare, is_long, open_recording
    from compd.errors import CompdError

    if contents.reference is None or is_long(path):
        return contents.faults
    try:
        return compare(open_recording(path, machine)).faults
    except CompdError:  # `compd compare` says why the two cannot be compared
        return contents.faults


def _summary(contents: Recording) -> list[str]:
    """Summary of a recording for a person: sizes, reference, and every unused row."""
    gauges = [
        f"{values.shape[1]} {name}"
        for name, values in (
            ("scales", contents.scale_mm),
            ("joint comparators", contents.joint_mm),
            ("frame comparators", contents.frame_mm),
        )
        if values is not None
    ]
    if contents.commanded_mm is not None:
        gauges.insert(0, "none along the links, but the commanded pose")
    needed = (*contents.gauge_columns, *contents.reference_columns, *contents.model_columns)
    usable = contents.usable(needed)
    hours = (contents.time_s[-1] - contents.time_s[0]) / 3600.0
    when = f"over {hours:.2f} h" if contents.has_time else "in order, without time"
    lines = [
        f"{contents.path}: {contents.machine}, {contents.rows} rows {when}, {_sessions(contents)}",
        f"    gauges: {', '.join(gauges) or 'none'}; {len(contents.quantities)} other quantities; "
        f"approach {'recorded' if contents.approach_measured else 'from the scales' if gauges else 'not known'}",
        f"    reference: {_reference(contents)}",
        f"    {int(usable.mask.sum())} rows have all of these",
    ]
    if contents.quantities and contents.sidecar.counts_from:
        lines.append(f"    effects count from {contents.sidecar.counts_from}")
    lines += [f"    {count} rows left out: {why}" for why, count in {**contents.left_out, **usable.left_out}.items()]
    reasons = dict.fromkeys(contents.sidecar.excluded.values())
    lines += [f"    excluded: {reason}" for reason in reasons]
    return [*lines, f"    sha256 {contents.sha256}"]


def _sessions(contents: Recording) -> str:
    if contents.session is None:
        blocks = "blocks of time" if contents.has_time else "blocks of rows"
        return f"no sessions: {len(set(contents.fold.tolist()))} {blocks}"
    return f"{len(set(contents.session.tolist()))} sessions"


def _reference(contents: Recording) -> str:
    reference = contents.reference
    if reference is None:
        return "none yet; put an instrument's export beside it with `compd recording join`"
    parts = [reference.quantity, ", ".join(contents.reference_columns)]
    if reference.of_fixed_places:
        parts.append("fixed places are fitted along")
    elif reference.quantity != "link_length":
        parts.append(f"in the {reference.frame}'s frame")
    sigma = ", ".join(f"{value:g}" for value in reference.standard_uncertainty)
    parts.append("uncertainty not known" if sigma == "nan" else f"sigma {sigma} {reference.unit}")
    if math.isfinite(reference.sigma_urad):
        parts.append(f"attitude {reference.sigma_urad:g} urad")
    return "; ".join(parts)
