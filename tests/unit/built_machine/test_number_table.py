"""The table of a machine's numbers: what its columns say is enough to build the machine again."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from compd.built_machine import MachineNumber, numbers_text
from compd.configuration import load, shipped_configuration
from compd.machine_kinds import KINDS, machine_text
from compd.model.effects import FittedEffect
from compd.model.library import load_library


@pytest.mark.parametrize("kind", KINDS)
def test_lengths_follow_from_the_joints_and_actuators_in_the_table(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(machine_text("mine", kind, KINDS[kind].usual), encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(numbers_text(load(path)))))
    assert tuple(rows[0]) == MachineNumber._fields

    def number(part: str, i: int | str, name: str) -> float:
        return float(next(r["value"] for r in rows if (r["part"], r["number"], r["name"]) == (part, str(i), name)))

    def vector(part: str, i: int | str, name: str = "") -> np.ndarray:
        return np.array([number(part, i, f"{name}{axis}") for axis in "xyz"])

    links = sum(row["part"] == "rod" for row in rows)
    pairs = 2 if KINDS[kind].legs == "pairs" else 1
    for rod in range(1, links + 1):
        actuator = (rod + pairs - 1) // pairs
        base = vector("base joint", rod)
        if KINDS[kind].actuator == "slides":
            base = base + number("actuator", actuator, "zero") * vector("actuator", actuator, "along ")
        if KINDS[kind].actuator == "turns":
            radius = number("actuator", actuator, "radius")
            angle = number("actuator", actuator, "zero") / radius
            base = base + radius * np.cos(angle) * vector("actuator", actuator, "cosine ")
            base = base + radius * np.sin(angle) * vector("actuator", actuator, "sine ")
        # the machine of a kind stands level at machine zero
        platform = vector("machine zero", "") - vector("tool", "") + vector("platform joint", rod)
        assert np.linalg.norm(platform - base) == pytest.approx(number("rod", rod, "length"), abs=2e-5)


def test_gains_are_in_it_with_their_standard_errors() -> None:
    configuration = load(shipped_configuration("tripod-cmm.yaml"))
    gains = FittedEffect(load_library()["scale_gain"], np.array([5.0, -3.0, 1.0]), {}, np.diag([4.0, 1.0, 9.0]))
    rows = [row for row in csv.DictReader(io.StringIO(numbers_text(configuration, [gains]))) if row["unit"] == "ppm"]
    assert [(row["part"], row["name"], row["value"], row["standard_error"]) for row in rows] == [
        ("scale_gain", "k_1", "5.0", "2.0"),
        ("scale_gain", "k_2", "-3.0", "1.0"),
        ("scale_gain", "k_3", "1.0", "3.0"),
    ]
