"""What release 0.1.0 computed and wrote stays so: setpoints to 1e-12 mm, comparisons, and what its verdicts say.

replay/: runs of both machines in both modes, recorded by 0.1.0: effects applied and as a shadow, gauges lost and
frozen, jumps, machine zero taken anew. verdicts/: `compare --json` and `diagnose --json` of the example recordings; of
comparisons the residuals and what each part contributes are those of 0.1.0; noise floor and p-values are the present
ones.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import pytest

from compd.live.record import RecordedCycles, differing_cells, replay_cycles
from tests.support.command import run_in_process
from tests.support.live_machine import machine
from tests.support.paths import SHARED
from tests.support.sampled import sampled

HERE = Path(__file__).parent
EXAMPLES = SHARED / "recordings"
RUNS = {
    "tripod-cmm-cmm-hold": ("tripod-cmm.yaml", "hold", "clamp"),
    "tripod-cmm-machine_tool-fade": ("tripod-cmm.yaml", "fade", "refuse"),
    "hexapod-cmm-fade": ("hexapod.yaml", "fade", "refuse"),
    "hexapod-machine_tool-hold": ("hexapod.yaml", "hold", "clamp"),
}
COMPARISONS = sorted(path.name for path in (HERE / "verdicts").glob("*.compare.json"))
VERDICTS = sorted(path.name for path in (HERE / "verdicts").glob("*.diagnose.json"))


def without_noise(configuration):
    """As it was then: the shipped files stated none."""
    gauges = {name: options.model_copy(update={"noise_um": None}) for name, options in configuration.gauges.items()}
    quantities = [quantity.model_copy(update={"noise": None}) for quantity in configuration.wiring.quantities]
    wiring = configuration.wiring.model_copy(update={"quantities": quantities})
    return replace(configuration, gauges=gauges, wiring=wiring)


@pytest.mark.parametrize("run", RUNS)
def test_setpoints_are_those_of_0_1_0_to_1e_12_mm(run):
    name, on_stale, on_limit = RUNS[run]
    configuration = without_noise(machine(name, on_stale=on_stale, on_limit=on_limit).configuration)
    cycles = list(replay_cycles(configuration, RecordedCycles(HERE / "replay" / run)))
    assert len(cycles) == 20
    # as by another kernel; a share of nothing may have lost the sign of its zero
    assert [cycle.where for cycle in cycles if cycle.differs] == []
    assert list(differing_cells(RecordedCycles(HERE / "replay" / run))) == []


@pytest.mark.parametrize("name", sampled(COMPARISONS, 3))
@pytest.mark.skipif(not EXAMPLES.is_dir(), reason=f"no example recordings in {EXAMPLES}")
def test_examples_are_compared_as_by_0_1_0(name):
    example, part, *_ = name.split(".")
    before, now = before_and_now(name, "compare", EXAMPLES / example / f"{part}.csv")
    assert differences(before, now) == []


@pytest.mark.parametrize("name", sampled(VERDICTS, 5))
@pytest.mark.skipif(not EXAMPLES.is_dir(), reason=f"no example recordings in {EXAMPLES}")
def test_examples_get_the_verdict_of_0_1_0(name):
    """The same word, the same effects, numbers within a standard error, and every key that a program may read."""
    before, now = before_and_now(name, "diagnose", EXAMPLES / name.split(".")[0] / "train.csv")
    assert now["verdict"] == before["verdict"]
    assert before.keys() <= now.keys()
    assert [step["effect"] for step in now["steps"]] == [step["effect"] for step in before["steps"]]
    for old, new in zip(before["steps"], now["steps"], strict=True):
        assert old.keys() <= new.keys()
        assert new["rivals"] == old["rivals"]
        for number, again in zip(old["parameters"], new["parameters"], strict=True):
            assert (again["name"], again["unit"], again["plausible"]) == (number["name"], number["unit"], True)
            assert abs(again["value"] - number["value"]) < number["std"]
    assert {result["effect"] for result in before["candidates"]} <= {result["effect"] for result in now["candidates"]}
    assert before["candidates"][0].keys() <= now["candidates"][0].keys()
    for old, new in zip(before["depends_on"][:1], now["depends_on"], strict=False):
        assert old.keys() <= new.keys()
        assert (new["covariate"], new["form"], new["port"]) == (old["covariate"], old["form"], old["port"])
    assert bool(now["depends_on"]) == bool(before["depends_on"])
    assert now["noise_floor_um"] == pytest.approx(before["noise_floor_um"], rel=0.02)
    assert now["final_rms_um"] == pytest.approx(before["final_rms_um"], rel=1e-3)


def before_and_now(name, command, recording):
    """What 0.1.0 said of a recording, and what is said now."""
    before = json.loads((HERE / "verdicts" / name).read_text(encoding="utf-8"))
    return before, json.loads(run_in_process(command, str(recording), "--json"))


def differences(before, now, where=""):
    """Where two JSON values differ; numbers may by a millionth, as another processor's sums do."""
    if isinstance(before, dict) and isinstance(now, dict):
        return [
            text
            for key in sorted(before.keys() | now.keys())
            for text in differences(before.get(key, "absent"), now.get(key, "absent"), f"{where}.{key}")
        ]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        return [
            text
            for index, (one, other) in enumerate(zip(before, now, strict=True))
            for text in differences(one, other, f"{where}[{index}]")
        ]
    if isinstance(before, float) and isinstance(now, float) and math.isclose(before, now, rel_tol=1e-6, abs_tol=1e-9):
        return []
    if isinstance(before, str) and isinstance(now, str) and os.sep in before:
        before, now = Path(before).name, Path(now).name
    return [] if before == now else [f"{where}: {before} became {now}"]
