"""What is given: a page to begin with, the criteria, and the rows of the recording."""

from __future__ import annotations

import numpy as np

from compd.comparison import ComparisonCriteria
from compd.diagnosis import Criteria
from compd.threshold import thresholds
from docs.worked_example.sheets import AXES, Sheets
from docs.worked_example.spreadsheet import Address


def write_readme(sheets: Sheets) -> None:
    names = [candidate.name for candidate in sheets.example.candidates]
    lines = [
        "How a verdict is reached: every number of the worked example, as formulas.",
        "",
        "Blue cells are formulas, black ones are given: by the recording, by the machine's model, or by compd.",
        "Change a black cell, for instance a residual on the sheet Rows, and see what becomes of the verdict.",
        "",
        f"Three effects: a = {names[0]}, b = {names[1]}, c = {names[2]}. Sets are their letters; 0 is none.",
        "",
        "Criteria: the numbers on which the verdict rests.",
        "Rows: for each row of the recording its folds, the residual, and what a unit of each effect does, in um.",
        "Noise: the noise floor from the differences of repeats, and its test against what is declared.",
        "Weights: residual and effects divided by the noise; which rows are gross, and what the others weigh.",
        "Sums: weighted sums of products of each row; what each set leaves of a row that was left out.",
        "Folds: the fit without each fold, and what it leaves on that fold.",
        "Blocks: what a set gains in each stretch of neighbouring rows, for the standard error of its gain.",
        "Verdict: losses, prices, scores, and the word.",
    ]
    for number, line in enumerate(lines, start=1):
        sheets.book.put("Readme", number, 1, [line], bold=number == 1)


def write_criteria(sheets: Sheets) -> None:
    sheets.book.put("Criteria", 1, 1, ["criterion", "value", "unit", "meaning", "reason"], bold=True)
    row = 2
    for kind in (Criteria, ComparisonCriteria):
        for name, field in thresholds(kind).items():
            if isinstance(field.default, tuple):
                continue  # a grid of values is in no formula of the sheets
            sheets.book.put("Criteria", row, 1, [name, float(field.default), *field[1:]])
            sheets.criteria[name] = Address("Criteria", row, 2)
            row += 1


def write_rows(sheets: Sheets) -> None:
    problem = sheets.example.problem
    residual_um = problem.comparison.residual_um
    visit = problem.aligned.recording.visit
    assert visit is not None
    by_column = [
        problem.aligned.recording.row,
        visit,
        sheets.example.splits[0] + 1,
        sheets.example.splits[1] + 1,
        sheets.example.block + 1,
        problem.known.astype(int),
        *residual_um.T,
        *(column for candidate in sheets.example.candidates for column in candidate.columns_um[:, :, 0].T),
    ]
    names = ["row", "visit", "session", "sector", "block", "known", *(f"r_{axis}" for axis in AXES)]
    names += [f"{letter}_{axis}" for letter in "abc" for axis in AXES]
    about = "known: 1 where every effect is known; 34 rows lack a speed.  r: residual, um.  a, b, c: um per unit"
    sheets.table("Rows", about, names, zip(*(np.nan_to_num(column).tolist() for column in by_column), strict=True))
