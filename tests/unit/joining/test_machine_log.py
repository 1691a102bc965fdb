"""The machine's own log: a workbook, or text as a controller writes it, joined with an instrument's points."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from typer.testing import CliRunner, Result

from compd.cli.app import app
from compd.comparison import open_recording
from compd.configuration import load
from compd.errors import RecordingError
from compd.joining import write_log_recording
from compd.recording import read_recording
from tests.support.built_machines import built, drawing, poses, targets

LEGS = range(1, 7)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """A directory with the machine, its log in metres in two shapes, and the instrument's points; the readings, mm."""
    directory = tmp_path_factory.mktemp("log")
    machine = drawing("6-ups", directory)
    rng = np.random.default_rng(6)
    world = built(machine, rng)
    rows = list(poses(world, islice(targets(world, rng), 14)))
    readings_mm, tips_mm = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Nr", "comment", *(f"Leg {i} [m]" for i in LEGS)])
    lines = ["Nr;comment;" + ";".join(f"Leg {i} [m]" for i in LEGS)]
    for number, reading_mm in enumerate(readings_mm, start=1):
        values = [round(value / 1e3, 9) for value in reading_mm.tolist()]
        sheet.append([number, "at rest", *values])
        lines.append(f"{number};at rest;" + ";".join(f"{value:.9f}".replace(".", ",") for value in values))
    book.save(directory / "log.xlsx")
    (directory / "log.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    points = ["name,x [mm],y [mm],z [mm]"]
    points += [f"p{k},{x:.6f},{y:.6f},{z:.6f}" for k, (x, y, z) in enumerate(tips_mm.tolist(), start=1)]
    (directory / "points.csv").write_text("\n".join(points) + "\n", encoding="utf-8")
    return directory, readings_mm


def join(directory: Path, log: str, out: str, *options: str) -> Result:
    arguments = ["join", directory / log, directory / "points.csv", directory / out, "--by", "order"]
    arguments += ["--machine", directory / "6-ups.yaml", "--frame", "machine", *options]
    return CliRunner().invoke(app, list(map(str, arguments)))


@pytest.mark.parametrize("log", ["log.xlsx", "log.txt"])
def test_a_log_is_joined_as_a_recording_is(measured: tuple[Path, np.ndarray], log: str) -> None:
    directory, readings_mm = measured
    out = f"joined-{log}.csv"
    named = [part for i in LEGS for part in ("--log", f"Leg {i} [m]=scale_{i}_mm")]
    done = join(directory, log, out, *named)
    assert done.exit_code == 0, (done.output, done.exception)
    joined = read_recording(directory / out)
    scales = np.stack([joined.columns[f"scale_{i}_mm"] for i in LEGS], axis=1)
    assert scales == pytest.approx(readings_mm, abs=1e-5)
    assert np.isfinite(joined.columns["reference_x_mm"]).all()


def test_the_machine_is_asked_for_once(measured: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    """A file beside the recording is named without the place of both, so that a copy elsewhere finds its own."""
    directory, _ = measured
    named = [part for i in LEGS for part in ("--log", f"Leg {i} [m]=scale_{i}_mm")]
    assert join(directory, "log.txt", "once.csv", *named).exit_code == 0
    sidecars = [(directory / name).read_text(encoding="utf-8") for name in ("once.yaml", "once-machine.yaml")]
    assert all("machine_file: 6-ups.yaml" in text and str(directory) not in text for text in sidecars)
    # joined again, the recording of the log says whose it is
    points, again = directory / "points.csv", tmp_path / "again.csv"
    arguments = map(str, ["join", directory / "once-machine.csv", points, again, "--by", "order"])
    assert CliRunner().invoke(app, list(arguments)).exit_code == 0
    assert f"machine_file: {directory.resolve() / '6-ups.yaml'}" in again.with_suffix(".yaml").read_text()
    assert open_recording(again).measured_mm.shape == (14, 3)


def test_what_a_log_does_not_say_is_asked(measured: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    directory, _ = measured
    done = join(directory, "log.txt", "nothing.csv")
    assert isinstance(done.exception, RecordingError)
    assert "no column is one of a recording" in str(done.exception)
    assert "Leg 1 [m]" in str(done.exception)
    bare, mine = tmp_path / "bare.csv", load(directory / "6-ups.yaml")
    bare.write_text("a,b\n1.5,2.5\n2.5,3.5\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r'column a: has no unit(.|\n)*--log "a=scale_1_mm:UNIT"'):
        write_log_recording(bare, tmp_path / "out.csv", mine, ["a=scale_1_mm"])
    with pytest.raises(RecordingError, match=r"names no column of the log(.|\n)*allowed: a, b"):
        write_log_recording(bare, tmp_path / "out.csv", mine, ["c=scale_1_mm:mm"])
    with pytest.raises(RecordingError, match="is in s, which is no unit of scale_1_mm"):
        write_log_recording(bare, tmp_path / "out.csv", mine, ["a=scale_1_mm:s"])
    write_log_recording(bare, tmp_path / "out.csv", mine, ["a=commanded_rx_rad:deg", "b=commanded_x_mm:inch"])
    text = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert text[0] == "point,commanded_rx_rad,commanded_x_mm"
    assert [float(cell) for cell in text[1].split(",")] == pytest.approx([1, np.deg2rad(1.5), 63.5])
