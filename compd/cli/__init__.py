"""The command line: one file per command."""

import os
import sys

# One thread of linear algebra: matrices are small, and more threads wait for each other, at up to ten times the cost
# beside other programs. numpy reads it at its import; a person's own setting takes precedence.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> None:
    """Entry point of `compd`: prints all of a person's mistakes, with exit code 2."""
    from compd.cli.loading import loading

    with loading():
        from compd.cli.commands import make_app
        from compd.errors import CompdError

        app = make_app(*sys.argv[1:2])
    try:
        app()
    except CompdError as error:
        from compd.cli.problems import print_problems

        print_problems(error.problems)
        count = len(error.problems)
        print(f"{count} problem{'s' * (count != 1)}", file=sys.stderr)
        sys.exit(2)
