"""`compd`: one command for each task.

Each package here is a panel of `compd --help`, and each module in it a command: module `check` has a function `check`,
or a `typer.Typer` of that name where the command has commands of its own. A package in a panel is a group: its
docstring is the group's help, and its modules are the group's commands. A new module is a new command; nothing else has
to be edited. Commands import what they need when they run, so that `compd --help` is quick.
"""

from __future__ import annotations

import os
import pkgutil
from collections.abc import Iterable, Sequence
from importlib import import_module
from types import ModuleType

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


def make_app(*words: str) -> typer.Typer:
    """The command line. Where `words` name a command, or one of a group, it has this one alone, and is made sooner."""
    app = typer.Typer(
        cls=PlainGroup, no_args_is_help=True, add_completion=_COMPLETION in os.environ, pretty_exceptions_enable=False
    )
    app.callback(cls=PlainGroup)(_options)
    titles = {package.__name__: title for title, package in PANELS.items()}
    for module in _modules(PANELS.values(), words[:1]):
        panel, _, name = module.__name__.rpartition(".")
        if hasattr(module, "__path__"):
            group = typer.Typer(no_args_is_help=True, help=module.__doc__)
            for inside in _modules([module], words[1:2]):
                group.registered_commands += _commands(inside).registered_commands
        else:
            group = _commands(module)
            if group is not getattr(module, name):
                group.registered_commands[0].rich_help_panel = titles[panel]
                app.registered_commands += group.registered_commands
                continue
        app.add_typer(group, name=name, cls=PlainGroup, rich_help_panel=titles[panel])
    return app


def _modules(packages: Iterable[ModuleType], wanted: Sequence[str]) -> list[ModuleType]:
    """The modules in these packages that have a wanted name; all of them where none has."""
    paths = [
        f"{package.__name__}.{each.name}" for package in packages for each in pkgutil.iter_modules(package.__path__)
    ]
    return [import_module(path) for path in [path for path in paths if path.rpartition(".")[2] in wanted] or paths]


def _commands(module: ModuleType) -> typer.Typer:
    """The commands of a module."""
    found = getattr(module, module.__name__.rpartition(".")[2])
    commands = found if isinstance(found, typer.Typer) else typer.Typer()
    if commands is not found:
        commands.command()(found)
    for command in commands.registered_commands:
        command.cls = PlainCommand
    return commands


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"compd {__version__}")
        raise typer.Exit


def _options(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    """Live error compensation for parallel kinematic machines: joints, links and frame."""
