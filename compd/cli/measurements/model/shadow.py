"""`compd model shadow`: compute a second model in parallel to the running daemon's own."""

from __future__ import annotations

from compd.cli.measurements.model.adopt import FileArgument, NoneOption, ask_daemon
from compd.cli.options import DEFAULT_SOCKET, DaemonOption


def shadow(file: FileArgument = None, daemon: DaemonOption = DEFAULT_SOCKET, none: NoneOption = False) -> None:
    """Let the running daemon also compute the correction of a model file, and publish both; its own is applied."""
    ask_daemon(file, daemon, none, shadow=True)
