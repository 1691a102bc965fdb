"""The command line: one file per command."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from compd.errors import Problem

# One thread of linear algebra: matrices are small, and more threads wait for each other, at up to ten times the cost
# beside other programs. numpy reads it at its import; a person's own setting takes precedence.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> None:
    """Entry point of `compd`: prints all of a person's mistakes, with exit code 2."""
    from compd.cli.loading import loading
    from compd.errors import CompdError

    try:
        with loading():
            from compd.cli.commands import make_app
            from compd.cli.old_names import renamed

            sys.argv[1:] = renamed(sys.argv[1:])
            app = make_app(*sys.argv[1:3])
        app()
    except CompdError as error:
        _refuse(error.problems)
    except ModuleNotFoundError as error:
        from compd.extras import missing_package

        problem = missing_package(" ".join(["compd", *sys.argv[1:2]]), error)
        if problem is None:
            raise
        _refuse((problem,))
    except OSError as error:
        from compd.files import refused_path

        if (problem := refused_path(error)) is None:
            raise
        _refuse((problem,))


def _refuse(problems: tuple[Problem, ...]) -> NoReturn:
    """Print the problems and end with exit code 2."""
    from compd.cli.problems import print_problems

    print_problems(problems)
    print(f"{len(problems)} problem{'s' * (len(problems) != 1)}", file=sys.stderr)
    sys.exit(2)
