"""The command line: one file per command."""

import sys


def main() -> None:
    """Entry point of `compd`: a person's mistakes are printed, all of them, with exit code 2."""
    from compd.cli.main import app
    from compd.errors import CompdError

    try:
        app()
    except CompdError as error:
        count = len(error.problems)
        print(*error.problems, f"{count} problem{'s' * (count != 1)}", sep="\n", file=sys.stderr)
        sys.exit(2)
