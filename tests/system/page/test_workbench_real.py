"""Real machines in the workbench, by mouse alone: what an honest analysis finds is added and the error falls."""

from __future__ import annotations

import shutil

import pytest

from compd.api import add_effect
from compd.configuration import shipped_effects
from compd.model_file import read_stored
from tests.support.live_page import until
from tests.support.paths import SHARED
from tests.support.workbench_page import page_without_machine

REAL = SHARED / "real"

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not REAL.is_dir(), reason=f"{REAL} is not there: recordings of real machines"),
]

# Recording, the library of its kind of machine, effects that must be found, and what must be reached (answers.yaml).
PLATE = ("plug-plate-1597A-2011", "plate", {"plate_rotation", "plate_scale", "plate_quadrupole"}, 6.0)
STAGE = ("slit-stage-11358-1", "slit-stage-effects.yaml", {"stage_backlash", "stage_gain"}, 0.2)


@pytest.mark.parametrize(("recording", "library", "wanted", "reached"), [PLATE, STAGE])
def test_effects_of_a_real_machine_are_found_and_added_by_mouse(
    chromium, tmp_path, recording, library, wanted, reached
):
    (tmp_path / "recordings").mkdir()
    for suffix in (".csv", ".yaml"):
        shutil.copy(REAL / f"{recording}{suffix}", tmp_path / "recordings")
    if library not in shipped_effects():
        shutil.copy(REAL / library, tmp_path)
    with page_without_machine(tmp_path) as (address, _):
        tab = chromium.new_context(viewport={"width": 1366, "height": 768}).new_page()
        tab.goto(address)
        tab.locator("nav a", has_text="Workbench").click()
        until(tab, "document.getElementById('recording').options.length === 1")
        tab.locator("#open").click()
        until(tab, "window.bench?.summary")
        tab.locator("#libraries summary").click()
        tab.locator(f"#libraries input[value='{library}']").click()
        until(tab, "document.querySelectorAll('.effect').length > 1")
        tab.locator("#diagnose").click()
        until(tab, "document.querySelectorAll('.effect .remark').length > 0", 120.0)
        remarks = tab.locator(".effect:has(.remark)").evaluate_all(
            "effects => effects.map((effect) => [effect.dataset.effect, effect.querySelector('.remark').textContent])"
        )
        assert wanted <= {effect for effect, _ in remarks}, "named, or as good as one that is"
        named = [effect for effect, remark in remarks if remark.startswith("named")]
        for count, effect in enumerate(named, start=1):
            tab.locator(f".effect[data-effect={effect}]").click()
            until(tab, "bench.trial")
            tab.locator("#add").click()
            tab.locator("#confirm").click()
            until(tab, f"bench.summary?.ledger.length === {count} && document.querySelectorAll('.effect').length > 1")
        assert tab.evaluate("bench.summary.rms") < reached
        command = tab.evaluate("bench.summary.commands.diagnose")
        assert f"--effects {library}" in command or f"/{library}" in command
    by_command = None
    source = str(tmp_path / library) if library not in shipped_effects() else library
    path = tmp_path / "recordings" / f"{recording}.csv"
    for effect in named:
        by_command = add_effect(by_command, f"{source}:{effect}", path)
    by_mouse = read_stored(tmp_path / f"{recording}.model.yaml")
    assert by_mouse.state == by_command.state()
    assert [(s.kind, s.effect, s.rms_before_um, s.rms_after_um) for s in by_mouse.steps] == [
        (s.kind, s.effect, s.rms_before_um, s.rms_after_um) for s in by_command.steps
    ]
