"""`compd`: one command for each task.

Each package here is a panel of `compd --help`, and each module in it a command: module `check` has a function `check`,
or a `typer.Typer` of that name where the command has commands of its own. A new module is a new command; nothing else
has to be edited. Commands import what they need when they run, so that `compd --help` is quick.
"""

from __future__ import annotations

import os
import pkgutil
from importlib import import_module

import typer

from compd.cli import live, measurements, simulated, start
from compd.cli.plain_help import PlainCommand, PlainGroup
from compd.release import __version__

# Panels and commands in the order of `compd --help`.
PANELS = {
    "Begin": start,
    "The live machine": live,
    "Learn from measurements": measurements,
    "A simulated machine": simulated,
}
# Set by a shell that completes a command, and where its script is asked for: `_COMPD_COMPLETE=source_bash compd`.
_COMPLETION = "_COMPD_COMPLETE"


def make_app(wanted: str = "") -> typer.Typer:
    """The command line. Where `wanted` is the name of a command it has this one alone, and is made sooner."""
    app = typer.Typer(
        cls=PlainGroup, no_args_is_help=True, add_completion=_COMPLETION in os.environ, pretty_exceptions_enable=False
    )
    app.callback(cls=PlainGroup)(_options)
    modules = [
        (title, package.__name__, module.name)
        for title, package in PANELS.items()
        for module in pkgutil.iter_modules(package.__path__)
    ]
    alone = [module for module in modules if module[2] == wanted]
    for title, package, name in alone or modules:
        command = getattr(import_module(f"{package}.{name}"), name)
        if isinstance(command, typer.Typer):
            for inside in command.registered_commands:
                inside.cls = PlainCommand
            app.add_typer(command, name=name, cls=PlainGroup, rich_help_panel=title)
        else:
            app.command(cls=PlainCommand, rich_help_panel=title)(command)
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"compd {__version__}")
        raise typer.Exit


def _options(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    """Live error compensation for parallel kinematic machines: joints, links and frame."""
