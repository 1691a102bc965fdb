"""What an effect is: one physical cause, where in the machine it acts, and what it adds there.

An effect adds `basis(rows) @ theta` at its ports: linear in its fitted parameters theta. What is not linear (a time
constant, a period) is a shape constant, given or searched. The machine model propagates from the port to the tip;
an effect never computes a tip error itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.errors import Problem
from compd.model.observations import Observations

Port: TypeAlias = Literal[
    "scale", "joint", "frame", "link", "base_joint", "platform_joint", "revolute_axis", "plate", "tool", "reference"
]
PORTS: dict[Port, str] = {
    "scale": "reading of each linear scale, mm (n)",
    "joint": "reading of each joint comparator, mm (k)",
    "frame": "reading of each frame comparator t1..t3, u1..u6, mm (9)",
    "link": "length of each link, mm (n)",
    "base_joint": "centre of each base joint in {M}, mm (n x 3)",
    "platform_joint": "centre of each platform joint in {P}, mm (n x 3)",
    "revolute_axis": "direction of each revolute axis in {P}, rad (n x 3)",
    "plate": "plate points m1, m2, m3 in {M}, mm (3 x 3)",
    "tool": "tool vector in {P}, mm (3)",
    "reference": "what the reference instrument shows: x, y, z in mm, then rotation about x, y, z in rad (6)",
}

# How many values of a parameter there are, and how the n-th is called.
Per: TypeAlias = Literal["machine", "link", "axis", "link_axis"]

Shape: TypeAlias = Mapping[str, float]
# What an effect remembers from row to row; None at the start. Only the effect knows what is in it.
Memory: TypeAlias = tuple[FloatArray, ...] | None
Basis: TypeAlias = Callable[[Observations, Shape, Memory], tuple[FloatArray, Memory]]

_WORDS = {
    "force": ("force_x_N", "force_y_N", "force_z_N"),
    "direction": (),  # these four come from the scales and the clock: every machine has them
    "motion": (),
    "time": (),
    "order": (),
}
_SETTINGS = {
    "revolute_axes": "only a tripod (kinematics: tripod_3spr) has revolute axes",
    "plate_thickness_mm": "write `plate_thickness_mm` under `geometry:`",
    "scale_signal_period_mm": "write `scale_signal_period_mm` under `geometry:`",
}


@dataclass(frozen=True)
class Parameter:
    """One kind of fitted parameter, in the unit that people read.

    low, high : plausible range in `unit`.  source : where that range comes from.
    reciprocal : the fit is linear in 1/value: a compliance is fitted, a stiffness shown.
    """

    name: str
    unit: str
    low: float
    high: float
    source: str
    per: Per = "machine"
    reciprocal: bool = False

    def suffixes(self, links: int) -> list[str]:
        """One for each value that this parameter has on a machine of so many links."""
        return {
            "machine": [""],
            "link": [f"_{i + 1}" for i in range(links)],
            "axis": ["_x", "_y", "_z"],
            "link_axis": [f"_{i + 1}{axis}" for i in range(links) for axis in "xyz"],
        }[self.per]

    def shown(self, theta: float, std: float = float("nan")) -> tuple[float, float]:
        """Value and standard error in `unit`, from the fitted number and its own; to first order."""
        if not self.reciprocal:
            return theta, std
        if theta == 0.0:
            return float("inf"), float("nan")
        return 1.0 / theta, std / theta**2

    def fitted(self, value: float) -> float:
        """The number that enters the fit, from a value in `unit`."""
        return 1.0 / value if self.reciprocal else value

    @property
    def fitted_range(self) -> tuple[float, float]:
        """Plausible range of the number that is fitted."""
        ends = sorted((self.fitted(self.low), self.fitted(self.high)))
        return ends[0], ends[1]


@dataclass(frozen=True)
class Constant:
    """A shape constant: what the effect is not linear in.

    grid : the values that a search tries, in `unit`.
    setting : name of the machine's setting that gives the value, which is then not searched.
    """

    name: str
    unit: str
    low: float
    high: float
    source: str
    grid: tuple[float, ...]
    setting: str = ""

    @property
    def choice(self) -> bool:
        """Whether one of two values is true, and nothing between them."""
        return len(self.grid) <= 2


@dataclass(frozen=True)
class Column:
    """One fitted number of an effect on a machine: `backlash` has b_1, b_2, b_3 on a tripod."""

    name: str
    parameter: Parameter


@dataclass(frozen=True)
class Effect:
    """One physical cause.

    ports : where it acts; `basis` gives (N, size, P) with the ports' sizes one after the other, P fitted numbers.
    needs : quantities by name (`{link}` stands for each link), or "force", "direction", "motion", "time",
        "order" (of the rows), "revolute_axes", "plate_thickness_mm".
    remembers : a row's value depends on earlier rows; memory goes in and comes out.
    follows_reading : what it adds depends on its comparators' own readings.
    contradicts_declared_frame : it says that the reference does not show {M}, which the recording's sidecar declares.
    """

    id: str
    ports: tuple[Port, ...]
    physics: str
    equation: str
    symbols: Mapping[str, str]
    source: str
    needs: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    mistaken_for: tuple[str, ...]
    separated_by: str
    basis: Basis
    constants: tuple[Constant, ...] = ()
    remembers: bool = False
    follows_reading: bool = False
    contradicts_declared_frame: bool = False

    @property
    def port(self) -> str:
        """The ports as one text."""
        return ", ".join(self.ports)

    @property
    def live(self) -> bool:
        """Whether it belongs to the machine; what happens at the reference instrument does not."""
        return "reference" not in self.ports

    def columns(self, links: int) -> list[Column]:
        """The fitted numbers, in the order of theta: all values of the first parameter, then of the next."""
        return [
            Column(parameter.name + suffix, parameter)
            for parameter in self.parameters
            for suffix in parameter.suffixes(links)
        ]

    def shapes(self, rows: Observations) -> list[dict[str, float]]:
        """Every combination of shape constants to try on these rows; one, maybe empty, where nothing is searched."""
        found: list[dict[str, float]] = [{}]
        for constant in self.constants:
            given = rows.setting(constant.setting) if constant.setting else None
            values = constant.grid if given is None else (given,)
            found = [{**shape, constant.name: value} for shape in found for value in values]
        return found


@dataclass(frozen=True)
class FittedEffect:
    """An effect with its numbers: what a machine model carries.

    theta : (P,), in the order of `effect.columns`.  covariance : (P, P), nan where it is not known.
    """

    effect: Effect
    theta: FloatArray
    shape: Shape = field(default_factory=dict)
    covariance: FloatArray = field(default_factory=lambda: np.full((1, 1), np.nan))


Deltas: TypeAlias = dict[Port, FloatArray]
Memories: TypeAlias = Mapping[str, Memory]


def port_size(port: Port, rows: Observations) -> int:
    """How many numbers a port takes on this machine."""
    n = rows.links
    return {
        "scale": n,
        "joint": int(rows.joint_mm.shape[1]),
        "frame": 9,
        "link": n,
        "base_joint": 3 * n,
        "platform_joint": 3 * n,
        "revolute_axis": 3 * len(rows.revolute_axes_P),
        "plate": 9,
        "tool": 3,
        "reference": 6,
    }[port]


def by_port(effect: Effect, rows: Observations, values: NDArray[np.float64]) -> Deltas:
    """Split axis 1 of (N, sum of sizes, ...) into the effect's ports."""
    if len(effect.ports) == 1:
        return {effect.ports[0]: values}
    ends = np.cumsum([port_size(port, rows) for port in effect.ports])[:-1]
    return dict(zip(effect.ports, np.split(values, ends, axis=1), strict=True))


def delta(fitted: FittedEffect, rows: Observations, memory: Memory = None) -> tuple[Deltas, Memory]:
    """What one effect adds at its ports: (N, size) each, in mm (rad for directions); and its memory after."""
    basis, memory = fitted.effect.basis(rows, fitted.shape, memory)
    # summed column by column: a matrix product may add up differently for one row than for many
    total = np.zeros(basis.shape[:2])
    for column, value in enumerate(fitted.theta):
        total += basis[:, :, column] * value
    return by_port(fitted.effect, rows, total), memory


def deltas(
    fitted: Sequence[FittedEffect], rows: Observations, memories: Memories
) -> tuple[dict[str, Deltas], dict[str, Memory]]:
    """What each effect adds, by id, and all memories after. Start with no memories: {}."""
    found: dict[str, Deltas] = {}
    after: dict[str, Memory] = {}
    for one in fitted:
        found[one.effect.id], after[one.effect.id] = delta(one, rows, memories.get(one.effect.id))
    return found, after


def sum_deltas(each: Collection[Deltas]) -> Deltas:
    """The sum of several effects at each port, in their order."""
    total: Deltas = {}
    for one in each:
        for port, value in one.items():
            total[port] = total[port] + value if port in total else value
    return total


def quantities(effect: Effect, links: int) -> list[str]:
    """The measured quantities that the effect needs, by their full names."""
    found: list[str] = []
    for need in effect.needs:
        if "{link}" in need:
            found += [need.format(link=i + 1) for i in range(links)]
        elif need in _WORDS:
            found += _WORDS[need]
        elif need not in _SETTINGS:
            found.append(need)
    return found


def missing(effect: Effect, available: Collection[str], links: int) -> list[Problem]:
    """What the effect needs and does not get; empty where it can be used.

    available : names of the quantities that gauges or columns deliver, and of the settings that the machine has
        (`Rows.available`, or `settings` beside the wiring's quantities).
    """
    problems = [
        Problem(
            where=f"effect {effect.id}", what=f"needs {name}, which no gauge measures", next_step=_gauge_to_add(name)
        )
        for name in quantities(effect, links)
        if name not in available
    ]
    problems += [
        Problem(
            where=f"effect {effect.id}",
            what=f"needs {need}, which this machine does not have",
            next_step=_SETTINGS[need],
        )
        for need in effect.needs
        if need in _SETTINGS and need not in available
    ]
    if effect.live and not links:
        problems.append(
            Problem(
                where=f"effect {effect.id}",
                what=f"acts at the port {effect.port}, which an external model has not",
                allowed="effects at the port `reference`",
                next_step="write a machine configuration",
            )
        )
    return problems


def _gauge_to_add(name: str) -> str:
    kind = re.split(r"_", name, maxsplit=1)[0]
    gauge = {
        "temperature": "a thermometer",
        "force": "a force gauge",
        "pressure": "a barometer",
        "humidity": "a hygrometer",
    }.get(kind, "a gauge")
    return f"wire {gauge} under `wiring: quantities:` as `name: {name}`, or record a column of that name"


def memoryless(columns: Callable[[Observations, Shape], FloatArray]) -> Basis:
    """A basis whose rows stand alone."""

    def basis(rows: Observations, shape: Shape, memory: Memory) -> tuple[FloatArray, Memory]:
        return columns(rows, shape), memory

    return basis


def one_per_link(values: FloatArray) -> FloatArray:
    """(N, n) values, each link with a parameter of its own -> (N, n, n)."""
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))
