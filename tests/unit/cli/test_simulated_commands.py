"""`compd sim fault` and `compd sim tracker` beside a simulated machine, and without one."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import pytest

from compd.cli.simulated.sim.fault import fault
from compd.cli.simulated.sim.tracker import ExportFormat, tracker
from compd.clock import MonotonicClock
from compd.configuration import load
from compd.errors import CompdError, DaemonError
from compd.simulation import Simulation, World
from tests.support.simulated import TRIPOD, run_directory


@pytest.fixture(scope="module")
def simulation():
    configuration = load(TRIPOD)
    world = World(configuration.geometry, configuration.wiring, 1, zero_hold_s=1000.0)
    with run_directory() as directory:
        running = Simulation(configuration, world, directory, MonotonicClock())
        running.start()
        yield running
        running.stop()


def test_a_line_is_broken_and_mended(simulation, capsys):
    fault(simulation.directory, "frame_u", "silent")
    assert simulation.lines["frame_u"].fault == "silent"
    fault(simulation.directory, "frame_u", "none")
    assert simulation.lines["frame_u"].fault is None
    assert capsys.readouterr().out == "frame_u: silent\nframe_u: works again\n"


def test_the_directory_alone_lists_lines_and_what_they_can_have(simulation, capsys):
    fault(simulation.directory, "joints", "late")
    fault(simulation.directory)
    fault(simulation.directory, "joints", "none")
    out = capsys.readouterr().out
    assert "scale_1: works; can be silent, garble, late, cut, doubled, 'noise before', unplugged\n" in out
    assert "joints: late; can be " in out
    assert "'wrong unit'" in out


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        (("scale_9", "silent"), "scale_1, scale_2"),
        (("scale_1", "wrong unit"), "unplugged, none"),
        (("scale_1",), "late"),
    ],
)
def test_what_is_not_there_is_answered_with_what_is(simulation, arguments, allowed):
    with pytest.raises(CompdError) as caught:
        fault(simulation.directory, *arguments)
    assert allowed in caught.value.problems[0].allowed


def test_without_a_simulator_both_say_so(tmp_path):
    for command in (lambda: fault(tmp_path), lambda: tracker(tmp_path, tmp_path / "track.csv", None, 20.0)):
        with pytest.raises(DaemonError, match="no simulated machine answers") as caught:
            command()
        assert len(caught.value.problems) == 1


class Daemon:
    """A daemon that says nothing of the tip, thirty times."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def watch(self, _: float) -> Iterator[dict[str, Any]]:
        for _ in range(30):
            yield {"valid": False}


@pytest.fixture
def daemon(monkeypatch):
    monkeypatch.setattr("compd.client.connect", lambda *_: Daemon())


@pytest.mark.usefixtures("daemon")
@pytest.mark.parametrize(
    ("shape", "first"),
    [
        ("csv", b"time_s,x_mm,y_mm,z_mm\n0.000000,"),
        ("iso", b"time,x_mm,y_mm,z_mm\n20"),
        ("german", b"\xef\xbb\xbfZeit;x [mm];y [mm];z [mm]\r\n"),
        ("sa", b"// SpatialAnalyzer"),
        ("blanks", b"  "),
        ("xlsx", b"PK"),
    ],
)
def test_the_tracker_writes_each_shape(simulation, tmp_path: Path, capsys, shape: str, first: bytes) -> None:
    out = tmp_path / "export"
    tracker(simulation.directory, out, None, 5000.0, ExportFormat(shape))
    assert out.read_bytes().startswith(first)
    said = capsys.readouterr().out
    assert "30 looks" in said
    assert ("give `compd recording join`: --unit mm --rate-hz 5000" in said) == (shape == "blanks")


@pytest.mark.usefixtures("daemon")
def test_an_interferometer_along_a_link(simulation, tmp_path: Path, capsys) -> None:
    out = tmp_path / "link.rtx"
    tracker(simulation.directory, out, None, 5000.0, ExportFormat.carto, link=2, unit="um")
    data = out.read_bytes().partition(b"Data:\r\n")[2]
    (first_um,) = struct.unpack("<d", data[:8])
    # at machine zero no link has changed; five times the interferometer's 0.05 um
    assert abs(first_um) < 0.25
    said = capsys.readouterr().out
    assert "the interferometer along link 2 looks" in said
    assert "give `compd recording join`: --unit um --link 2" in said


@pytest.mark.usefixtures("daemon")
def test_points_at_rest_have_names_and_no_time(simulation, tmp_path: Path, capsys) -> None:
    out = tmp_path / "points.csv"
    tracker(simulation.directory, out, None, 20.0, points=True)
    header, point = out.read_text().splitlines()
    assert header == "name,x_mm,y_mm,z_mm"
    assert point.startswith("P1,")
    assert "30 looks in" in (said := capsys.readouterr().out)
    assert ", 1 points" in said


@pytest.mark.parametrize(
    ("shape", "options", "said"),
    [
        ("carto", {}, "name the link: --link 1"),
        ("carto", {"link": 1, "points": True}, "leave --points out"),
        ("sa", {"link": 1}, "leave --link out"),
        ("csv", {"unit": "furlong"}, "is no unit of a length"),
    ],
)
def test_what_a_shape_cannot_hold_is_said_before_anything_is_measured(tmp_path: Path, shape, options, said) -> None:
    with pytest.raises(CompdError) as caught:
        tracker(tmp_path, tmp_path / "export", None, 20.0, ExportFormat(shape), **options)
    assert said in str(caught.value)


@pytest.mark.usefixtures("daemon")
def test_a_link_that_the_machine_has_not(simulation, tmp_path: Path) -> None:
    with pytest.raises(CompdError, match="this machine has no such link"):
        tracker(simulation.directory, tmp_path / "export", None, 20.0, ExportFormat.carto, link=4)
