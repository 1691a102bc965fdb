"""What a diagnosis may have found: one situation a function, each a diagnosis as it would be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from compd.diagnosis import Diagnosis
from compd.diagnosis.findings import ConstantFinding, GrossRows, UntestedEffect
from tests.support.diagnoses import (
    FRAME,
    Noise,
    description,
    diagnosis,
    external_recording,
    formula,
    step,
    tripod_recording,
)

BACKLASH = formula("stage_backlash", "b * moved_1", "Play of screw and coupling: half of it on either side.")
GAIN = formula("stage_gain", "b * position_mm", "Lead of the screw, or a gear ratio.")
ZEROS = formula("joint_zero", "b * position_mm", "The encoders' zeros are elsewhere.")
LENGTHS = formula("link_length", "b * moved_1", "The arms are longer than drawn.")
CONSTANT = ConstantFinding(
    {"x": 4.0, "y": -3.0, "z": 2.0},
    {"x": 0.1, "y": 0.1, "z": 0.1},
    ("tool_offset", "link_zero", "reference_registration"),
    "two attitudes of the tool",
)
VARY = "vary temperature_frame_degC alone, everything else as it is, at three places and back again"
CHANGE: dict[str, Any] = {
    "effect": "stage_backlash",
    "time_s": 6000.0,
    "formula_effects": (),
    "parameters": ({"b": 1.2},),
}
CONTRADICTION = "the repeats scatter 6 times as much as declared: check the instrument, or `sigma_um`"


def one_effect(sessions: int = 4) -> Diagnosis:
    steps = [step("link_expansion", [1.113], 0.021, 0.18)]
    return diagnosis("identified", 0.96, 0.18, Noise(0.16), tripod_recording(sessions), steps=steps)


def two_effects() -> Diagnosis:
    steps = [
        step("link_elasticity", [27.97], 0.29, 0.60),
        step("backlash", [0.884, 1.103, 0.795], 0.02, 0.157),
    ]
    return diagnosis("identified", 1.6, 0.157, Noise(0.155), steps=steps)


def rivals() -> Diagnosis:
    rows = [{"row": k, "tip_x_mm": 1.0} for k in range(12)]
    steps = [step("link_elasticity", [27.97], 0.29, 0.16, rivals={"joint_contact": 0.987})]
    return diagnosis("ambiguous", 0.68, 0.16, Noise(0.16, "declared"), steps=steps, next_measurement=rows)


def far_above_the_noise() -> Diagnosis:
    steps = [step(ZEROS, [4.2], 0.3, 73.0, links=0), step(LENGTHS, [9.1], 0.4, 55.0, links=0)]
    return diagnosis(
        "partial", 105.0, 55.0, Noise(20.0, "declared"), external_recording("xyz"), steps=steps, constant=CONSTANT
    )


def noise_not_known() -> Diagnosis:
    steps = [step(BACKLASH, [0.61], 0.02, 1.1, links=0), step(GAIN, [0.024], 0.0003, 0.112, links=0)]
    constant = ConstantFinding({"x": -3.2}, {"x": 0.1}, ("stage_offset",))
    noise = Noise(0.08, "estimate")
    return diagnosis("partial", 1.42, 0.112, noise, external_recording(), steps=steps, constant=constant)


def described() -> Diagnosis:
    return diagnosis(
        "unexplained",
        115.0,
        115.0,
        Noise(1.1),
        external_recording("z", quantities=FRAME),
        depends_on=[description(FRAME[0], "linear", 5.5, 0.998, beside=FRAME[1:])],
        next_measurement=[{"measure": VARY, "why": "the rest follows it"}],
    )


def proxy() -> Diagnosis:
    finding = description("temperature_frame_degC", "proxy", 0.2, 0.99, effect="link_expansion", formula_effects=())
    why = (
        "needs temperature_link_1_degC, which no gauge measures; needs temperature_link_2_degC, which no gauge measures"
    )
    untested = [UntestedEffect("link_expansion", why, True), UntestedEffect("gauge_latency", "needs moving rows")]
    return diagnosis("unexplained", 0.79, 0.79, Noise(0.16), depends_on=[finding], untested=untested)


def gross_rows() -> Diagnosis:
    rows = (*range(40, 48), 60, 61, 77)
    return diagnosis(
        "unexplained",
        66.5,
        66.5,
        Noise(1.3),
        external_recording("z", quantities=FRAME),
        depends_on=[description(FRAME[0], "linear", 12.0, 0.97)],
        gross=GrossRows(rows, ((40, 47),)),
        next_measurement=[{"measure": VARY, "why": "the rest follows it"}],
    )


def changed() -> Diagnosis:
    steps = [step(BACKLASH, [3.1], 0.1, 0.9, links=0)]
    finding = description("time_s", "change", 0.5, 0.9, **CHANGE)
    return diagnosis("partial", 2.6, 0.9, Noise(0.5), external_recording(), steps=steps, depends_on=[finding])


def nothing_missing() -> Diagnosis:
    untested = [UntestedEffect("gauge_latency", "needs moving rows")]
    return diagnosis("adequate", 0.165, 0.165, Noise(0.162), untested=untested)


def constant_alone() -> Diagnosis:
    return replace(nothing_missing(), constant=CONSTANT, untested=())


def implausible() -> Diagnosis:
    steps = [step("reference_air_index", [-1.25], 0.3, 3.0, plausible=False)]
    return diagnosis("partial", 9.0, 3.0, Noise(0.9, contradiction=CONTRADICTION), steps=steps)


def nothing_varied() -> Diagnosis:
    untested = [UntestedEffect("link_elasticity", "needs force_x_N, which no gauge measures")]
    return diagnosis("not_testable", 2.0, 2.0, Noise(0.3, "declared"), untested=untested)


SITUATIONS: tuple[Callable[[], Diagnosis], ...] = (
    one_effect,
    two_effects,
    rivals,
    far_above_the_noise,
    noise_not_known,
    described,
    proxy,
    gross_rows,
    changed,
    nothing_missing,
    constant_alone,
    implausible,
    nothing_varied,
)
