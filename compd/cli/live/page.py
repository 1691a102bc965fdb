"""`compd page`: the machine live in the browser."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated
from urllib.parse import quote, urlsplit

import typer

from compd.cli.options import DEFAULT_SOCKET, DaemonOption, daemon_address
from compd.cli.paths import PathKind

_TLS = "put a proxy with TLS in front (--behind): tokens pass in the clear otherwise"


def page(
    daemon: DaemonOption = DEFAULT_SOCKET,
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port of the page; 0: any free port.")] = 7760,
    listen: Annotated[
        str | None,
        typer.Option(metavar="HOST", help="Name or address of this computer, for browsers on others; needs --tokens."),
    ] = None,
    behind: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Address of a proxy with TLS in front, https://NAME; needs --tokens."),
    ] = None,
    tokens: Annotated[
        Path | None, typer.Option(help="A file with the tokens of people and screens; see --new-token.")
    ] = None,
    new_token: Annotated[
        str | None,
        typer.Option(
            metavar="ROLE:NAME",
            help="Add a token, role view or operate, to --tokens; print it, with --listen or --behind an address too.",
        ),
    ] = None,
    read_only: Annotated[bool, typer.Option("--read-only", help="Refuse orders from browsers.")] = False,
    workbench: Annotated[
        str | None, typer.Option(metavar="NAME", help="Print the address that opens this recording in the workbench.")
    ] = None,
    recordings: Annotated[Path, typer.Option(help="The directory of recordings."), PathKind.FOLDER] = Path(
        "recordings"
    ),
    models: Annotated[
        Path | None,
        typer.Option(
            help="The directory of model files to choose from; default: that of the configuration that --daemon names."
        ),
        PathKind.FOLDER,
    ] = None,
) -> None:
    """Show the machine live in the browser: state, errors, gauges, the last hour.

    It runs until Ctrl-C, beside the daemon, and prints the address to open. On a terminal an address for other devices
    is drawn as a QR code too.
    """
    from compd.log import hide_secrets_of_libraries, is_journal, log_to_stderr
    from compd.page import Token, add_token, hashed, origin, read_tokens, run_page
    from compd.page import new_token as make_token

    if new_token is not None:
        token = add_token(_needed(tokens, "--new-token"), new_token)
        typer.echo(token)
        if listen is not None or behind is not None:
            _print_address(f"{_origin(behind) or origin(str(listen), port)}/?token={token}")
        return
    own = make_token()
    alone = listen is None and behind is None
    if alone:
        if tokens is not None:
            raise typer.BadParameter(_without_listen(daemon, tokens))
        known = [Token("this computer", "view" if read_only else "operate", hashed(own))]
    else:
        known = [
            Token(token.name, "view", token.sha256) if read_only else token
            for token in read_tokens(_needed(tokens, "--behind" if listen is None else "--listen", f"; {_TLS}"))
        ]

    # a token of the command's own is for its user, on the terminal or behind a pipe, and not for a log
    shown = alone and not is_journal(sys.stdout)
    log_to_stderr()
    hide_secrets_of_libraries()

    def started(reached: str) -> None:
        token = own if shown else "YOUR-TOKEN"
        view = "?" if workbench is None else f"workbench?recording={quote(workbench)}&"
        typer.echo(f"open {reached}/{view}token={token}")
        if not alone:
            _print_qr_code(f"{reached}/")
        elif not shown:
            typer.echo("its token would be in the journal, for others to read: give --tokens and --listen", err=True)
        if listen is not None and behind is None:
            typer.echo(_TLS, err=True)

    unix_socket = daemon_address(daemon)
    if "/" not in unix_socket:
        raise typer.BadParameter(f"{daemon}: the page runs on the daemon's computer, at its Unix socket")
    machine = Path(daemon) if daemon.endswith((".yaml", ".yml")) else None
    if models is None and machine is not None:
        models = machine.parent
    offered = None if models is None else models.absolute()
    host = listen or "127.0.0.1"
    run_page(unix_socket, recordings.absolute(), host, port, known, started, offered, _origin(behind), machine)


def _without_listen(daemon: str, tokens: Path) -> str:
    words = ["compd", "page", *([] if daemon == DEFAULT_SOCKET else ["--daemon", daemon])]
    line = shlex.join([*words, "--listen", "127.0.0.1", "--tokens", str(tokens)])
    return (
        f"--tokens {tokens} has no effect without --listen or --behind; type: {line} "
        "(with this computer's address for browsers on others); without --tokens this computer's own token opens it"
    )


def _print_address(address: str) -> None:
    typer.echo(f"open {address}")
    _print_qr_code(address)


def _print_qr_code(address: str) -> None:
    """Print the QR code on a terminal, for a tablet beside it; never into a file or a log."""
    from compd.page import print_qr_code

    if sys.stdout.isatty():
        print_qr_code(address, sys.stdout)


def _origin(behind: str | None) -> str | None:
    """Raises typer.BadParameter unless it is the origin of a server with TLS."""
    if behind is None:
        return None
    parts = urlsplit(behind)
    if parts.scheme != "https" or not parts.netloc or parts.path not in ("", "/"):
        raise typer.BadParameter(f"--behind is {behind!r}; allowed: https://NAME or https://NAME:PORT")
    return f"https://{parts.netloc.lower()}"


def _needed(tokens: Path | None, option: str, more: str = "") -> Path:
    if tokens is None:
        raise typer.BadParameter(f"{option} needs --tokens FILE{more}")
    return tokens
