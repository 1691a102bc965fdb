"""Models for a live machine: files of effects, thermometers that warm up, gauges with declared noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from compd.live.machine import Models
from compd.model.effects import FittedEffect
from compd.model.library import find_effect
from compd.model_file import ModelFile
from tests.support.live_machine import Machine

# The spindle's growth moves the tip along z, in um/K from 20 degC, on a machine whose kinematics compd does not know.
SPINDLE_GROWTH = {
    "id": "spindle_growth",
    "physics": "the spindle grows",
    "port": "reference",
    "axis": "z",
    "formula": "-k * (temperature_spindle_degC - 20)",
    "parameters": {"k": {"unit": "um/K", "plausible": [-10, 10], "source": "a guess"}},
}


def file_with(path: Path, *declared, name="tripod-cmm", links=3, fitted_range=None, **theta) -> Path:
    """A model file with these effects; numbers by id, else ones, which need not be plausible."""
    fitted, anything = [], {}
    for declaration in declared:
        effect = find_effect(declaration, "here")
        columns = effect.columns(links)
        numbers = np.broadcast_to(theta.get(effect.id, 1.0), (len(columns),)).astype(float)
        shape = {constant.name: constant.grid[0] for constant in effect.constants}
        fitted.append(FittedEffect(effect, numbers, shape))
        anything[effect.id] = dict.fromkeys(
            (*(column.name for column in columns), *shape), (-1000000000.0, 1000000000.0)
        )
    count = sum(len(effect.theta) for effect in fitted)
    covariance = np.eye(count) * 1e-2
    file = ModelFile(name, links, tuple(declared), tuple(fitted), covariance, plausible=anything)
    replace(file, fitted_range=fitted_range or {}).write(path)
    return path


def thermal(live: Machine, tmp_path: Path, effect="link_expansion") -> Models:
    return Models(live.loader.read(file_with(tmp_path / "thermal.yaml", effect, **{effect: 10.0})))


def warm(live: Machine, degC: float) -> None:
    """Every thermometer, which the machine's own gauges leave at 20 degC."""
    step = live.latest.put

    def put(slot, reading):
        thermometer = live.latest.channels[slot] not in live.change_mm
        step(slot, reading._replace(value=degC) if thermometer and reading.ok else reading)

    live.latest.put = put


def with_noise(live: Machine, um: float | None, tip_error_um: float | None = None) -> Machine:
    """The machine with gauges of this noise, and thermometers of none, within this limit of the tip's error."""
    loaded = live.configuration
    gauges = {name: options.model_copy(update={"noise_um": um}) for name, options in loaded.gauges.items()}
    quantities = tuple(quantity.model_copy(update={"noise": None}) for quantity in loaded.wiring.quantities)
    wiring = loaded.wiring.model_copy(update={"quantities": quantities})
    limits = loaded.limits.model_copy(update={"tip_error_um": tip_error_um})
    return Machine(replace(loaded, gauges=gauges, wiring=wiring, limits=limits))
