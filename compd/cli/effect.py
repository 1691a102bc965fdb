"""`compd effect`: the library of physical causes, and what each does to a machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType

    from compd.configuration import Configuration
    from compd.model.effect import Effect

effect = typer.Typer(no_args_is_help=True, help="The library of physical causes: list them, show one on a machine.")


@effect.command(name="list")
def list_effects() -> None:
    """List every effect that is installed: where it acts, what it needs, what it is."""
    from rich.console import Console
    from rich.table import Table

    from compd.model.library import load_library

    table = Table("effect", "port", "needs", "physics")
    table.columns[0].no_wrap = True
    table.columns[2].overflow = "fold"  # names of quantities are to be copied whole
    for one in load_library().values():
        table.add_row(one.id, one.port, ", ".join(one.needs) or "-", one.physics)
    Console().print(table)


@effect.command()
def show(
    name: Annotated[
        str, typer.Argument(metavar="ID", help="An id from `compd effect list`, or /absolute/file.py:NAME.")
    ],
    machine: Annotated[
        Path | None, typer.Option("--machine", help="Machine configuration (YAML); the shipped tripod if left out.")
    ] = None,
    html: Annotated[Path | None, typer.Option("--html", help="Draw the effect's signature into this page.")] = None,
) -> None:
    """Show one effect: its physics, its parameters, and with --html what it does to the tip of a machine."""
    from rich.console import Console

    from compd.configuration import load
    from compd.configuration.shipped import shipped_configuration
    from compd.model.library import find_effect

    one = find_effect(name, "compd effect show")
    configuration = load(machine or shipped_configuration("tripod-cmm.yaml"))
    Console().print(_card(one, configuration))
    if html is not None:
        from compd.report.effect_page import write_effect_page

        write_effect_page(html, one, configuration)
        typer.echo(f"{one.id} on {configuration.machine}: {html}")


def _card(one: Effect, configuration: Configuration) -> RenderableType:
    """Everything that the effect declares, and whether the machine has what it needs."""
    from rich.console import Group
    from rich.table import Table

    from compd.machine_builder import build_model
    from compd.model.effect import PORTS
    from compd.model.effect_needs import unmet_needs
    from compd.model.observations import available_settings

    model = build_model(configuration.geometry, configuration.wiring)
    assert model.constants is not None
    measured = {wire.name for wire in configuration.wiring.quantities}
    lacking = unmet_needs(one, measured | available_settings(model.constants), model.links)

    card = Table.grid(padding=(0, 2))
    card.add_row("[bold]effect", one.id)
    card.add_row("physics", one.physics)
    for port in one.ports:
        card.add_row("port", f"{port}: {PORTS[port]}")
    card.add_row("equation", one.equation)
    for symbol, meaning in one.symbols.items():
        card.add_row("", f"{symbol}: {meaning}")
    card.add_row("source", one.source)
    card.add_row("needs", ", ".join(one.needs) or "nothing but the links' gauges")
    card.add_row("mistaken for", ", ".join(one.mistaken_for) or "-")
    card.add_row("separated by", one.separated_by)
    card.add_row(f"on {configuration.machine}", "\n".join(map(str, lacking)) or "has all that it needs")

    numbers = Table("parameter", "unit", "plausible", "one per", "where the range comes from")
    for parameter in one.parameters:
        numbers.add_row(
            parameter.name,
            parameter.unit,
            f"{parameter.low:g} to {parameter.high:g}",
            parameter.per.replace("_", " and "),
            parameter.source,
        )
    for constant in one.constants:
        how = f"from {constant.setting}, else searched" if constant.setting else "searched"
        numbers.add_row(constant.name, constant.unit, f"{constant.low:g} to {constant.high:g}", how, constant.source)
    return Group(card, numbers)
