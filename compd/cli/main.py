"""`compd`: one command for each thing that a person wants to do.

Commands import what they need when they run, so that `compd --help` is quick.
"""

from __future__ import annotations

import typer

from compd import __version__
from compd.cli import model_commands
from compd.cli.adopt import adopt, shadow
from compd.cli.campaign import campaign
from compd.cli.check import check
from compd.cli.compare import compare
from compd.cli.demo import demo
from compd.cli.diagnose import diagnose
from compd.cli.driver import app as driver
from compd.cli.effect import effect
from compd.cli.gauge import app as gauge
from compd.cli.join import join
from compd.cli.ledger import ledger
from compd.cli.paper import app as paper
from compd.cli.plan import plan
from compd.cli.record import record
from compd.cli.recording import recording
from compd.cli.recording_merge import merge
from compd.cli.replay import replay
from compd.cli.run import run
from compd.cli.simulate import simulate
from compd.cli.tracker import tracker
from compd.cli.watch import watch
from compd.cli.zero import zero

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


# `compd --help` shows the commands in these panels, in this order.
PANELS = {
    "Begin": (demo, check),
    "The live machine": (run, watch, zero, adopt, shadow, record, replay),
    "Learn from measurements": (join, compare, diagnose, plan, ledger),
    "A machine that is not there": (simulate, tracker, campaign),
}
for panel, commands in PANELS.items():
    for command in commands:
        app.command(rich_help_panel=panel)(command)
for change in (model_commands.add, model_commands.remove, model_commands.fit, model_commands.undo):
    effect.command()(change)
recording.command()(merge)
GROUPS = {
    "gauge": (gauge, "The live machine"),
    "driver": (driver, "The live machine"),
    "recording": (recording, "Learn from measurements"),
    "effect": (effect, "Learn from measurements"),
    "paper": (paper, "A machine that is not there"),
}
for name, (group, panel) in GROUPS.items():
    app.add_typer(group, name=name, rich_help_panel=panel)
