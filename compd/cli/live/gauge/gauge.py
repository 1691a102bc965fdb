"""`compd gauge`: from a plug to a number."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from compd.cli.option_groups import with_groups
from compd.cli.options import OverwriteOption
from compd.cli.paths import PathKind

if TYPE_CHECKING:
    from compd.gauge import Reading
    from compd.gauge_tools import GaugeStatistics, GaugeTarget
    from compd.lines import PortArguments

gauge = typer.Typer()


class TargetOptions(NamedTuple):
    """One gauge: of a file, or a driver with its options."""

    target: Annotated[
        str,
        typer.Argument(help="A driver's name, or a file (.yaml): a machine, or gauges and their lines."),
        PathKind.NAME_OR_FILE,
    ]
    name: Annotated[str | None, typer.Argument(help="Name of the gauge, for a file of several.")] = None
    assignments: Annotated[list[str] | None, typer.Option("--set", help="An option of the driver: heads=9.")] = None


class LineOptions(NamedTuple):
    """The line of a gauge."""

    port: Annotated[
        str,
        typer.Option(
            help="/dev/serial/by-id/..., pyserial URL, host:port, or opc.tcp://host:port, unless a file names the line."
        ),
        PathKind.NAME_OR_FILE,
    ] = ""
    baud: Annotated[int | None, typer.Option(help="Bits per second, from the device's manual.")] = None
    format_: Annotated[
        str | None, typer.Option("--format", help="Data bits, parity, stop bits: 8N1, 7E2 ..., from the manual.")
    ] = None
    timeout_s: Annotated[float, typer.Option("--timeout", min=0.01, help="Wait (s) for the first byte.")] = 1.0
    line_keys: Annotated[
        list[str] | None,
        typer.Option("--line", help="Another key of the line: echo=true, pause_s=0.02, rts=false, kind=modbus_ascii."),
    ] = None

    @property
    def arguments(self) -> PortArguments:
        """As `compd.lines` takes them."""
        from compd.lines import PortArguments

        return PortArguments(self.port, self.baud, self.format_, self.timeout_s, self.line_keys or ())


@gauge.command("list")
def list_gauges() -> None:
    """List the installed drivers and presets, with the source of each protocol."""
    from rich.console import Console
    from rich.table import Table

    from compd.gauge_tools import catalogue
    from compd.report import keep_words_whole

    entries = catalogue()
    table = Table("driver", "line carries", "what it is", "options it needs")
    for entry in entries:
        title = entry.title if entry.simulated else f"{entry.title} Not simulated."
        table.add_row(entry.name, entry.line_kind, title, ", ".join(entry.needed_options))
    console = Console()
    console.print(keep_words_whole(table, console.width))
    typer.echo("An unknown gauge: `compd gauge learn`; docs/how-to/describe-a-gauge.md says the rest.")


@gauge.command()
def show(name: Annotated[str, typer.Argument(help="A driver's name: `compd gauge list`.")]) -> None:
    """Show a driver: its protocol with the source, an example, and every option."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from compd.cli.reflow import reflowed
    from compd.gauge_tools import driver_description

    description = driver_description(name)
    console = Console()
    console.print(reflowed(description.text), markup=False, highlight=False)
    table = Table("option", "needed", "meaning", title="Options", title_justify="left")
    table.columns[0].no_wrap = True
    for option in description.options:
        needed = "yes" if option.needed else "no" if option.default == "None" else f"no: {option.default}"
        table.add_row(option.name, escape(needed), escape(option.meaning))
    console.print(table)


@gauge.command()
def scan(
    probe: Annotated[
        bool, typer.Option("--probe", help="Ask every port with each preset's read request. SENDS BYTES to all ports.")
    ] = False,
) -> None:
    """Find serial ports; with --probe, find the presets that match the answers."""
    from compd.gauge_tools import announcements, preset_candidates
    from compd.lines import serial_ports

    ports = serial_ports()
    if not ports:
        typer.echo("no serial port found; is the adapter plugged in, and are you in group dialout?")
        return
    for port in ports:
        typer.echo(f"{port.path}\n    {port.device}  {port.description}")
        if port.note:
            typer.echo(f"    {port.note}")
    if not probe:
        return
    typer.echo(
        "Every preset's read request now goes to every port, at that preset's usual baud rate. A device that\n"
        "is no gauge may take it for a command."
    )
    typer.confirm("Is nothing dangerous connected?", abort=True)
    candidates = preset_candidates()
    for port in ports:
        for text in announcements(port.path, candidates):
            typer.echo(f"{port.path}: {text}")


@gauge.command()
@with_groups
def read(one: TargetOptions, line: LineOptions) -> None:
    """Read one gauge once, and show every byte. Exit code 1 if a channel has no value, or one that is stale."""
    from compd.cli.problems import print_problems
    from compd.clock import MonotonicClock
    from compd.gauge import LineFault
    from compd.gauge_tools import aged, option_doubts, read_gauge

    gauge_target = _target(one, line)
    clock = MonotonicClock()
    started_s = clock.monotonic()

    def show(direction: str, data: bytes) -> None:
        typer.echo(f"{(clock.monotonic() - started_s) * 1e3:8.1f} ms {direction} {data.hex(' ')}   {data!r}")

    try:
        readings = read_gauge(gauge_target, clock, show)
    except LineFault as fault:
        typer.echo(f"{gauge_target.name}: {fault}")
        raise typer.Exit(1) from fault
    now_s = clock.monotonic()
    readings = [aged(reading, now_s, gauge_target.stale_after_s) for reading in readings]
    for channel, reading in zip(gauge_target.gauge.channels, readings, strict=True):
        age = f", {(now_s - reading.time_s) * 1e3:.3g} ms old" if reading.ok else ""
        typer.echo(f"{gauge_target.name}.{channel.name}: {_reading_text(reading, channel.unit)}{age}")
    print_problems(option_doubts(gauge_target), "note: ", sys.stdout)
    raise typer.Exit(0 if all(reading.ok for reading in readings) else 1)


@gauge.command()
@with_groups
def watch(
    one: TargetOptions,
    line: LineOptions = LineOptions(),
    polls: Annotated[int | None, typer.Option(min=1, help="Stop after this many polls; default: at Ctrl-C.")] = None,
) -> None:
    """Poll one gauge as fast as its line allows, or listen to it: values, rate, age, noise and faults."""
    from rich.console import Console
    from rich.live import Live

    from compd.clock import MonotonicClock
    from compd.gauge_tools import GaugeStatistics, aged, poll_gauge

    gauge_target = _target(one, line)
    clock = MonotonicClock()
    statistics = GaugeStatistics(gauge_target.gauge.channels)
    with Live(console=Console(), refresh_per_second=5) as live:
        try:
            for readings in poll_gauge(gauge_target, clock, polls):
                now_s = clock.monotonic()
                statistics.add([aged(each, now_s, gauge_target.stale_after_s) for each in readings], now_s)
                live.update(_statistics_table(gauge_target.name, statistics, clock.monotonic()))
        except KeyboardInterrupt:
            return


@gauge.command()
@with_groups
def learn(
    capture: Annotated[
        Path | None, typer.Argument(help='File of lines `> 3F 0D` and `< 2B 31 ...` (hex), or > "?\\r" (text).')
    ] = None,
    line: LineOptions = LineOptions(),
    out: Annotated[str, typer.Option(help=r"Request to send, with escapes: '?\r'; empty for unsolicited data.")] = "",
    replies: Annotated[int, typer.Option(min=3, help="Number of replies to capture live.")] = 6,
    unit: Annotated[
        str,
        typer.Option(help="Unit of the numbers on the wire, if the replies lack it: mm, um ...; or mm,inch."),
    ] = "",
    names: Annotated[str, typer.Option(help="Names of the numbers, with commas between; - skips one: a,-,b.")] = "",
    ranges: Annotated[
        list[str] | None,
        typer.Option("--range", help="LOWEST,HIGHEST that the sensor can deliver, in mm (degC ...), or unknown."),
    ] = None,
    error: Annotated[
        list[str] | None, typer.Option(help="An error reply and its quality: 'ERR0=sensor_fault'.")
    ] = None,
    factors: Annotated[
        list[str] | None,
        typer.Option(help="Words beside a number that multiply it, a unit or a sign: 'mm=1|um=0.001', '+=1|-=-1'."),
    ] = None,
    ignore: Annotated[
        str, typer.Option(help="Letters and signs that vary beside a number and do not touch its value: 'UGLE'.")
    ] = "",
    constant: Annotated[
        list[str] | None, typer.Option(help="Digits in front of a number that are no part of it, an address: 12.")
    ] = None,
    decimals: Annotated[
        int | None,
        typer.Option(min=0, help="Decimals of the display, if more digits follow or no point is sent."),
    ] = None,
    decimal_mark: Annotated[str, typer.Option(help="Decimal mark of ambiguous replies: , or .")] = "",
    skip_end: Annotated[int, typer.Option(min=0, help="Skip this many characters at the end of every reply.")] = 0,
    plain: Annotated[bool, typer.Option("--plain", help="Every digit belongs to its number.")] = False,
    to: Annotated[
        Path | None, typer.Option(help="Write the gauge and its line to this file, for `read` and `watch`.")
    ] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Write a `serial_ascii` description from a few replies of a gauge that no preset knows.

    What the replies leave open is asked, each question with the option that answers it.
    """
    from compd.files import check_replaceable
    from compd.gauge_description import (
        Answers,
        DescriptionError,
        capture_live,
        error_reply,
        learn_gauge,
        range_of,
        read_capture,
        rounds,
        saved_capture,
    )
    from compd.gauge_tools import LEARNED_GAUGE, byte_line_settings, gauge_file_text

    if to is not None:
        check_replaceable(to, (f"{LEARNED_GAUGE}:".encode(),), "a description of a gauge", overwrite)
    if capture is None and not line.port:
        raise typer.BadParameter("name a capture file, or a --port")
    answers = Answers(
        units=_listed(unit),
        names=_listed(names),
        ranges=tuple(map(range_of, ranges or ())),
        errors=dict(map(error_reply, error or ())),
        ignored=ignore,
        factors=tuple(factors or ()),
        constants=tuple(constant or ()),
        decimals=decimals,
        decimal_mark=decimal_mark,
        skipped_end=skip_end,
        plain=plain,
    )
    settings = byte_line_settings(line.arguments) if line.port else None
    if capture is not None:
        captured = read_capture(capture)
    elif settings is not None:
        captured = capture_live(settings, out, replies, _between_captures, typer.echo)
    try:
        description, values = learn_gauge(captured, answers)
    except DescriptionError:
        if capture is None:
            typer.echo(f"# the replies are kept: compd gauge learn {saved_capture(captured)} ... takes them again")
        raise
    for replies_together, value in zip(rounds(captured), values, strict=True):
        typer.echo(f"# {', '.join(map(repr, replies_together.values()))} -> {value}")
    for note in description.notes:
        typer.echo(f"# note: {note}")
    text = gauge_file_text(description.options, settings)
    typer.echo(text)
    if to is not None:
        to.write_text(text, encoding="utf-8")


def _listed(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _between_captures(done: int, wanted: int) -> None:
    typer.echo(f"{done} of {wanted} captured; move the gauge, then Enter: ", nl=False)
    sys.stdin.readline()  # at its end, as without a terminal, there is no waiting for a key
    typer.echo()


def _target(one: TargetOptions, line: LineOptions) -> GaugeTarget:
    from compd.gauge_tools import gauge_of_driver, gauge_of_file

    if one.target.endswith((".yaml", ".yml")):
        return gauge_of_file(Path(one.target), one.name, line.arguments)
    if not line.port:
        raise typer.BadParameter("a driver needs --port (and --baud, --format); or name a configuration and its gauge")
    return gauge_of_driver(one.target, line.arguments, one.assignments or ())


def _reading_text(reading: Reading, unit: str) -> str:
    return f"{reading.value:.6f} {unit}" if reading.ok else f"{reading.quality} {reading.detail}".rstrip()


def _statistics_table(name: str, statistics: GaugeStatistics, now_s: float) -> Any:
    from rich.table import Table

    faults = ", ".join(f"{quality} {count}" for quality, count in statistics.faults.items()) or "none"
    table = Table(
        "channel",
        "value",
        "mean",
        "noise (1 sigma)",
        "age, ms",
        title=f"{name}: {statistics.polls} polls, {statistics.rate_hz:.1f} Hz, faults: {faults}",
    )
    for k, (channel, reading) in enumerate(zip(statistics.channels, statistics.last, strict=True)):
        scale, unit = (1e3, "um") if channel.unit == "mm" else (1.0, channel.unit)
        noise, age_ms = statistics.noise(k) * scale, statistics.age_s(k, now_s) * 1e3
        table.add_row(
            channel.name,
            _reading_text(reading, channel.unit),
            f"{statistics.mean(k):.6f} {channel.unit}",
            f"{noise:.3f} {unit}",
            f"{age_ms:.1f}",
        )
    return table
