"""What `compd compare` costs on a recording that is too long for the memory: `python -m tests.benchmarks.bench_stream`.

Beside it, in the same run, pandas reading the same Parquet file; of one that pandas could not hold, a part.
`--rows 20000000` is a day at 200 Hz.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.model_file import ModelFile
from tests.benchmarks.bench_compare import COMMAND, Cost, cost
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited
from tests.support.measured import SIGMA_UM, gauges, hidden, record, tripod

ROWS = 2_000_000
RATE_HZ = 200.0
REPEATED_ROWS = 50_000  # the same motion again and again, with noise of its own
FEW_ROWS = 300_000  # as long as to be read in blocks
PANDAS_ROWS = 5_000_000  # pandas takes 1 kB a row while it reads
BUDGET_US, BUDGET_MB = 20.0, 1024.0
EFFECTS = ("link_expansion", "link_elasticity", "backlash")
PANDAS = "import sys, pandas; pandas.read_parquet(sys.argv[1])"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--directory", type=Path, default=None, help="Where the file is made; a temporary directory.")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=arguments.directory) as temporary:
        measured = measure(arguments.rows, Path(temporary))
    rows = [
        line("compd compare, no effects", measured.bare, measured),
        line(f"compd compare, {len(EFFECTS)} effects", measured.with_effects, measured),
        line(f"pandas.read_parquet, {measured.by_pandas.rows} rows", measured.by_pandas, measured),
        line(f"compd compare, {FEW_ROWS} rows, no effects", measured.few, measured),
    ]
    title = f"{arguments.rows} rows, start of Python included; budget {BUDGET_US:g} us/row, {BUDGET_MB:g} MB"
    show(title, ["", "s", "processor us/row", "/ pandas", "MB", "/ pandas"], rows)


class RowsCost(NamedTuple):
    """What so many rows cost."""

    rows: int
    cost: Cost

    @property
    def row_us(self) -> float:
        """Processor time a row, us."""
        return self.cost.processor_s / self.rows * 1e6


class Measured(NamedTuple):
    """`compd compare` without and with effects, and of few rows; pandas reading the same file, or a part of it."""

    bare: RowsCost
    with_effects: RowsCost
    few: RowsCost
    by_pandas: RowsCost


def measure(rows: int, directory: Path) -> Measured:
    """On a recording of so many rows, which is made in `directory`."""
    path = long_recording(directory, rows)
    model = directory / "model.yaml"
    fitted_model(long_recording(directory, REPEATED_ROWS, "short"), model)
    few = compare(long_recording(directory, FEW_ROWS, "few"))
    part = path if rows <= PANDAS_ROWS else long_recording(directory, PANDAS_ROWS, "part")
    by_pandas = cost([sys.executable, "-c", PANDAS, str(part)])
    return Measured(
        RowsCost(rows, compare(path)),
        RowsCost(rows, compare(path, "--model", str(model))),
        RowsCost(FEW_ROWS, few),
        RowsCost(min(rows, PANDAS_ROWS), by_pandas),
    )


def line(name: str, spent: RowsCost, measured: Measured) -> list[str]:
    """A row of the table."""
    by_pandas = measured.by_pandas
    return [
        name,
        f"{spent.cost.seconds:.1f}",
        f"{spent.row_us:.2f}",
        f"{spent.row_us / by_pandas.row_us:.1f}",
        f"{spent.cost.largest_MB:.0f}",
        f"{spent.cost.largest_MB / by_pandas.cost.largest_MB:.2f}",
    ]


def compare(path: Path, *options: str) -> Cost:
    return cost([sys.executable, "-c", COMMAND, "compare", str(path), "--json", *options])


def long_recording(directory: Path, rows: int, name: str = "long") -> Path:
    """NAME.parquet with its sidecar: one motion, repeated at RATE_HZ, each time with other noise and other visits."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    count = min(rows, REPEATED_ROWS)
    source = record(directory, gauges(count, 1), [hidden("link_expansion", 1.1)], sigma_um=0.0, name="source")
    names = source.read_text(encoding="utf-8").partition("\n")[0].split(",")
    base = np.loadtxt(source, delimiter=",", skiprows=1)
    rng = np.random.default_rng(1)
    path = directory / f"{name}.parquet"
    sidecar = source.with_suffix(".yaml").read_text(encoding="utf-8").replace("sigma_um: 0.0", f"sigma_um: {SIGMA_UM}")
    path.with_suffix(".yaml").write_text(sidecar, encoding="utf-8")
    schema = pa.schema([(column, pa.float64()) for column in names])
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for begin in range(0, rows, count):
            block = dict(zip(names, base[: rows - begin].T.copy(), strict=True))
            block["time_s"] = (begin + np.arange(len(block["time_s"]))) / RATE_HZ
            block["session"] += 4 * (begin // count)
            block["visit"] += begin
            for axis in "xyz":
                block[f"reference_{axis}_mm"] += rng.normal(0, SIGMA_UM / 1e3, len(block["time_s"]))
            writer.write_table(pa.table(block, schema=schema))
    return path


def fitted_model(path: Path, model: Path) -> None:
    """Write a model with EFFECTS, fitted on a short recording."""
    import compd

    file: ModelFile | None = None
    for effect in EFFECTS:
        file = compd.add_effect(file, effect, compd.open_sample(path, tripod(), rows=3000))
    assert file is not None
    file.write(model)


if __name__ == "__main__":
    run_limited(main, ROWS=2_000, REPEATED_ROWS=1_000, FEW_ROWS=1_000, PANDAS_ROWS=1_000)
