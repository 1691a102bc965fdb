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
    typer.Option("--daemon", help="The daemon's Unix socket, or the configuration (YAML) that names it."),
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
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Overwrite a file of another kind.")]


def unix_address(address: str) -> str:
    """An address as it is; for a configuration file, the Unix socket that it names."""
    configuration = addressed_configuration(address)
    return address if configuration is None else configuration.sockets.unix.path


def addressed_configuration(address: str) -> Configuration | None:
    """The configuration that an address is the file of; None for a socket."""
    if not address.endswith((".yaml", ".yml")):
        return None
    from compd.configuration import load

    return load(Path(address))
