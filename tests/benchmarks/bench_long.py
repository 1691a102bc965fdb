"""What a comparison of a recording costs that is too long for the memory: `python -m tests.benchmarks.bench_long`.

Beside it, in turn and in the same process, pyarrow reading the same file, once as Parquet and once as CSV. The largest
memory is that of `compd compare` as a process. `--rows 20000000` is a day at 200 Hz.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.csv
import pyarrow.parquet

import compd
from compd.model_file import ModelFile
from tests.benchmarks.bench_compare import COMMAND, cost
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited
from tests.support.measured import SIGMA_UM, gauges, hidden, record, tripod

ROWS = 2_000_000
RATE_HZ = 200.0
REPEATED_ROWS = 50_000  # the same motion again and again, with noise of its own
FITTED_ROWS = 3_000
ROUNDS = 3
BUDGET_RATIO, BUDGET_MB = 3.0, 1024.0
EFFECTS = ("link_expansion", "link_elasticity", "backlash")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=ROWS)
    parser.add_argument("--directory", type=Path, default=None, help="Where the file is made; a temporary directory.")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=arguments.directory) as temporary:
        measured = measure(arguments.rows, Path(temporary))
    rows = [
        [
            one.name,
            f"{one.by_arrow.seconds:.2f}",
            f"{one.compared.seconds:.2f}",
            f"{one.compared.seconds / one.by_arrow.seconds:.2f}",
            f"{one.by_arrow.processor_s:.2f}",
            f"{one.compared.processor_s:.2f}",
            f"{one.processor_ratio:.2f}",
            f"{one.largest_MB:.0f}",
        ]
        for one in measured
    ]
    title = f"{arguments.rows} rows, {len(EFFECTS)} effects; budget {BUDGET_RATIO:g} x pyarrow, {BUDGET_MB:g} MB"
    columns = ["", "pyarrow, s", "compared, s", "ratio", "processor: pyarrow, s", "compared, s", "ratio", "MB"]
    show(title, columns, rows)


class Spent(NamedTuple):
    """Wall time and processor time, which a busy machine does not stretch."""

    seconds: float
    processor_s: float


class Compared(NamedTuple):
    """Medians of a comparison, and of pyarrow reading the same file; memory of the command."""

    name: str
    compared: Spent
    by_arrow: Spent
    largest_MB: float

    @property
    def processor_ratio(self) -> float:
        return self.compared.processor_s / self.by_arrow.processor_s


def measure(rows: int, directory: Path) -> list[Compared]:
    """On a recording of so many rows, which is made in `directory`, as Parquet and as CSV."""
    model = directory / "model.yaml"
    fitted_model(long_recording(directory, REPEATED_ROWS, "short"), model)
    parquet = long_recording(directory, rows)
    text = directory / "text.csv"
    with pyarrow.csv.CSVWriter(text, pyarrow.parquet.read_schema(parquet)) as writer:
        for batch in pyarrow.parquet.ParquetFile(parquet).iter_batches():
            writer.write(batch)
    text.with_suffix(".yaml").write_bytes(parquet.with_suffix(".yaml").read_bytes())
    readers: tuple[tuple[Path, Callable[[Path], object]], ...] = (
        (parquet, pyarrow.parquet.read_table),
        (text, pyarrow.csv.read_csv),
    )
    return [side_by_side(path, read, model) for path, read in readers]


def side_by_side(path: Path, read: Callable[[Path], object], model: Path) -> Compared:
    def compare() -> object:
        return compd.compare(compd.open_sample(path), model)

    compare()  # kernels and modules are loaded
    pairs = [(spent(lambda: read(path)), spent(compare)) for _ in range(ROUNDS)]
    by_arrow, compared = (Spent(*np.median(list(one), axis=0)) for one in zip(*pairs, strict=True))
    largest = cost([sys.executable, "-c", COMMAND, "compare", str(path), "--json", "--model", str(model)])
    return Compared(path.suffix.removeprefix("."), compared, by_arrow, largest.largest_MB)


def spent(work: Callable[[], object]) -> Spent:
    begin_s, processor_s = time.perf_counter(), time.process_time()
    work()
    return Spent(time.perf_counter() - begin_s, time.process_time() - processor_s)


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
        file = compd.add_effect(file, effect, compd.open_sample(path, tripod(), rows=FITTED_ROWS))
    assert file is not None
    file.write(model)


if __name__ == "__main__":
    run_limited(main, ROWS=2_000, REPEATED_ROWS=1_000, FITTED_ROWS=500, ROUNDS=1)
