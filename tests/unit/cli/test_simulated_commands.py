"""`compd fault` and `compd tracker` beside a simulated machine, and without one."""

from __future__ import annotations

import pytest

from compd.cli.simulated.fault import fault
from compd.cli.simulated.tracker import tracker
from compd.clock import MonotonicClock
from compd.configuration import load
from compd.errors import CompdError, DaemonError
from compd.simulation.truth.world import World
from compd.simulation.wires.server import Simulation
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
