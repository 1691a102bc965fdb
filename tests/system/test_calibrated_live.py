"""A machine that is not as drawn runs: the daemon's tip is wrong by its drawing, right by what `compd calibrate` wrote.

A 6-UPS with six scales and no comparators, measured with a tracker at rest. The daemon runs on the same wires first
with the drawing, then with the machine as built, and its tip is compared with the simulated truth.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml

from compd.configuration import load
from compd.demo.processes import Command, run_commands
from compd.documents import read_document
from compd.machine_kinds import KINDS, machine_text
from compd.simulation import ControlClient, Mechanism
from compd.simulation.truth.workspace import draw_points_mm
from tests.support.hidden_run import HiddenRun, write_unhurried
from tests.support.hidden_visits import Visit
from tests.support.simulated import run_directory

# So many that `compd recording join` finds the clocks' offset.
POSES, CHECKS = 32, 5
# Standard deviation of each coordinate of a joint, as built.
OFF_MM = 0.05
# A share of the error as drawn. The tracker's noise is a hundredth of it.
MOST_LEFT = 0.2


def written(directory: Path) -> tuple[Path, Path]:
    """The drawing, and the machine with all joints elsewhere."""
    drawing, workshop = directory / "drawing.yaml", directory / "workshop.yaml"
    drawing.write_text(machine_text("mine", "6-ups", KINDS["6-ups"].usual), encoding="utf-8")
    data, rng = read_document(drawing).data, np.random.default_rng(6)
    write_unhurried(drawing, data)
    for rod in data["geometry"]["rods"]:
        for joint in ("base_B_mm", "platform_P_mm"):
            rod[joint] = (np.array(rod[joint]) + rng.normal(0, OFF_MM, 3)).tolist()
    workshop.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return drawing, workshop


def visits(drawing: Path) -> list[Visit]:
    """To poses that the machine reaches, without loads."""
    points_mm = draw_points_mm(Mechanism(load(drawing).geometry), np.random.default_rng(2), POSES + CHECKS)
    return [Visit(point, [0.0] * 3, None) for point in points_mm.tolist()]


@contextmanager
def daemon(machine: Path, wires: Path, control: ControlClient) -> Iterator[HiddenRun]:
    """The daemon with a machine's numbers on the simulated machine's wires; zero is taken where that machine has it.

    wires : the configuration that `compd sim run` wrote.
    """
    data, numbers = read_document(wires).data, read_document(machine).data
    state = wires.with_name(f"state-{machine.stem}")
    state.mkdir()
    data |= {"geometry": numbers["geometry"], "state": numbers["state"] | {"directory": str(state)}}
    path = wires.with_name(f"live-{machine.name}")
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    command = Command(["run", str(path)], ready=wires.with_name("compd.sock"))
    with run_commands([command], log=state.with_suffix(".log")):
        run = HiddenRun(machine, wires.parent, control)
        run.drive(Visit([0.0] * 6, [0.0] * 3, None))
        run.zero()
        yield run


@pytest.mark.long
def test_the_daemon_with_the_machine_as_built_has_its_tip_where_it_is() -> None:
    with run_directory() as directory:
        drawing, workshop = written(directory)
        wires, as_built = directory / "machine" / workshop.name, directory / "as-built.yaml"
        simulate = ["sim", "run", str(workshop), "--directory", str(wires.parent), "--zero-hold", "600"]
        control = wires.with_name("control.sock")
        with run_commands([Command(simulate, ready=control)], log=directory / "simulate.log"):
            poses = visits(drawing)
            with ControlClient(control) as machine, daemon(drawing, wires, machine) as run:
                recording, _ = run.survey(poses[:POSES], "survey")
                before_um = run.tip_error_um(poses[POSES:])
                run.compd("calibrate", recording, "--machine", drawing, "--out", as_built)
            with ControlClient(control) as machine, daemon(as_built, wires, machine) as run:
                after_um = run.tip_error_um(poses[POSES:])
    # each link is wrong by more than that at the ends of its stroke, and none of the poses is at machine zero
    assert before_um > OFF_MM * 1e3 / 5
    assert after_um < MOST_LEFT * before_um
