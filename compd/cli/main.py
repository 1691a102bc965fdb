"""`compd`: one command for each thing that a person wants to do.

Each package here is a panel of `compd --help`, and each module in it a command: module `check` has a function `check`,
or a `typer.Typer` of that name where the command has commands of its own. A new module is a new command; nothing else
has to be edited. Commands import what they need when they run, so that `compd --help` is quick.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

import typer

from compd.cli import live, measurements, simulated, start
from compd.release import __version__

# In the order in which `compd --help` shows them.
PANELS = {
    "Begin": start,
    "The live machine": live,
    "Learn from measurements": measurements,
    "A simulated machine": simulated,
}

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Live error compensation for parallel kinematic machines: joints, links and frame.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"compd {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    """Live error compensation for parallel kinematic machines: joints, links and frame."""


for title, package in PANELS.items():
    for module in pkgutil.iter_modules(package.__path__):
        command = getattr(import_module(f"{package.__name__}.{module.name}"), module.name)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=module.name, rich_help_panel=title)
        else:
            app.command(rich_help_panel=title)(command)
