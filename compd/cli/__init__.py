"""The command line."""


def main() -> None:
    """Entry point of `compd`."""
    from compd.cli.main import app

    app()
