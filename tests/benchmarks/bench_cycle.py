"""What a cycle costs, from the snapshot to the bytes on the socket: `python -m tests.benchmarks.bench_cycle`."""

from __future__ import annotations

import gc
import time
from dataclasses import replace

import numpy as np

from compd.gauge import good
from compd.live.loop import Target
from compd.live.machine import LiveModel, Models
from compd.live.system import QuietCollector
from compd.model import GaugeNoise
from compd.model.effects import FittedEffect, needed_quantities
from compd.model.library import load_library
from tests.benchmarks.figures import median_and_p99, show
from tests.benchmarks.limits import run_limited
from tests.support.live_machine import RAW_AT_ZERO_MM, Machine, machine

CYCLES = 5000
BUDGET_US = 150.0  # the whole cycle with 18 comparators
# All that the shipped machines' thermometers allow, of every port of a machine but one: cheap and dear, with memory.
EFFECTS = (
    "link_expansion_lag",
    "backlash",
    "tool_offset",
    "scale_gain",
    "scale_expansion",
    "joint_comparator_gain",
    "frame_comparator_gain",
    "link_sag",
    "friction_hysteresis",
    "base_joint_position",
)
ARRIVING_MM = 1e-4  # every gauge shows something new in every cycle
NOISE_MM, NOISE = 1e-4, 0.05  # of a length and of any other quantity, where the tip's uncertainty is computed
HEAD = ["", "median us", "p99 us", "p99 / median", f"median / {BUDGET_US:g} us budget"]


def main() -> None:
    rows = []
    for name in ("tripod-cmm.yaml", "hexapod.yaml"):
        for mode in ("cmm", "machine_tool"):
            measured = machine(name)
            measured.settle()
            if mode == "machine_tool":
                measured.commands.target = _target(measured)
            rows += [
                [f"{name.removesuffix('.yaml')}, {mode}: {part}", *_row(durations)]
                for part, durations in _cycles(measured).items()
            ]
    show(f"Cycle cost over {CYCLES} cycles", HEAD, rows)
    rows = [
        [f"{name.removesuffix('.yaml')}, {mode}, {count} effects", *_row(whole_cycles(name, mode, count))]
        for name in ("tripod-cmm.yaml", "hexapod.yaml")
        for mode in ("cmm", "machine_tool")
        for count in (0, 3, len(EFFECTS))
    ]
    rows += [
        [f"{name.removesuffix('.yaml')}, {mode}, the same with the uncertainty", *_row(uncertain_cycles(name, mode))]
        for name in ("tripod-cmm.yaml", "hexapod.yaml")
        for mode in ("cmm", "machine_tool")
    ]
    show("Snapshot to bytes, with effects; the tip's uncertainty is computed in one cycle a second", HEAD, rows)


def whole_cycles(name: str, mode: str, count: int) -> list[float]:
    """Durations (s) from snapshot to bytes, with so many effects."""
    measured = _machine(name, mode, count)
    measured.settle()
    return _cycles(measured)["snapshot to bytes"]


def uncertain_cycles(name: str, mode: str) -> list[float]:
    """Durations (s) from snapshot to bytes of those cycles that compute the tip's uncertainty, with all effects."""
    measured = _machine(name, mode, len(EFFECTS))
    wires = measured.wires
    lengths_mm = (np.full(count, NOISE_MM) for count in (measured.model.links, wires.joints, 9))
    noise = GaugeNoise(*lengths_mm, dict.fromkeys(wires.quantity_names, NOISE))
    measured.settings = replace(measured.settings, noise=noise)
    measured.settle()
    return _cycles(measured)["snapshot to bytes"][:: measured.settings.uncertainty_every]


def _machine(name: str, mode: str, effects: int) -> Machine:
    measured = machine(name)
    if mode == "machine_tool":
        measured.commands.target = _target(measured)
    measured.commands.models = _with_effects(measured, effects)
    return measured


def _target(measured: Machine) -> Target:
    tip_B0_mm = measured.model.zero.contact.tip_M_mm - measured.model.frame.zero_origin_M_mm
    return Target(tuple(tip_B0_mm.tolist()))


def _with_effects(measured: Machine, count: int) -> Models:
    """The first `count` effects, with numbers so small that no limit is reached."""
    effects = [load_library()[name] for name in EFFECTS[:count]]
    links = measured.model.links
    fitted = tuple(
        FittedEffect(effect, np.full(len(effect.columns(links)), 0.01), {c.name: c.grid[0] for c in effect.constants})
        for effect in effects
    )
    names = tuple(dict.fromkeys(name for effect in effects for name in needed_quantities(effect, links)))
    covariance = 1e-8 * np.eye(sum(len(each.theta) for each in fitted))
    applied = LiveModel(
        replace(measured.model, effects=fitted, covariance=covariance), names, measured.wires.quantity_wires(names)
    )
    return Models(applied)


def _row(durations_s: list[float]) -> list[str]:
    median, p99 = (value * 1e6 for value in median_and_p99(durations_s))
    return [f"{median:.1f}", f"{p99:.1f}", f"{p99 / median:.2f}", f"{median / BUDGET_US:.2f}"]


def _cycles(measured: Machine) -> dict[str, list[float]]:
    """Durations (s) of compute, JSON, packet, and of all three."""
    durations_s: dict[str, list[float]] = {
        "snapshot to setpoint": [],
        "JSON": [],
        "UDP packet": [],
        "snapshot to bytes": [],
    }
    config_hash = bytes(8)
    collector = QuietCollector()  # as in the loop
    collector.start(time.monotonic())
    for tick in range(CYCLES):
        measured.now_s += 0.005
        for channel, slot in measured.latest.index.items():
            value = RAW_AT_ZERO_MM + (tick % 7) * ARRIVING_MM if channel in measured.change_mm else 20.0
            measured.latest.put(slot, good(value, measured.now_s - 0.001))
        measured.tick = tick
        begin = time.perf_counter()
        setpoint = measured.run_cycle()
        computed = time.perf_counter()
        setpoint.to_json()
        encoded = time.perf_counter()
        setpoint.to_packet(config_hash)
        packed = time.perf_counter()
        assert setpoint.valid, setpoint.reason
        for durations, seconds in zip(
            durations_s.values(), (computed - begin, encoded - computed, packed - encoded, encoded - begin), strict=True
        ):
            durations.append(seconds)
        collector.collect_if_due(time.monotonic())
    gc.enable()
    gc.unfreeze()
    return durations_s


if __name__ == "__main__":
    run_limited(main, CYCLES=20)
