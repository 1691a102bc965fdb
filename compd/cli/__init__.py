"""The command line: one file per command."""

import os
import sys

# Matrices are small here: more threads of the linear algebra wait for each other, and beside other programs that costs
# ten times what the work takes. Read when numpy is first imported; a person's own setting holds.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> None:
    """Entry point of `compd`: a person's mistakes are printed, all of them, with exit code 2."""
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
