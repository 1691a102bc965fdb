"""`compd page`: the machine live in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import DEFAULT_SOCKET

_TLS = "put a proxy with TLS in front: tokens pass in the clear otherwise"


def page(
    address: Annotated[
        str, typer.Argument(metavar="[CONFIG]", help="The daemon's configuration (YAML), or its Unix socket.")
    ] = DEFAULT_SOCKET,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Where the page is; 0: any free port.")] = 7760,
    listen: Annotated[
        str | None,
        typer.Option(metavar="HOST", help="Name or address of this computer, for browsers on others; needs --tokens."),
    ] = None,
    tokens: Annotated[
        Path | None, typer.Option(help="A file with the tokens of people and screens; see --new-token.")
    ] = None,
    new_token: Annotated[
        str | None,
        typer.Option(metavar="ROLE:NAME", help="Add a token, role view or owner, to --tokens; print it; end."),
    ] = None,
    read_only: Annotated[bool, typer.Option("--read-only", help="No orders from any browser.")] = False,
    recordings: Annotated[Path, typer.Option(help="The directory of recordings.")] = Path("recordings"),
) -> None:
    """Show the machine live in the browser: state, errors, gauges, the last hour.

    It runs until Ctrl-C, beside the daemon, and prints the address to open.
    """
    from compd.cli.options import unix_address
    from compd.page.guard import Token, hashed
    from compd.page.guard import new_token as make_token
    from compd.page.run import run_page
    from compd.page.token_file import add_token, read_tokens

    if new_token is not None:
        typer.echo(add_token(_needed(tokens, "--new-token"), new_token))
        return
    own = make_token()
    if listen is None:
        known = [Token("this computer", "view" if read_only else "owner", hashed(own))]
    else:
        known = [
            Token(token.name, "view", token.sha256) if read_only else token
            for token in read_tokens(_needed(tokens, "--listen", f"; {_TLS}"))
        ]

    def started(where: str) -> None:
        typer.echo(f"open http://{where}/" + (f"?token={own}" if listen is None else "?token=YOUR-TOKEN"))
        if listen is not None:
            typer.echo(_TLS, err=True)

    run_page(unix_address(address), recordings.absolute(), listen or "127.0.0.1", port, known, started)


def _needed(tokens: Path | None, option: str, more: str = "") -> Path:
    if tokens is None:
        raise typer.BadParameter(f"{option} needs --tokens FILE{more}")
    return tokens
