"""`compd service`: the daemon and its page under systemd."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address

if TYPE_CHECKING:
    from compd.installation import Replacement

service = typer.Typer(
    no_args_is_help=True, help="Install the daemon and its page as services of systemd, and replace their release."
)


@service.command()
def install(
    config: Annotated[Path, typer.Argument(help="The machine's configuration (YAML).")],
    page: Annotated[bool, typer.Option("--page/--no-page", help="Install the page in the browser as well.")] = True,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the commands, and change nothing.")] = False,
) -> None:
    """Install users, units, the udev rule and the configuration; start the daemon, and with it the page.

    The services start the environment whose compd this is. Each step is a command that is printed, with what it says;
    all of them may be done again, and a file of tokens is kept. Of a Debian package users, units and rule are there
    already. It needs root's rights.
    """
    from compd.errors import CompdError
    from compd.installation import install_problems, install_steps, own_program
    from compd.machine_check import load_whole

    configuration, program = load_whole(config), own_program()
    if problems := install_problems(configuration, program, page):
        raise CompdError(problems)
    if not dry_run:
        _require_root()
    for step in install_steps(configuration, program, page):
        typer.echo(f"# {step.purpose}\n{step}")
        if not dry_run and (said := step.run().rstrip()):
            typer.echo(said)
    if not dry_run:
        typer.echo("The daemon runs. At its zero position, take machine zero: compd zero")
        typer.echo("Who takes it without being root: usermod --append --groups compd NAME, then log in again")
    if page and not dry_run:
        typer.echo(
            f"A token for a browser: {program} page --tokens /etc/compd/page-tokens.yaml --new-token operate:NAME"
        )


@service.command()
def upgrade(daemon: DaemonOption = DEFAULT_SOCKET) -> None:
    """Replace the release that runs by the one whose compd this is; the other one comes back if it does not run well.

    Call it by the path of the new environment, as in `/opt/compd-0.3/bin/compd service upgrade`. The new release checks
    the configuration and compiles what it needs while the old one goes on.
    """
    from compd.installation import is_packaged, own_program
    from compd.installation import upgrade as upgrade_to

    _require_root()
    typer.echo("The new release checks the configuration, while the old one goes on ...")
    program = own_program()
    before = (
        "The version before: install its package" if is_packaged(program) else "compd service back: the release before"
    )
    _report(upgrade_to(daemon_address(daemon), program), before)


@service.command()
def back(daemon: DaemonOption = DEFAULT_SOCKET) -> None:
    """Go back to the release before the last upgrade; given again, to the one after."""
    from compd.installation import go_back

    _require_root()
    _report(go_back(daemon_address(daemon)), "compd service back: the release after")


def _report(came: Replacement, other: str) -> None:
    typer.echo(f"{came.before}, then {came.after}; {came.without_s:.2f} s without valid setpoints. {other}")


def _require_root() -> None:
    from compd.errors import CompdError

    if os.geteuid():
        raise CompdError.of(
            "compd service",
            "changes files of the system, which this user may not",
            value=f"user {os.geteuid()}",
            allowed="root",
            next_step="give the same command with sudo; --dry-run shows what install does",
        )
