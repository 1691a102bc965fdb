"""`compd fleet`: many machines, many recordings, one table and one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from compd.cli.option_groups import PageOptions, with_groups
from compd.cli.options import EffectsOption
from compd.cli.paths import PathKind
from compd.fleet import MachinesBy

if TYPE_CHECKING:
    from compd.fleet import RecordingResult

# Most sentences of a kind in the terminal; the page and the table have all.
MAX_SENTENCES = 20
# Number of machines above which inconspicuous ones share a line.
MAX_MACHINES = 12
# Exit code of shells after SIGINT.
_INTERRUPTED = 130

fleet = typer.Typer(
    no_args_is_help=True, help="Examine the recordings of many machines, on all cores or on a Dask cluster."
)

PlacesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="DIRECTORY|PATTERN...",
        help="Where the recordings are: directories, with all below them, or patterns in quotes: 'data/2026-*/*.csv'; "
        "'data/{machine}_*.csv' where the file's name says which machine it is.",
    ),
    PathKind.ANY,
]


class ExaminationOptions(NamedTuple):
    """Options of every examination of recordings."""

    out: Annotated[
        Path,
        typer.Option(
            help="The table to write (Parquet). Earlier results of the same files, model and options are kept.",
        ),
    ] = Path("fleet.parquet")
    machine: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            help="The configuration of a machine outside compd's, for the recordings that name it; or a "
            "pattern of several ('machines/*.yaml'). May be repeated.",
        ),
        PathKind.ANY,
    ] = None
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            help="A model file, for the recordings of its machine; or a pattern: 'models/{machine}.yaml' where "
            "machines that are built alike have a model each. May be repeated.",
        ),
        PathKind.ANY,
    ] = None
    machines_by: Annotated[
        MachinesBy,
        typer.Option(
            help="Distinction of machines with one configuration: by directory, or none (sidecar); auto prints its "
            "choice.",
        ),
    ] = MachinesBy.auto
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="A running Dask scheduler; default: all cores of this computer."),
    ] = None
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Examine every recording again, including those with a result in the table.")
    ] = False


@fleet.command()
@with_groups
def compare(
    places: PlacesArgument, options: ExaminationOptions = ExaminationOptions(), page: PageOptions = PageOptions()
) -> None:
    """Compare every recording with the model of its machine, refitting the model's effects on each.

    A recording that cannot be examined is a row with its problem, and the others go on; the exit code is then 1. A run
    that was interrupted goes on where it stopped.
    """
    _examine("compare", places, options, page)


@fleet.command()
@with_groups
def diagnose(
    places: PlacesArgument,
    options: ExaminationOptions = ExaminationOptions(),
    effects: EffectsOption = None,
    page: PageOptions = PageOptions(),
) -> None:
    """Diagnose every recording: find the effect that the model of its machine lacks, with its numbers.

    A recording that cannot be examined is a row with its problem, and the others go on; the exit code is then 1. A run
    that was interrupted goes on where it stopped.
    """
    _examine("diagnose", places, options, page, effects)


@fleet.command()
@with_groups
def report(
    places: Annotated[
        list[str],
        typer.Argument(
            metavar="TABLE|DIRECTORY|PATTERN...",
            help="The table that `compd fleet diagnose` or `compd fleet compare` wrote; or recordings, which are "
            "diagnosed first.",
        ),
        PathKind.ANY,
    ],
    page: PageOptions = PageOptions(Path("fleet.html")),
    options: ExaminationOptions = ExaminationOptions(),
    effects: EffectsOption = None,
) -> None:
    """Write the page: effects by machine, drifts, differing machines, unreadable recordings."""
    from compd.fleet import check_installed

    check_installed()
    from compd.fleet import is_table, read_table, write_fleet_page

    if not all(is_table(Path(place)) for place in places):
        _examine("diagnose", places, options, page, effects)
        return
    page.check()
    results = [result for place in places for result in read_table(Path(place))]
    assert page.html is not None
    write_fleet_page(page.html, results)
    _print_overview(results)
    typer.echo(f"The page: {page.html}")


def _examine(
    command: Literal["compare", "diagnose"],
    places: list[str],
    options: ExaminationOptions,
    page: PageOptions,
    effects: list[str] | None = None,
) -> None:
    """Examine the recordings in these places, write the table and optionally the page, print an overview."""
    from compd.fleet import check_installed

    check_installed()
    from compd.cli.problems import print_problems
    from compd.cli.progress import count_shown
    from compd.fleet import (
        Checkpoint,
        check_table_path,
        earlier_results,
        examination,
        examine_fleet,
        find_recordings,
        write_fleet_page,
        write_table,
    )

    wanted = examination(command, options.machine or (), options.model or (), effects or ())
    out = options.out
    check_table_path(out, command, page.overwrite)
    page.check()
    found = find_recordings(places, options.machines_by)
    print_problems(found.remarks, "remark: ")
    earlier = () if options.fresh else earlier_results(out)
    checkpoint = Checkpoint(out)
    with count_shown(len(found.recordings), "recordings") as done:

        def progress(result: RecordingResult) -> None:
            checkpoint.add(result)
            done(checkpoint.count)

        run = examine_fleet(wanted, found.recordings, options.scheduler, progress, earlier)
    write_table(out, run.results)
    if run.kept:
        typer.echo(f"{run.kept} of {len(run.results)} were in {out} already, of the same files, models and options.")
    _print_overview(run.results)
    typer.echo(f"The table: {out}")
    if page.html is not None:
        write_fleet_page(page.html, run.results)
        typer.echo(f"The page: {page.html}")
    if run.interrupted:
        typer.echo("Interrupted; the same command goes on where it stopped.")
        raise typer.Exit(_INTERRUPTED)
    raise typer.Exit(any(result.problem for result in run.results))


def _print_overview(results: list[RecordingResult] | tuple[RecordingResult, ...]) -> None:
    """The machines as a table, then what drifts and differs, then the problems."""
    from rich.console import Console
    from rich.table import Table

    from compd.fleet import Overview
    from compd.report import keep_words_whole

    console = Console(highlight=False, markup=False, soft_wrap=True)
    overview = Overview(results)
    console.print(overview.headline)
    quiet = overview.quiet if len(overview.machines) > MAX_MACHINES else []
    if len(overview.machines) > len(quiet):
        summary = overview.machine_table(without=quiet)
        table = Table(*summary.head)
        for row in summary.rows:
            table.add_row(*row)
        console.print(keep_words_whole(table, console.width))
    if quiet:
        console.print(f"Nothing is missing on {len(quiet)} others: {', '.join(quiet)}")
    sentences = overview.sentences()
    for sentence in sentences[:MAX_SENTENCES]:
        console.print(f"  - {sentence}")
    if len(sentences) > MAX_SENTENCES:
        console.print(f"  and {len(sentences) - MAX_SENTENCES} more (the page has all)")
    for result in overview.failed[:MAX_SENTENCES]:
        console.print(f"not examined: {result.problem.splitlines()[0]}")
    if len(overview.failed) > MAX_SENTENCES:
        console.print(f"and {len(overview.failed) - MAX_SENTENCES} more; the table has all, with what to do")
