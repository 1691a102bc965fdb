"""The formula of an empirical term as a person writes it: short, with round numbers, ready for a file of effects."""

from __future__ import annotations

from compd.diagnosis.descriptions.term_grids import harmonic
from compd.units import unit_of

# form -> formula; {q} covariate about its middle, {r} the covariate itself, {lagged} the same behind a lag, {above} how
# far it is above the constant, {phase} of its period. k .. per unit, c constant.
FORMS = {
    "linear": "k * {q} + c",
    "proportional": "k * {r}",
    "strain": "(k * {q} + c) * link_mm / 1000",
    "square": "k * {q} + k2 * {q}**2 + c",
    "knee": "k * {q} + m * maximum({above}, 0) + c",
    "lagged": "k * {lagged} + c",
    "step": "k * maximum(sign({above}), 0) + c",
    "periodic": "a * sin({phase}) + b * cos({phase}) + c",
}
_CONSTANT_TERM = " + c"
# Names of the nonlinear constants, by form.
CONSTANTS = {"knee": "knee", "lagged": "tau", "step": "start", "periodic": "period"}
# Names of the fitted parameters.
PARAMETERS = ("k", "k2", "m", "a", "b", "c")


def formula_text(form: str, covariate: str, middle: float, value: float | None, *, with_constant: bool) -> str:
    """A formula of a covariate about its middle.

    value : of the nonlinear constant; None leaves its name.  with_constant : whether it ends in a constant c.

    Example: ("lagged", "temperature_bed_degC", 70.0, 2400.0) gives k * (lag(temperature_bed_degC, 2400) - 70) + c.
    """
    constant: float | str = CONSTANTS.get(form, "") if value is None else value
    text = FORMS[form].format(
        q=_about(covariate, middle),
        r=covariate,
        lagged=_about(f"lag({covariate}, {_text(constant)})", middle),
        above=_minus(covariate, constant),
        phase=_phase(covariate, constant),
    )
    return text if with_constant else text.removesuffix(_CONSTANT_TERM)


def _phase(covariate: str, period: float | str) -> str:
    """The argument of a sine with this period; of a harmonic of a turn in radians, the angle's multiple."""
    if unit_of(covariate) == "rad" and not isinstance(period, str) and (n := harmonic(period, "rad")):
        return f"{n} * {covariate}" if n > 1 else covariate
    return f"2 * pi * {covariate} / {_text(period)}"


def _about(name: str, middle: float) -> str:
    return f"({_minus(name, middle)})" if middle else name


def _minus(name: str, value: float | str) -> str:
    if isinstance(value, str):
        return f"{name} - {value}"
    return f"{name} {'+' if value < 0 else '-'} {_text(abs(value))}" if value else name


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.15g}"
