"""The whole command line, with every command."""

from compd.cli.commands import make_app

app = make_app()
