"""What `compd watch` shows fits into 80 columns, with every name whole."""

from __future__ import annotations

import pytest
from rich.console import Console

from compd.cli.live.watch import bar, lost_gauges, view

LONG_NAME = "reference_registration_of_mine"
STATUS = {
    "loop": {
        "rate_hz": 200,
        "missed_cycles": 123,
        "period_mean_ms": 5.02371,
        "period_deviation_ms": 0.61291,
        "lateness_median_us": 57,
        "lateness_p99_us": 2091,
        "cycle_median_us": 272,
    },
    "gauges": [],
}


def setpoint(links=3, correction_mm=0.012, **sources_mm):
    return {
        "state": "ok",
        "reason": "",
        "valid": True,
        "mode": "cmm",
        "seq": 123456,
        "age_s": 0.031,
        "tip_M_mm": [-0.0, 1.0, -189.99986],
        "frame": {"displacement_M_mm": [-1e-6, 0.0, 0.01], "rotation_M_rad": [-1e-9, 0.0, 1e-6]},
        "link_length_mm": [481.04054] * links,
        "correction_mm": [correction_mm] * links,
        "sources_mm": {"joints": [-1e-7] * links, "frame": [0.01] * links, **sources_mm},
    }


def shown(*messages):
    console = Console(width=80, force_terminal=False, no_color=True)
    with console.capture() as capture:
        console.print(view({"machine": "tripod-cmm"}, *messages))
    return capture.get()


@pytest.mark.parametrize("links", [3, 6])
def test_effects_have_rows_of_their_own_with_whole_names(links):
    text = shown(setpoint(links, **{LONG_NAME: [-0.00012] * links, "link_sag": [0.5] * links}), STATUS)
    assert "…" not in text
    assert LONG_NAME in text
    (head,) = [line for line in text.splitlines() if line.startswith("link  ")]
    assert "correction, um" in head, "on one line"
    assert f"+500.00{' +500.00' * (links - 1)}" in " ".join(text.split())
    assert all(len(line) <= 80 for line in text.splitlines())


def test_without_effects_there_is_no_table_of_them():
    assert "effect" not in shown(setpoint(), STATUS)


def test_minus_nothing_is_nothing_and_noise_is_no_bar():
    text = shown(setpoint(correction_mm=3e-5), STATUS)
    assert "-0.00" not in text
    assert "█" not in text
    assert str(bar(-1.0, 1.0)) == "█" * 10 + "│" + " " * 10


def test_fifteen_lost_gauges_are_two_lines():
    lost = [{"channel": f"joints.{i}", "quality": "line_lost"} for i in range(1, 10)]
    lost += [{"channel": f"frame_u.u{i}", "quality": "line_lost"} for i in range(1, 7)]
    well = [{"channel": "scale_1.position", "quality": "ok"}]
    text = shown(setpoint(), STATUS | {"gauges": lost + well})
    assert "not good: joints: line_lost (all 9)\nnot good: frame_u: line_lost (all 6)\n" in text


def test_channels_of_one_gauge_that_differ_are_named():
    gauges = [{"channel": f"joints.{i}", "quality": quality} for i, quality in enumerate(["ok", "crc", "crc"], start=1)]
    gauges.append({"channel": "scale_1.position", "quality": "timeout"})
    assert lost_gauges(gauges) == ["joints.2, joints.3: crc", "scale_1.position: timeout"]


def test_a_gauge_that_is_to_be_looked_at_is_a_line():
    gauges = [{"channel": "scale_1.position", "quality": "ok", "warning": "scatters by 3.5 um at rest"}]
    assert "scale_1.position: warning: scatters by 3.5 um at rest" in shown(setpoint(), STATUS | {"gauges": gauges})
