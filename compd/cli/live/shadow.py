"""`compd shadow`: a model file beside the running daemon's own."""

from __future__ import annotations

from compd.cli.live.adopt import FileArgument, NoneOption, ask_daemon
from compd.cli.options import DEFAULT_SOCKET, DaemonOption


def shadow(file: FileArgument = None, daemon: DaemonOption = DEFAULT_SOCKET, none: NoneOption = False) -> None:
    """Let the running daemon compute a model file's correction beside its own, and publish both; its own is applied."""
    ask_daemon(file, daemon, none, shadow=True)
