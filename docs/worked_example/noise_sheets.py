"""The noise floor, and what each row weighs: both by robust standard deviations."""

from __future__ import annotations

import numpy as np

from compd.statistics import SCALE_EFFICIENCY, last_digit_um, replicate_pairs
from compd.statistics.robust import TRIMMED, WINSORIZED, WINSORIZED_MEAN_SQUARE
from compd.units import UM_PER_MM
from docs.worked_example.sheets import AXES, FIRST, Sheets
from docs.worked_example.spreadsheet import Address, column_letters

# Steps of the iteration by which a robust standard deviation is found, and how often outliers are then dropped.
STEPS, PASSES = 40, 3


def write_noise(sheets: Sheets) -> None:
    """Differences of repeats, their robust scale by iteration, and the declaration."""
    comparison = sheets.example.problem.comparison
    pairs = replicate_pairs(comparison.used, comparison.aligned.recording.visit, comparison.criteria.max_rows_of_visit)
    assert pairs is not None
    numbers = comparison.aligned.recording.row
    row = sheets.column("Rows", "row")
    given = [numbers[pairs.first].tolist(), numbers[pairs.second].tolist(), pairs.weight.tolist()]
    names = ["first row", "second row", "weight", *(f"d_{axis}" for axis in AXES)]
    columns: list[list[float | str]] = [*given]
    for axis in AXES:
        residual = sheets.column("Rows", f"r_{axis}")
        columns.append(
            [
                f"=(INDEX({residual},MATCH(A{k},{row},0))-INDEX({residual},MATCH(B{k},{row},0)))/SQRT(2)"
                for k in range(FIRST, FIRST + len(pairs.weight))
            ]
        )
    about = "Pairs of rows of one visit, without outliers; d: difference of their residuals over the root of 2, um"
    sheets.table("Noise", about, names, zip(*columns, strict=True))
    last = FIRST + len(pairs.weight) - 1
    weight = f"$C${FIRST}:$C${last}"
    values = {axis: f"${letter}${FIRST}:${letter}${last}" for axis, letter in zip(AXES, "DEF", strict=True)}
    scale = _robust_scale(sheets, "Noise", 9, values, dict.fromkeys(AXES, weight))
    declared_um = comparison.aligned.recording.reference_sigma_mm * UM_PER_MM
    gauges_um = np.sqrt(np.mean(comparison.uncertainty.gauges_um[comparison.used] ** 2, axis=0))
    reference_mm = comparison.aligned.recording.reference_mm
    assert reference_mm is not None
    digit_um = last_digit_um(reference_mm * UM_PER_MM)
    column, row_number = 14, 2
    sheets.book.put("Noise", row_number, column, ["the noise floor, um", *AXES], bold=True)
    letters = [column_letters(column + k) for k in (1, 2, 3)]

    def line(offset: int, label: str, cells: list[float | str]) -> None:
        sheets.book.put("Noise", row_number + offset, column, [label, *cells])

    line(1, "scatter of the repeats", [f"=MAX({scale[axis]},{x}4)" for axis, x in zip(AXES, letters, strict=True)])
    line(2, "uncertainty of the last digit", digit_um.tolist())
    line(3, "declared for the tracker", declared_um.tolist())
    line(4, "gauges, at the tip", gauges_um.tolist())
    line(5, "declared, together", [f"=SQRT({x}5^2+{x}6^2)" for x in letters])
    line(6, "degrees of freedom of the repeats", [f"={SCALE_EFFICIENCY}*SUM({weight})"])
    ratios = "+".join(f"({x}3/{x}7)^2" for x in letters)
    line(7, "ratio of the variances, mean", [f"=({ratios})/3"])
    declared_dof = sheets.criteria["declared_dof"]
    line(8, "F test: probability of more", [f"=FDIST({letters[0]}9,3*{letters[0]}8,3*{declared_dof})"])
    p_value = sheets.criteria["contradiction_p_value"]
    line(9, "agree?", [f'=IF(MIN({letters[0]}10,1-{letters[0]}10)>={p_value}/2,"yes","no")'])
    pooled = [
        f'=IF({letters[0]}$11="yes",SQRT(({letters[0]}$8*{x}3^2+{declared_dof}*{x}7^2)/({letters[0]}$8+'
        f"{declared_dof})),{x}3)"
        for x in letters
    ]
    line(10, "noise floor", pooled)
    for k, axis in enumerate(AXES, start=1):
        sheets.results[f"sigma_{axis}"] = Address("Noise", row_number + 10, column + k)
    means = "+".join(f"{x}12^2" for x in letters)
    line(11, "rms of the three", [f"=SQRT(({means})/3)"])
    sheets.results["floor"] = Address("Noise", row_number + 11, column + 1)


def write_weights(sheets: Sheets) -> None:
    """Whitened residual and effects, the robust fit's residual, gross rows and weights."""
    full, gross = sheets.criteria["full_weight_sigmas"], sheets.criteria["gross_sigmas"]
    names = ["row", *(f"r_{axis}" for axis in AXES), *(f"{e}_{axis}" for e in "abc" for axis in AXES)]
    names += [*(f"e_{axis}" for axis in AXES), "d", "far", "confirmed", "gross", "weight"]
    column = {name: column_letters(index) for index, name in enumerate(names, start=1)}
    side = len(names) + 2
    fit = {name: Address("Weights", 3 + k, side + 1) for k, name in enumerate(["c_x", "c_y", "c_z", "a"])}
    consistency = Address("Weights", 8, side + 1)
    sheets.book.put("Weights", 2, side, ["robust fit, from compd", "standard deviations"], bold=True)
    for (name, address), value in zip(fit.items(), sheets.example.robust_fit.tolist(), strict=True):
        sheets.book.put("Weights", address.row, side, [name, value])
    within = f"1-CHIDIST(3*{full}^2,5)"
    beyond = f"EXP(GAMMALN(2)-GAMMALN(1.5))*SQRT(2/3)*CHIDIST(3*{full}^2,4)"
    sheets.book.put("Weights", 8, side, ["mean weight of the squares of normal noise", f"={within}+{full}*{beyond}"])
    ends = {name: f"${letter}${FIRST}:${letter}${sheets.last_row}" for name, letter in column.items()}
    known, visit = sheets.column("Rows", "known"), sheets.column("Rows", "visit")
    scale = _robust_scale(sheets, "Weights", side + 3, {x: ends[f"e_{x}"] for x in AXES}, dict.fromkeys(AXES, known))
    rows: list[list[float | str]] = []
    for k in range(FIRST, sheets.last_row + 1):
        here = {name: f"{letter}{k}" for name, letter in column.items()}
        cells: list[float | str] = [f"={sheets.cell('Rows', 'row', k)}"]
        of_row = sheets.cell("Rows", "known", k)
        for name in names[1:13]:
            sigma = sheets.results[f"sigma_{name[-1]}"]
            cells.append(f"={sheets.cell('Rows', name, k)}/{sigma}")
        for axis in AXES:
            constant = fit[f"c_{axis}"]
            cells.append(f"={here[f'r_{axis}']}-{constant}-{here[f'a_{axis}']}*{fit['a']}")
        distances = [f"{here[f'e_{axis}']}/MAX({scale[axis]},1)" for axis in AXES]
        cells.append(f"=SQRT(({'+'.join(f'({distance})^2' for distance in distances)})/3)")
        cells.append(f"=IF(MAX({','.join(f'ABS({distance})' for distance in distances)})>{gross},1,0)")
        near = [f"(ABS({ends[f'e_{axis}']}-{here[f'e_{axis}']})<={gross}*SQRT(2))" for axis in AXES]
        same = f"SUMPRODUCT(({visit}={sheets.cell('Rows', 'visit', k)})*{'*'.join(near)})"
        cells.append(f"=IF({here['far']}=1,IF({same}>1,1,0),0)")
        cells.append(f"={here['far']}*(1-{here['confirmed']})")
        cells.append(f"={of_row}*(1-{here['gross']})*{full}/MAX({here['d']},{full})/{consistency}")
        rows.append(cells)
    about = (
        "r, a, b, c: divided by the noise.  e: what the robust fit leaves.  d: distance in robust standard "
        "deviations, at least the noise.  gross: far, and no repeat confirms it"
    )
    sheets.table("Weights", about, names, rows)
    _count(sheets, "gross", f"=SUM({ends['gross']})", 10, side)
    _count(sheets, "values", f"=3*SUMPRODUCT(({ends['weight']}>0)*1)", 11, side)


def _count(sheets: Sheets, name: str, formula: str, row: int, column: int) -> None:
    labels = {"gross": "gross rows", "values": "measured values that count"}
    sheets.book.put("Weights", row, column, [labels[name], formula])
    sheets.results[name] = Address("Weights", row, column + 1)


def _robust_scale(
    sheets: Sheets, sheet: str, column: int, values: dict[str, str], weights: dict[str, str]
) -> dict[str, Address]:
    """Huber's proposal 2 by iteration, what is beyond 4 standard deviations being dropped after each pass."""
    sheets.book.put(sheet, 2, column, ["robust scale, step", *values], bold=True)
    for index, (x, d) in enumerate(values.items(), start=column + 1):
        letter, w = column_letters(index), weights[x]
        row = FIRST
        kept = "1"
        for number in range(PASSES):
            start = (
                f"=SQRT(SUMPRODUCT({w}*{kept},{d}^2)/SUMPRODUCT({w}*{kept}))" if number == 0 else f"={letter}{row - 1}"
            )
            sheets.book.put(sheet, row, index, [start])
            for step in range(STEPS):
                s = f"{letter}{row + step}"
                below = f"({d}^2<{WINSORIZED**2:g}*{s}^2)"
                clipped = f"({below}*{d}^2/{s}^2+(1-{below})*{WINSORIZED**2:g})"
                mean = f"SUMPRODUCT({w}*{kept},{clipped})/SUMPRODUCT({w}*{kept})"
                sheets.book.put(sheet, row + step + 1, index, [f"={s}*SQRT({mean}/{WINSORIZED_MEAN_SQUARE})"])
            row += STEPS + 1
            kept = f"({d}^2<={TRIMMED**2:g}*{letter}${row - 1}^2)"
    for step in range(PASSES * (STEPS + 1)):
        sheets.book.put(sheet, FIRST + step, column, [float(step)])
    end = FIRST + PASSES * (STEPS + 1) - 1
    return {x: Address(sheet, end, index) for index, x in enumerate(values, start=column + 1)}
