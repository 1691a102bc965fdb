"""Options that several commands share, and the daemon's address."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.cli.paths import PathKind

if TYPE_CHECKING:
    from compd.configuration import Configuration

DEFAULT_SOCKET = "/run/compd/compd.sock"

DaemonOption = Annotated[
    str,
    typer.Option("--daemon", help="The daemon: its Unix socket, its host:port, or its configuration (YAML)."),
    PathKind.NAME_OR_FILE,
]
MachineOption = Annotated[
    Path | None, typer.Option("--machine", help="The machine's configuration; a shipped one is found by its name.")
]
EffectsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--effects",
        metavar="FILE",
        help="Effects of your own beside the library's: FILE.yaml, FILE.py, a directory of them, or the name of a file "
        "that comes with compd. May be repeated.",
    ),
    PathKind.ANY,
]
RangesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--range",
        metavar="EFFECT.PARAMETER=LOW..HIGH",
        help="The plausible range of one parameter on this machine, such as link_zero.z=-3..3mm, in the place of the "
        "library's or of what geometry.tolerance_mm gives. May be repeated.",
    ),
]
HoldOption = Annotated[
    list[str] | None,
    typer.Option(
        "--hold",
        metavar="PART",
        help="What of an instrument's registration is not fitted along: frame, target, target.place, target.attitude, "
        "or a single number, frame.x to target.c. May be repeated.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, for programs.")]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Overwrite a file of another kind.")]


def daemon_address(daemon: str) -> str:
    """The daemon's host:port, or the path of its Unix socket with a slash in it, from what `--daemon` names it by."""
    if configuration := daemon_configuration(daemon):
        return configuration.sockets.unix.path
    return daemon if "/" in daemon or ":" in daemon else f"./{daemon}"


def daemon_configuration(daemon: str) -> Configuration | None:
    """The configuration that `--daemon` names; None for a socket."""
    if not daemon.endswith((".yaml", ".yml")):
        return None
    from compd.configuration import load

    return load(Path(daemon))
