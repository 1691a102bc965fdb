"""The layout of a recording: its columns and the required ones, from their names alone."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from compd.columns import (
    ATTITUDE_COLUMNS,
    ATTITUDES,
    AXES,
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_COLUMNS,
    DISTANCE_COLUMN,
    ID_COLUMNS,
    SKEW_COLUMN,
    approach_columns,
    frame_columns,
    joint_columns,
    parse_name,
    scale_columns,
)
from compd.configuration import Configuration
from compd.errors import Problem
from compd.operation_settings import FRAME_COUNTS
from compd.recording.reference import OF_FIXED_PLACES, sigma_key
from compd.recording.sidecar import EXTERNAL, PLACE, TIME, Sidecar
from compd.tables import ProblemList
from compd.units import REFERENCE_UNITS

_IN_REFERENCE_UNIT = re.compile(r"(?:reference|model)_(?:[xyz]|link_[1-9]\d*)")


@dataclass(frozen=True)
class Layout:
    """The columns of a recording."""

    scales: int  #: scales, joints: how many columns; 0 = none, or an external model
    joints: int
    frame: int  #: how many frame comparators: nine, the six of u1 to u6, or none
    approach: bool  #: whether there is an approach column for every scale; of an external model, any
    axes: tuple[str, ...]  #: axes, attitude: of the reference's position; whether it has an attitude
    attitude: bool
    links: tuple[int, ...]  #: the links (1-based) whose length the reference measures
    covariates: tuple[str, ...]  #: names of all other columns
    ending: str = "mm"  #: what the names of reference and model end in: "mm", or another unit that the sidecar names
    commanded: tuple[str, ...] = ()  #: names of the columns of the commanded pose, of a machine without scales

    @property
    def reference(self) -> tuple[str, ...]:
        """Endings after "reference_" and "model_" in the columns' names: x_mm, rx_rad, link_1_mm."""
        return (
            *(f"{axis}_{self.ending}" for axis in self.axes),
            *(f"{axis}_rad" for axis in ATTITUDES if self.attitude),
            *(f"link_{i}_{self.ending}" for i in self.links),
        )


def read_layout(names: Sequence[str], sidecar: Sidecar | None, reference_valid: bool, problems: ProblemList) -> Layout:
    """The layout of the columns `names`; every column that is missing or must not be there goes to `problems`.

    reference_valid : whether the sidecar's reference could be read; if not, reference columns are not checked.
    """
    external = sidecar is not None and sidecar.external
    ending = REFERENCE_UNITS[sidecar.unit] if sidecar is not None else "mm"
    if sidecar is not None and reference_valid:
        names = _names_in_unit(names, sidecar, problems)
    scales = _count(names, "scale", "mm", external, problems)
    joints = _count(names, "joint", "um", external, problems)
    approaches = _count(names, "approach", "", external, problems)
    frame = [name for name in frame_columns(9) if name in names]
    if external:
        # without a known machine every gauge is a quantity like any other
        scales, joints, frame = 0, 0, []
    quantity = sidecar.reference.quantity if sidecar and sidecar.reference else None
    turned = [name for name in COMMANDED_ATTITUDE_COLUMNS if name in names]
    commanded = () if external else tuple(name for name in (*COMMANDED_COLUMNS, *turned) if name in names)
    if not external:
        if not scales and not commanded and not any(name.startswith("scale_") for name in names):
            _add_missing(["scale_1_mm, scale_2_mm, ..., or commanded_x_mm, ... without scales"], names, problems)
        if 0 < len(turned) < 3:
            _add_missing([name for name in COMMANDED_ATTITUDE_COLUMNS if name not in turned], names, problems)
        if approaches and scales and approaches != scales:
            problems.add(
                "",
                f"{approaches} approach columns for {scales} scales",
                allowed="approach_<i> for every scale, or none",
                next_step="add or delete columns",
            )
        # whether the machine has frame comparators at all, its configuration says: `machine_problems`
        if frame and tuple(frame) not in map(frame_columns, FRAME_COUNTS):
            needed = frame_columns(9 if any(name.startswith("frame_t") for name in frame) else 6)
            _add_missing([name for name in needed if name not in frame], names, problems)
    links = tuple(_numbers(names, "reference_link", ending))
    axes = tuple(axis for axis in AXES if f"reference_{axis}_{ending}" in names)
    attitude = [axis for axis in ATTITUDES if f"reference_{axis}_rad" in names]
    if quantity in ("ball_plate", *OF_FIXED_PLACES):
        axes = AXES
    has_approach = approaches > 0 and (external or approaches == scales)
    layout = Layout(scales, joints, len(frame), has_approach, axes, len(attitude) == 3, links, (), ending, commanded)
    if sidecar is not None and reference_valid:
        _check_reference(names, sidecar, layout, attitude, problems)
        _check_model(names, external, layout, problems)
    if sidecar is not None:
        _check_folds(names, sidecar, problems)
    return replace(layout, covariates=tuple(_covariates(names, layout)))


def machine_problems(
    machine: str,
    counts: tuple[int, int, int],
    quantity: str | None,
    configuration: Configuration,
    where: str,
    *,
    commanded: bool = False,
) -> list[Problem]:
    """Contradictions to `configuration`: the machine's name, and how many gauges of each kind were recorded.

    counts : scales, joint comparators, frame comparators. quantity : of the reference; a link's change by
        interferometer needs no frame (the paper's figures 17 and 18). where : the sidecar, for messages.
    commanded : whether the commanded pose was recorded, which stands for the scales where none were.
    """
    problems: list[Problem] = []
    if machine != configuration.machine:
        problems.append(
            Problem(
                where,
                "the sidecar is for another machine",
                value=machine,
                allowed=configuration.machine,
                next_step="give this machine's configuration, or mend `machine:` in the sidecar",
            )
        )
    if machine == EXTERNAL:
        return problems
    scales, joints, frame = counts
    wired_frame = frame if quantity == "link_length" and not frame else len(configuration.wiring.frame)
    wired_scales = 0 if commanded and not scales else len(configuration.wiring.scale)
    comparisons = (
        ("scale", scales, wired_scales, "scale_<i>_mm"),
        ("joint comparator", joints, len(configuration.wiring.joint), "joint_<k>_um"),
        ("frame comparator", frame, wired_frame, ", ".join(frame_columns(wired_frame))),
    )
    for what, count, expected, column in comparisons:
        if count != expected:
            problems.append(
                Problem(
                    where,
                    f"{count} {what} columns, {configuration.machine} has {expected}",
                    allowed=f"{expected} {column}" if expected else "none",
                    next_step="add the missing columns, or name the right machine",
                )
            )
    return problems


def _numbers(names: Iterable[str], stem: str, unit: str) -> list[int]:
    """The numbers i of the columns <stem>_<i>_<unit>, sorted."""
    pattern = re.compile(rf"{stem}_(\d+){f'_{unit}' if unit else ''}")
    return sorted(int(match[1]) for name in names if (match := pattern.fullmatch(name)))


def _count(names: Sequence[str], stem: str, unit: str, external: bool, problems: ProblemList) -> int:
    """Number of columns <stem>_1 ... <stem>_n; gaps are reported as missing columns.

    An external model needs none of them: with gaps the whole group counts as covariates, and the result is 0.
    """
    numbers = _numbers(names, stem, unit)
    if not numbers or len(numbers) == numbers[-1]:
        return len(numbers)
    if not external:
        tail = f"_{unit}" if unit else ""
        _add_missing([f"{stem}_{i}{tail}" for i in range(1, numbers[-1]) if i not in numbers], names, problems)
    return 0 if external else numbers[-1]


def _names_in_unit(names: Sequence[str], sidecar: Sidecar, problems: ProblemList) -> list[str]:
    """The names, with reference and model in the sidecar's unit; another unit is a problem."""
    ending = REFERENCE_UNITS[sidecar.unit]
    right = {name: name for name in names}
    for unit, other in REFERENCE_UNITS.items():
        columns = [(name, column.stem) for name in names if (column := parse_name(name)) and column.unit == other]
        wrong = {name: f"{stem}_{ending}" for name, stem in columns if _IN_REFERENCE_UNIT.fullmatch(stem)}
        if other == ending or not wrong:
            continue
        mend = f"convert them and name them {', '.join(wrong.values())}"
        problems.add(
            "",
            f"{', '.join(wrong)}: in {other} by their names, but the reference is in {sidecar.unit} by the sidecar",
            next_step=f"write `unit: {unit}` under `reference:`, or {mend}" if sidecar.external else mend,
        )
        right |= wrong
    return list(right.values())


def _check_reference(
    names: Sequence[str], sidecar: Sidecar, layout: Layout, attitude: list[str], problems: ProblemList
) -> None:
    """Check the reference's columns against the quantity that the sidecar names."""
    present = [name for name in names if name.startswith("reference_") or name in ("ball", "pin", "reflector")]
    if sidecar.reference is None:
        if present:
            problems.add(
                "",
                f"{', '.join(present)}: the sidecar names no reference",
                allowed="`reference:` in the sidecar",
                next_step="describe the reference in the sidecar, or delete the columns",
            )
        return
    quantity = sidecar.reference.quantity
    positions = [f"reference_{axis}_{layout.ending}" for axis in AXES]
    wanted: dict[str, list[str]] = {
        "tool_position": [*positions, *["reflector"] * (sidecar.reference.reflectors is not None)],
        "tool_pose": [*positions, *ATTITUDE_COLUMNS],
        "link_length": [name for name in present if name.startswith("reference_link_")],
        "ball_plate": ["ball"],
        "distance": [DISTANCE_COLUMN, "ball"],
        "fixed_point": ["pin"],
    }
    extra = [name for name in present if name not in wanted[quantity]]
    if extra:
        problems.add(
            "",
            f"{', '.join(extra)}: not a column of the quantity that the sidecar names",
            quantity,
            ", ".join(wanted[quantity]) or f"reference_link_1_{layout.ending}, ...",
            "mend `quantity:` in the sidecar, or delete the columns",
        )
    if quantity in ("tool_position", "tool_pose") and not layout.axes:
        _add_missing([f"{positions[0]}, {positions[1]} or {positions[2]}"], names, problems)
    if quantity == "tool_pose" and len(attitude) < 3:
        _add_missing([f"reference_{axis}_rad" for axis in ATTITUDES if axis not in attitude], names, problems)
    if quantity == "link_length":
        if not layout.links:
            _add_missing([f"reference_link_1_{layout.ending}, ..."], names, problems)
        beyond = [i for i in layout.links if layout.scales and i > layout.scales]
        if beyond:
            problems.add("", f"reference of link {beyond[0]}, but there are {layout.scales} scales")
    if sidecar.reference.reflectors is not None:
        _add_missing([name for name in ["reflector"] if name not in names], names, problems)
    if quantity in ("ball_plate", "fixed_point"):
        _add_missing([name for name in wanted[quantity] if name not in names], names, problems)
    if quantity == "distance":
        _check_distance(names, sidecar.reference.radius_mm, problems)
    count = len(layout.links) if quantity == "link_length" else 1 if quantity == "distance" else len(layout.axes)
    key, sigma = sigma_key(sidecar.unit), sidecar.reference.standard_uncertainty
    if count and len(sigma) not in (1, count):
        problems.add(
            "",
            f"{key} has {len(sigma)} values for {count} reference columns",
            allowed=f"1 or {count} values",
            next_step=f"mend `{key}:` in the sidecar",
        )


def _check_distance(names: Sequence[str], radius_mm: float | None, problems: ProblemList) -> None:
    """Check that the distance is either in the column or, equal in every row, in the sidecar."""
    if radius_mm is None and DISTANCE_COLUMN not in names:
        _add_missing([DISTANCE_COLUMN], names, problems)
    elif radius_mm is not None and DISTANCE_COLUMN in names:
        problems.add(
            "",
            f"{DISTANCE_COLUMN}: the sidecar gives the distance of every row, `radius_mm`",
            f"{radius_mm:g} mm",
            "one of the two",
            "delete the column, or `radius_mm:` in the sidecar",
        )


def _check_model(names: Sequence[str], external: bool, layout: Layout, problems: ProblemList) -> None:
    """Check the model_ columns: one for every reference column with an external model, else none."""
    present = [name for name in names if name.startswith("model_")]
    if not external:
        if present:
            problems.add(
                "",
                f"{', '.join(present)}: a model's prediction, but the sidecar names a machine",
                allowed="`machine: external` with model_ columns",
                next_step="mend `machine:` or delete them",
            )
        return
    wanted = [f"model_{name}" for name in layout.reference]
    _add_missing([name for name in wanted if name not in present], names, problems)
    extra = [name for name in present if name not in wanted]
    if extra:
        problems.add(
            "",
            f"{', '.join(extra)}: a prediction with no reference to compare it with",
            next_step="add the reference's column, or delete the model's",
        )


def _check_folds(names: Sequence[str], sidecar: Sidecar, problems: ProblemList) -> None:
    """Check that every column of `folds:` exists, and belongs to neither reference nor model."""
    columns = [name for name in names if name != "time_s" and not name.startswith(("reference_", "model_"))]
    unknown = [name for name in sidecar.folds if name not in (TIME, PLACE, *columns)]
    if unknown:
        problems.problems.append(
            Problem(
                f"{sidecar.path} folds",
                "names what rows cannot be divided by",
                value=", ".join(unknown),
                allowed=", ".join((TIME, PLACE, *columns)),
                next_step="name a column, or delete it",
            )
        )


def _covariates(names: Sequence[str], layout: Layout) -> Iterable[str]:
    """Names of the columns that have no attribute of their own in a Recording."""
    own = {"time_s", SKEW_COLUMN, *ID_COLUMNS, *frame_columns(layout.frame)}
    own |= {*scale_columns(layout.scales), *joint_columns(layout.joints), *layout.commanded}
    own |= {*approach_columns(layout.scales)} if layout.approach else set()
    return (name for name in names if name not in own and not name.startswith(("reference_", "model_")))


def _add_missing(wanted: Sequence[str], names: Sequence[str], problems: ProblemList) -> None:
    """Add one problem for the missing columns of one group."""
    if not wanted:
        return
    unknown = [name for name in names if parse_name(name) is None]
    close = difflib.get_close_matches(wanted[0], unknown, n=1, cutoff=0.75)
    plural = "s are" if len(wanted) > 1 else " is"
    next_step = f"is `{close[0]}` meant?" if close else "add it; leave cells empty where nothing was measured"
    problems.add("", f"the column{plural} missing: {', '.join(wanted)}", next_step=next_step)
