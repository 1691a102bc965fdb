"""LinuxCNC corrected on a simulated hexapod; a hidden effect is probed, diagnosed and adopted. About ten minutes.

    python examples/linuxcnc/run.py [--program FILE.ngc] [--effect ID=STRENGTH] [--seed N]

Writes out/linuxcnc/: the recording, the model file, and a page with the errors along the program. Needs Debian's
linuxcnc-uspace and the extra `report`.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from pathlib import Path

from rich.console import Console

from compd.configuration import load, shipped_configuration
from compd.errors import CompdError
from compd.report import check_page_path
from controller import obstacle
from demonstration import SHIPPED_PROGRAM, SPEEDUP, run_demonstration
from result_page import summarise, verdict, write_result_page

PAGE = Path("out", "linuxcnc", "program.html")


def main() -> None:
    """Run the demonstration; print its table, and write the same with a picture as a page."""
    parser = ArgumentParser(description="LinuxCNC corrected on a simulated hexapod.")
    parser.add_argument("--program", type=Path, default=SHIPPED_PROGRAM, help="the G-code to run; default: program.ngc")
    parser.add_argument("--effect", metavar="ID=STRENGTH", default="link_expansion=8", help="hidden in the machine")
    parser.add_argument("--seed", type=int, default=1, help="of weather and joints; default: 1")
    asked = parser.parse_args()
    if reason := obstacle():
        sys.exit(f"LinuxCNC cannot be started: {reason}")
    console = Console(highlight=False)
    console.print(
        f"LinuxCNC, headless, on a simulated hexapod with gauges on real ptys; weather {SPEEDUP:g} times faster than "
        f"real. {asked.effect.partition('=')[0]} is hidden in the machine. About ten minutes."
    )
    try:
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        check_page_path(PAGE)
        hexapod = load(shipped_configuration("hexapod.yaml"))
        demo = run_demonstration(hexapod, PAGE.parent, asked.seed, [asked.effect], console.print, asked.program)
        console.print(summarise(demo))
        console.print(verdict(demo))
        write_result_page(PAGE, demo)
    except CompdError as error:
        sys.exit(str(error))
    console.print(f"The same as a picture: {PAGE}")


if __name__ == "__main__":
    main()
