"""The paper's experiments (T. Oiwa, figures 18, 20, 21) and its equations (4), (5), on the simulated machine.

    python examples/paper/reproduce.py fig18|fig20|fig21|instantaneous [MACHINE.yaml] [--page PATH] [--seed N]

Nothing is tuned to the paper's numbers. Needs the extra `report`.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

import drift_experiment
import frame_page
import link_experiment
import plate_experiment
import reproduction
from compd.configuration import load, shipped_configuration
from compd.errors import CompdError
from frame_experiment import run_frame_experiment

FIGURES = {"fig18": link_experiment, "fig20": plate_experiment, "fig21": drift_experiment}


def main() -> None:
    """Run an experiment; print its table, and write the same with a picture as a page."""
    parser = ArgumentParser(description="The paper's experiments on the simulated machine.")
    parser.add_argument("experiment", choices=[*FIGURES, "instantaneous"])
    parser.add_argument("machine", nargs="?", type=Path, default=shipped_configuration("tripod-cmm.yaml"))
    parser.add_argument("--page", type=Path, help="file of the page with the picture; default: out/EXPERIMENT.html")
    parser.add_argument("--seed", type=int, default=1, help="of joints, weather and noise; default: 1")
    asked = parser.parse_args()
    page = asked.page or Path("out", f"{asked.experiment}.html")
    try:
        machine = load(asked.machine)
        if asked.experiment in FIGURES:
            found = FIGURES[asked.experiment].reproduce(machine, asked.seed)
            print_table(found.title, reproduction.HEAD, [reduction.row for reduction in found.reductions])
            found.write_page(page)
        else:
            result = run_frame_experiment(machine, asked.seed)
            print_table(frame_page.title(result), frame_page.HEAD, frame_page.table_rows(result), frame_page.CAPTION)
            for sentence in frame_page.sentences(result):
                Console().print(sentence, highlight=False)
            frame_page.write_frame_page(result, page)
    except CompdError as error:
        sys.exit(str(error))
    print(f"The same as a picture: {page}")


def print_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> None:
    """Print a table on the terminal."""
    table = Table(*head, title=title, title_justify="left", caption=caption or None, caption_justify="left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
