"""One true cause is told as one cause, at whatever temperature machine zero was taken.

The recordings are campaigns of the simulated machine, which shares no code with the model.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.comparison import open_recording
from compd.configuration import load, shipped_configuration
from compd.diagnosis import diagnose
from compd.model.library import load_library
from compd.recording import write_recording
from compd.simulation import AirAtZero
from compd.simulation.campaign.simulated_recording import simulate_recording
from compd.simulation.causes.hidden_cause import HiddenCause

# As much as shows plainly above the noise; of more, what the thermometer of a link does not show would be seen, too.
PPM_PER_K = 1.5


@pytest.mark.parametrize(
    ("name", "degC"),
    [
        ("tripod-cmm.yaml", 23.0),
        pytest.param("tripod-cmm.yaml", 15.0, marks=pytest.mark.long),
        pytest.param("hexapod.yaml", 23.0, marks=pytest.mark.long),
        pytest.param("hexapod.yaml", 27.0, marks=pytest.mark.long),
    ],
)
def test_links_that_grow_are_one_cause(tmp_path: Path, name: str, degC: float) -> None:
    recorded = simulate_recording(
        load(shipped_configuration(name)),
        3,
        [HiddenCause("link_expansion", PPM_PER_K, 3.0)],
        air_at_zero=AirAtZero(degC, 985.0, 40.0),
    )
    write_recording(tmp_path / "campaign.csv", recorded.columns, recorded.sidecar)
    effects = list(load_library().values())
    found = diagnose(open_recording(tmp_path / "campaign.csv"), (), None, effects)
    assert found.verdict == "identified"
    (step,) = found.steps
    assert step.effect.id == "link_expansion"
    (number,) = step.parameters
    assert number.value == pytest.approx(PPM_PER_K, abs=5 * number.std + 0.05 * PPM_PER_K)
