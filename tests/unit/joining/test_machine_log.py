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
from compd.errors import RecordingError
from compd.instruments import ReadOptions
from compd.joining import LogOptions, read_machine_log
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
    arguments = ["recording", "join", directory / log, directory / "points.csv", directory / out, "--by", "order"]
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
    arguments = map(str, ["recording", "join", directory / "once-machine.csv", points, again, "--by", "order"])
    assert CliRunner().invoke(app, list(arguments)).exit_code == 0
    assert f"machine_file: {directory.resolve() / '6-ups.yaml'}" in again.with_suffix(".yaml").read_text()
    assert open_recording(again).measured_mm.shape == (14, 3)


def test_what_a_log_does_not_say_is_asked(measured: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    directory, _ = measured
    done = join(directory, "log.txt", "nothing.csv")
    assert isinstance(done.exception, RecordingError)
    assert "no column is one of a recording" in str(done.exception)
    assert "Leg 1 [m]" in str(done.exception)
    bare = tmp_path / "bare.csv"
    bare.write_text("a,b\n1.5,2.5\n2.5,3.5\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r'column a: has no unit(.|\n)*--log "a=scale_1_mm:UNIT"'):
        read_machine_log(bare, LogOptions(("a=scale_1_mm",)))
    with pytest.raises(RecordingError, match=r"names no column of the log(.|\n)*allowed: a, b"):
        read_machine_log(bare, LogOptions(("c=scale_1_mm:mm",)))
    with pytest.raises(RecordingError, match="is in s, which is no unit of scale_1_mm"):
        read_machine_log(bare, LogOptions(("a=scale_1_mm:s",)))


def times_s(directory: Path, cells: list[str], named: str, **read: str) -> np.ndarray:
    path = directory / "times.csv"
    rows = "".join(f"{cell};{k},5\n" for k, cell in enumerate(cells))
    path.write_text(f"When;X [mm]\n{rows}", encoding="utf-8")
    log = read_machine_log(path, LogOptions((named, "X [mm]=commanded_x_mm"), ReadOptions(**read)))
    assert log.columns["commanded_x_mm"] == pytest.approx(0.5 + np.arange(len(log.columns["time_s"])))
    return log.columns["time_s"]


def test_stamps_of_a_log_are_seconds(tmp_path: Path) -> None:
    noon_s = 12 * 3600.0
    stamps = ["2026-11-28T12:00:00.250", "2026-11-28T12:00:10.250", "2026-11-29T00:00:00.250"]
    assert times_s(tmp_path, stamps, "When=time_s") == pytest.approx([noon_s + 0.25, noon_s + 10.25, 86400.25])
    german = ["28.11.2026 12:00:03,5", "28.11.2026 12:00:07,5"]
    assert times_s(tmp_path, german, "When=time_s") == pytest.approx([noon_s + 3.5, noon_s + 7.5])
    days = ["46354,5", "46354,50011574074", "46354,6"]
    assert times_s(tmp_path, days, "When=time_s:day")[1:] - noon_s == pytest.approx(
        [46354 * 86400 + 10, 46354 * 86400 + 0.1 * 86400], abs=1e-3
    )
    # a row without a stamp is no row at another time
    assert times_s(tmp_path, ["1,5", "2,5", ""], "When=time_s:s") == pytest.approx([1.5, 2.5])


@pytest.mark.parametrize(
    ("cells", "named", "asked"),
    [
        (["03/04/2026 12:00:00.5", "05/06/2026 12:00:00.5"], "When=time_s", "--log-dates dmy"),
        (["100", "200"], "When=time_s", r'--log "When=time_s:s" or --log "When=time_s:ms"'),
        (["46354,50001", "46354,50002"], "When=time_s", r'--log "When=time_s:day"'),
        (["3,5", "3,1"], "When=time_s:s", "times.csv:3: time does not rise"),
        (["28.11.2026 25:00:00.5", "28.11.2026 12:00:00.5"], "When=time_s", "times.csv:2"),
        (["1,5", "2,5"], "When=time_s:mm", "no unit of time"),
    ],
)
def test_times_that_cannot_be_told_are_asked_about(tmp_path: Path, cells: list[str], named: str, asked: str) -> None:
    with pytest.raises(RecordingError, match=asked):
        times_s(tmp_path, cells, named)


ANGLES = ("A=commanded_rx_rad:deg", "B=commanded_ry_rad:deg", "C=commanded_rz_rad:deg")


def turned(directory: Path, order: str | None, named: tuple[str, ...] = ANGLES) -> np.ndarray:
    path = directory / "turned.csv"
    path.write_text("A,B,C\n10.5,-20.5,30.5\n", encoding="utf-8")
    columns = read_machine_log(path, LogOptions(named, ReadOptions(angles=order))).columns
    return np.array([columns[f"commanded_r{axis}_rad"][0] for axis in "xyz"])


def about(axis: str, angle_deg: float) -> np.ndarray:
    """The matrix of a turn about one axis, written out."""
    c, s = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = c
    matrix[first, second], matrix[second, first] = -s, s
    return matrix


def matrix_of(vector_rad: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    angle = float(np.linalg.norm(vector_rad))
    x, y, z = vector_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_angles_of_a_log_turn_in_the_order_that_is_said(tmp_path: Path) -> None:
    rx, ry, rz = about("x", 10.5), about("y", -20.5), about("z", 30.5)
    assert matrix_of(turned(tmp_path, "xyz")) == pytest.approx(rz @ ry @ rx)
    assert matrix_of(turned(tmp_path, "XYZ")) == pytest.approx(rx @ ry @ rz)
    assert matrix_of(turned(tmp_path, "ZYX")) == pytest.approx(rz @ ry @ rx)
    assert matrix_of(turned(tmp_path, "ZXZ")) == pytest.approx(about("z", 10.5) @ about("x", -20.5) @ rz)
    assert turned(tmp_path, "vector") == pytest.approx(np.deg2rad([10.5, -20.5, 30.5]))


def test_the_order_of_turning_is_never_guessed(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"in which order its angles turn is not said(.|\n)*--log-angles xyz"):
        turned(tmp_path, None)
    with pytest.raises(RecordingError, match=r"no order of turning(.|\n)*value: rpy"):
        turned(tmp_path, "rpy")
    with pytest.raises(RecordingError, match="three angles, commanded_rz_rad is missing"):
        turned(tmp_path, "xyz", ANGLES[:2])


def test_a_join_that_fails_leaves_no_file(measured: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    directory, _ = measured
    out = tmp_path / "out.csv"
    named = [part for i in LEGS for part in ("--log", f"Leg {i} [m]=scale_{i}_mm")]
    arguments = ["recording", "join", directory / "log.txt", directory / "points.csv", out, "--by", "time", *named]
    failed = CliRunner().invoke(app, list(map(str, [*arguments, "--machine", directory / "6-ups.yaml"])))
    assert failed.exit_code != 0
    assert list(tmp_path.iterdir()) == []


def test_ids_of_points_that_are_texts_stay_texts(measured: tuple[Path, np.ndarray], tmp_path: Path) -> None:
    """The log and the instrument name the points alike; the joined recording has the names, in either format."""
    directory, readings_mm = measured
    names = [f"P{k}, {'left' if k % 2 else 'right'}" for k in range(1, len(readings_mm) + 1)]
    rows = [f"{name};" + ";".join(map(repr, row)) for name, row in zip(names, readings_mm.tolist(), strict=True)]
    log = tmp_path / "log.txt"
    log.write_text("\n".join(["Where;" + ";".join(f"L{i} [mm]" for i in LEGS), *rows]) + "\n", encoding="utf-8")
    points = (directory / "points.csv").read_text(encoding="utf-8").splitlines()[1:]
    moved = [f"{name};" + ";".join(row.split(",")[1:]) for name, row in zip(names, points, strict=True)]
    export = tmp_path / "points.txt"
    # in another order than the log has
    export.write_text("\n".join(["name;x [mm];y [mm];z [mm]", *reversed(moved)]) + "\n", encoding="utf-8")
    named = [part for i in LEGS for part in ("--log", f"L{i} [mm]=scale_{i}_mm")]
    for out in (tmp_path / "joined.csv", tmp_path / "joined-too.parquet"):
        arguments = ["recording", "join", log, export, out, "--by", "name", *named, "--log", "Where=point"]
        arguments += ["--machine", directory / "6-ups.yaml"]
        done = CliRunner().invoke(app, list(map(str, arguments)))
        assert done.exit_code == 0, (done.output, done.exception)
        joined = read_recording(out)
        assert joined.point is not None
        assert [joined.point_name(number) for number in joined.point.tolist()] == names
    again = read_recording(tmp_path / "joined-machine.csv", needs_reference=False)
    assert set(again.labels["point"]) == set(names)


def test_an_option_of_the_log_is_refused_under_its_own_name(measured: tuple[Path, np.ndarray]) -> None:
    directory, _ = measured
    done = join(directory, "log.txt", "wrong.csv", "--log-decimal", "x")
    assert done.exit_code == 2
    assert "--log-decimal" in done.output
