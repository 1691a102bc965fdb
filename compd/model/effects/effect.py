"""What an effect is: one physical cause, where in the machine it acts, and what it adds there.

An effect adds basis(rows) @ theta at its ports: it is linear in its fitted parameters theta. What it is not linear in
(a time constant, a period) is a nonlinear constant, taken from the machine's description or searched. The machine model
propagates from the port to the tip; an effect never computes a tip error itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.link_count import scale_count
from compd.model.effects.observations import Observations
from compd.model.kernels import kernel_number
from compd.reference_conditions import Datum

Port: TypeAlias = Literal[
    "scale", "joint", "frame", "link", "base_joint", "platform_joint", "revolute_axis", "plate", "tool", "reference"
]
PORTS: dict[Port, str] = {
    "scale": "reading of each scale, mm (m)",
    "joint": "reading of each joint comparator, mm (k)",
    "frame": "reading of each frame comparator t1..t3, u1..u6, mm (9)",
    "link": "length of each link, mm (n)",
    "base_joint": "centre of each base joint in {M}, mm (n x 3)",
    "platform_joint": "centre of each platform joint in {P}, mm (n x 3)",
    "revolute_axis": "direction of each revolute axis in {P}, rad (n x 3)",
    "plate": "plate points m1, m2, m3 in {M}, mm (3 x 3)",
    "tool": "tool vector in {P}, or in {M} where the tool stands on the plate, mm (3)",
    "reference": "what the reference instrument shows: x, y, z in mm, then rotation about x, y, z in rad (6)",
}

# What a parameter has one value for.
Per: TypeAlias = Literal["machine", "scale", "link", "axis", "link_axis"]

# Values of an effect's nonlinear constants, by name.
ConstantValues: TypeAlias = Mapping[str, float]
# What an effect remembers from row to row; None at the start. Only the effect itself knows what is in it.
Memory: TypeAlias = tuple[FloatArray, ...] | None
# From rows, constants and memory to (N, sum of port sizes, P) and the memory after; see `Effect`.
Basis: TypeAlias = Callable[[Observations, ConstantValues, Memory], tuple[FloatArray, Memory]]


class BasisProgram(NamedTuple):
    """A compiled basis as data: what `compd.model.kernels.effect_dispatch.set_basis` runs.

    number : of the kernel.  code (L, 2), numbers : of a formula, empty for the library's effects; see
    `compd.model.kernels.formula`. The nonlinear constants stand before these numbers.
    states : length of each array of its memory.
    """

    number: int
    code: IntArray
    numbers: FloatArray
    states: tuple[int, ...]


class CompiledBasis(Protocol):
    """A basis of which the machine code exists: of the library's effects, and of every formula."""

    def program(self, effect: Effect, links: int, sizes: Mapping[Port, int]) -> BasisProgram:
        """As data, for a machine with so many links. sizes : of all ports, from `port_sizes`."""
        ...


@dataclass(frozen=True)
class KernelBasis:
    """The basis of an effect whose equation is a kernel.

    kernel : of `compd.model.kernels.effects`.  states : how many numbers it remembers of each link; at the port `scale`
    of each scale.
    """

    kernel: Any
    states: int = 0

    def program(self, effect: Effect, links: int, sizes: Mapping[Port, int]) -> BasisProgram:
        """See `CompiledBasis`."""
        places = sizes["scale"] if effect.ports[0] == "scale" else links
        return BasisProgram(kernel_number(self.kernel), _NO_CODE, _NO_NUMBERS, (places,) * self.states)


_NO_CODE: IntArray = np.zeros((0, 2), dtype=np.int64)
_NO_NUMBERS: FloatArray = np.zeros(0)


@dataclass(frozen=True)
class Parameter:
    """One kind of fitted parameter, in the unit that people read.

    Attributes
    ----------
    name : str
        As the effect's equation names it.
    unit : str
        For instance ``"ppm/K"``.
    low, high : float
        Plausible range, in `unit`.
    source : str
        Where that range comes from.
    per : str
        What there is one value for: ``"machine"``, ``"scale"``, ``"link"``, ``"axis"`` or ``"link_axis"``.
    reciprocal : bool
        The fit is linear in 1/value: a compliance is fitted, a stiffness shown.
    tolerance : str
        How the tolerance to which a machine was made limits it: ``"place"`` by itself, ``"gain"`` over the stroke,
        ``"gain_change"`` over its square, ``"tilt"`` over the radius of the platform joints; ``""`` for what no
        workshop's tolerance limits.
    rough : bool
        The range follows from such a tolerance, which is stated to an order of magnitude.
    """

    name: str
    unit: str
    low: float
    high: float
    source: str
    per: Per = "machine"
    reciprocal: bool = False
    tolerance: Literal["", "place", "gain", "gain_change", "tilt"] = ""
    rough: bool = False

    def suffixes(self, links: int) -> list[str]:
        """What follows the name of each of its values on a machine of so many links: `_1`, `_2`, `_3`."""
        return {
            "machine": [""],
            "scale": [f"_{i + 1}" for i in range(scale_count(links))],
            "link": [f"_{i + 1}" for i in range(links)],
            "axis": ["_x", "_y", "_z"],
            "link_axis": [f"_{i + 1}{axis}" for i in range(links) for axis in "xyz"],
        }[self.per]

    def from_theta(self, theta: float, std: float = float("nan")) -> tuple[float, float]:
        """Value and standard error in `unit`, from the fitted number and its own; to first order."""
        if not self.reciprocal:
            return theta, std
        if theta == 0.0:
            return float("inf"), float("nan")
        return 1.0 / theta, std / theta**2

    def to_theta(self, value: float) -> float:
        """The number that enters the fit, from a value in `unit`."""
        return 1.0 / value if self.reciprocal else value

    @property
    def theta_range(self) -> tuple[float, float]:
        """Plausible range of the number that is fitted."""
        ends = sorted((self.to_theta(self.low), self.to_theta(self.high)))
        return ends[0], ends[1]


@dataclass(frozen=True)
class Constant:
    """A nonlinear constant of an effect: a time constant, a period, an exponent.

    Attributes
    ----------
    name : str
        As the effect's equation names it.
    unit : str
        For instance ``"s"``.
    low, high : float
        Plausible range, in `unit`.
    source : str
        Where that range comes from.
    grid : tuple of float
        The values that a search tries, in `unit`; two of them are a choice, with nothing between them.
    setting : str
        Name of the machine's setting that gives the value, which is then not searched; ``""`` for none.
    period_of : str
        Of a period, the quantity that it is a period of, as a formula names it (``"scale_mm"``, a measured column):
        other periods than those of the grid are then looked for in a residual. ``""`` for what is no period.
    unstated : float or None
        Its value in model files that do not state it, of releases in which the effect did not have it; None where every
        file states it.
    """

    name: str
    unit: str
    low: float
    high: float
    source: str
    grid: tuple[float, ...]
    setting: str = ""
    period_of: str = ""
    unstated: float | None = None

    @property
    def choice(self) -> bool:
        """Whether one of the two values of the grid is true, and nothing between them."""
        return len(self.grid) <= 2


@dataclass(frozen=True)
class Column:
    """One fitted number of an effect on a machine: `backlash` has b_1, b_2, b_3 on a tripod."""

    name: str
    parameter: Parameter


@dataclass(frozen=True)
class Effect:
    """One physical cause: where in the machine it acts, and what it adds there.

    Attributes
    ----------
    id : str
        Its name in model files and reports.
    ports : tuple of str
        Where it acts: ``"scale"``, ``"joint"``, ``"frame"``, ``"link"``, ``"base_joint"``, ``"platform_joint"``,
        ``"revolute_axis"``, ``"plate"``, ``"tool"``, ``"reference"``.
    physics : str
        What happens, in a sentence.
    equation : str
        As a paper would give it.
    symbols : dict
        Meaning and unit of each symbol of the equation.
    source : str
        Where the equation is from.
    needs : tuple of str
        Quantities by name (``{link}`` stands for each link, ``{scale}`` for each scale), or ``"force"``,
        ``"direction"``, ``"motion"``,
        ``"time"``, ``"order"`` (of the rows), ``"revolute_axes"``, ``"plate_thickness_mm"``.
    parameters : tuple of Parameter
        What is fitted.
    mistaken_for : tuple of str
        Ids of effects that look alike.
    separated_by : str
        Measurements that tell them apart.
    basis : callable or CompiledBasis
        From N rows, constants and memory to the array (N, size, P) and the memory after: the ports' sizes one after
        the other on axis 1, P fitted numbers on axis 2; mm (rad for directions) per unit of each number. Evaluate
        either kind by `compd.model.effects.effect_basis.evaluate_basis`.
    constants : tuple of Constant
        What the effect is not linear in.
    remembers : bool
        A row's value depends on earlier rows; memory goes in and comes out.
    unknown_states : tuple of int
        Which arrays of the memory nobody knows when a session begins, by their place: what a body had in it then.
        These states are fitted along, for each session of a recording. The memory of a lag is (time, x, y), of which
        y is unknown: 2.
    follows_reading : bool
        What it adds depends on its comparators' own readings.
    registration : bool
        A rigid motion of the reference's whole frame, as laying two frames over one another takes away.
    counts_from : str
        From which conditions what it adds counts. ``"machine zero"``: from the measured quantities there, so that a
        column of the basis that one of them changes adds nothing while they are as they were then. ``"20 degC"``: from
        20 degC, 1013.25 hPa and 0 of anything else, as in releases up to 0.2; so it is where nobody knows the
        quantities at machine zero. ``"its own"``: it has a reference of its own, as a graduation that is true at 20
        degC, or needs no measured quantity.
    intercept : str
        Of an effect that grows with a quantity, the id of the effect that remains where the quantity is 0; ``""`` for
        none. A diagnosis that names the first tries the second.
    remarks : tuple of str
        What a person should look at in its declaration, such as a unit that does not fit its column.
    gives : str
        Unit of what it adds to a place that an instrument shows: an angle's, such as ``"arcsec"``, or a length's;
        ``""`` where nobody knows. It is converted to the unit of the recording's reference.
    declared : str or dict
        What a model file names it by: the mapping that it was declared with as a formula, or
        ``"/absolute/file.py:NAME"``; ``""`` for its id.

    Examples
    --------
    A link that grows with temperature, delta_i = a l_i dT_i, in a file of its own, which `add_effect` takes as
    ``"/path/mine.py:MINE"``::

        from compd import Effect, Parameter, memoryless_basis

        def _expansion(rows, constants):  # (N, n, 1): N rows, n links, one parameter; mm per ppm/K
            return (1e-6 * rows.link_mm * rows.link_warming_K)[:, :, None]

        MINE = Effect(
            id="my_expansion", ports=("link",), physics="The links grow with temperature.",
            equation="delta_i = a l_i dT_i", symbols={"a": "expansion coefficient, ppm/K"}, source="Oiwa, section 2.2",
            needs=("temperature_link_{link}_degC",), parameters=(Parameter("a", "ppm/K", 0, 23, "steel 12"),),
            mistaken_for=("link_zero",), separated_by="two temperatures", basis=memoryless_basis(_expansion),
        )
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
    basis: Basis | CompiledBasis
    constants: tuple[Constant, ...] = ()
    remembers: bool = False
    unknown_states: tuple[int, ...] = ()
    follows_reading: bool = False
    registration: bool = False
    remarks: tuple[str, ...] = ()
    counts_from: Datum = "machine zero"
    intercept: str = ""
    gives: str = ""
    declared: str | Mapping[str, Any] = ""

    @property
    def port(self) -> str:
        """The ports as one text."""
        return ", ".join(self.ports)

    @property
    def live(self) -> bool:
        """Whether it belongs to the machine and enters the live loop; what errs at the reference does not."""
        return "reference" not in self.ports

    def columns(self, links: int) -> list[Column]:
        """The fitted numbers, in the order of theta: all values of the first parameter, then of the next."""
        return [
            Column(parameter.name + suffix, parameter)
            for parameter in self.parameters
            for suffix in parameter.suffixes(links)
        ]

    def constant_grid(self, rows: Observations) -> list[dict[str, float]]:
        """Every combination of nonlinear constants to try on these rows; a single one where nothing is searched."""
        combinations: list[dict[str, float]] = [{}]
        for constant in self.constants:
            setting = rows.setting(constant.setting) if constant.setting else None
            values = constant.grid if setting is None else (setting,)
            combinations = [{**chosen, constant.name: value} for chosen in combinations for value in values]
        return combinations


@dataclass(frozen=True)
class FittedEffect:
    """An effect with its numbers: what a machine model carries.

    Attributes
    ----------
    effect : Effect
        The cause.
    theta : (P,) array
        The fitted numbers, in the order of `effect.columns`.
    constants : dict
        Values of its nonlinear constants.
    covariance : (P, P) array
        Of the fitted numbers; nan where it is not known.
    """

    effect: Effect
    theta: FloatArray
    constants: ConstantValues = field(default_factory=dict)
    covariance: FloatArray = field(default_factory=lambda: np.full((1, 1), np.nan))


def memoryless_basis(columns: Callable[[Observations, ConstantValues], FloatArray]) -> Basis:
    """The basis of an effect whose value in a row depends on that row alone.

    Parameters
    ----------
    columns : callable
        From N rows (Observations) and the values of the nonlinear constants by name to the array (N, size, P); see
        `Effect`.

    Returns
    -------
    callable
        For `Effect.basis`.

    Examples
    --------
    >>> import compd
    >>> def longer(rows, constants):  # each link by 1 ppm of its length
    ...     return (1e-6 * rows.link_mm)[:, :, None]
    >>> basis = compd.memoryless_basis(longer)
    """

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[FloatArray, Memory]:
        return columns(rows, constants), memory

    return basis
