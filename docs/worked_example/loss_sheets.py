"""The losses: sums over each fold, the fit without it, and what that leaves on it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from compd.diagnosis.search.regression import MIN_RIDGE
from docs.worked_example.sheets import AXES, FIRST, SETS, Sheets
from docs.worked_example.spreadsheet import Address, column_letters

FOLD_NAMES = (
    *("split", "fold", "rr", "ra", "rb", "rc", "aa", "ab", "bb", "cc"),
    *("a of a", "a of ab", "b of ab", "c of c", "left by 0", "left by a", "left by ab", "left by c"),
)


def write_sums(sheets: Sheets) -> None:
    """Products of each row, weighted; what a row leaves by fits without its fold."""
    products = ["rr", "ra", "rb", "rc", "aa", "ab", "bb", "cc"]
    names = ["row", *products, *(f"left by {name}" for name in SETS), "gain of a", "gain of b", "c less a"]
    column = {name: column_letters(index) for index, name in enumerate(names, start=1)}
    rows: list[list[float | str]] = []
    for k in range(FIRST, sheets.last_row + 1):
        cells: list[float | str] = [f"={sheets.cell('Rows', 'row', k)}"]
        for first, second in products:
            terms = "+".join(
                f"{sheets.cell('Weights', f'{first}_{x}', k)}*{sheets.cell('Weights', f'{second}_{x}', k)}"
                for x in AXES
            )
            cells.append(f"={sheets.cell('Weights', 'weight', k)}*({terms})")
        cells += [_left(sheets, members, k, column) for members in SETS.values()]
        cells.append(f"={column['left by 0']}{k}-{column['left by a']}{k}")
        cells.append(f"={column['left by a']}{k}-{column['left by ab']}{k}")
        cells.append(f"={column['left by c']}{k}-{column['left by a']}{k}")
        rows.append(cells)
    about = (
        "rr ... cc: weight times the products summed over x, y, z.  left: squares that a fit without the row's "
        "session, and one without its sector, leave, on average"
    )
    sheets.table("Sums", about, names, rows)


def write_folds(sheets: Sheets) -> None:
    """Sums over each fold, the fit without it, and what that leaves on it."""
    column = {name: column_letters(index) for index, name in enumerate(FOLD_NAMES, start=1)}
    ridges = _write_ridges(sheets)
    row = FIRST
    about = "Sums over each fold; each effect's number fitted without the fold; squares that it leaves on the fold"
    sheets.book.put("Folds", 1, 1, [about])
    sheets.book.put("Folds", 2, 1, FOLD_NAMES, bold=True)
    for split, folds in zip(("session", "sector"), sheets.example.splits, strict=True):
        first, last = row, row + int(folds.max())
        for fold in range(1, int(folds.max()) + 2):
            keys = sheets.column("Rows", split)
            sums = [f"=SUMIF({keys},$B{row},{sheets.column('Sums', name)})" for name in FOLD_NAMES[2:10]]
            cells: list[float | str] = [split, float(fold), *sums]
            rest = {
                name: f"(SUM({column[name]}${first}:{column[name]}${last})-{column[name]}{row})"
                for name in FOLD_NAMES[2:10]
            }
            ridge = {m: str(address) for m, address in ridges.items()}
            aa, bb, ab = f"({rest['aa']}+{ridge['a']})", f"({rest['bb']}+{ridge['b']})", rest["ab"]
            determinant = f"({aa}*{bb}-{ab}^2)"
            cells.append(f"={rest['ra']}/{aa}")
            cells.append(f"=({bb}*{rest['ra']}-{ab}*{rest['rb']})/{determinant}")
            cells.append(f"=({aa}*{rest['rb']}-{ab}*{rest['ra']})/{determinant}")
            cells.append(f"={rest['rc']}/({rest['cc']}+{ridge['c']})")
            here = {name: f"{letter}{row}" for name, letter in column.items()}
            cells.append(f"={here['rr']}")
            for m, number in (("a", "a of a"), ("c", "c of c")):
                theta = here[number]
                left = f"{here['rr']}-2*{theta}*{here['r' + m]}+{theta}^2*{here[m + m]}"
                cells.append(f"={left}")
                if m == "a":
                    t, u = here["a of ab"], here["b of ab"]
                    cells.append(
                        f"={here['rr']}-2*{t}*{here['ra']}-2*{u}*{here['rb']}+{t}^2*{here['aa']}"
                        f"+2*{t}*{u}*{here['ab']}+{u}^2*{here['bb']}"
                    )
            sheets.book.put("Folds", row, 1, cells)
            row += 1


def write_losses(sheets: Sheets) -> None:
    """Mean over the folds of both splits."""
    count = sheets.results["values"]
    sheets.book.put("Folds", 20, 1, ["set", "loss, sessions left out", "loss, sectors left out", "loss L"], bold=True)
    ends = np.cumsum([FIRST, *(int(split.max()) + 1 for split in sheets.example.splits)])
    for k, name in enumerate(SETS):
        letter = column_letters(FOLD_NAMES.index(f"left by {name}") + 1)
        by_split = [f"=SUM({letter}{begin}:{letter}{end - 1})/{count}" for begin, end in pairwise(ends)]
        row = 21 + k
        sheets.book.put("Folds", row, 1, [name, *by_split, f"=(B{row}+C{row})/2"])
        sheets.results[f"loss_{name}"] = Address("Folds", row, 4)


def _left(sheets: Sheets, members: str, k: int, column: dict[str, str]) -> str:
    """Squares left in row k by the fits without its folds, averaged over both splits."""
    rr = f"{column['rr']}{k}"
    if not members:
        return f"={rr}"
    both = []
    for split in ("session", "sector"):
        fold = sheets.cell("Rows", split, k)
        theta = {m: f"INDEX({_fold_column(sheets, split, f'{m} of {members}')},{fold})" for m in members}
        terms = [f"{rr}", *(f"-2*{theta[m]}*{column[f'r{m}']}{k}" for m in members)]
        for i, m in enumerate(members):
            terms.append(f"+{theta[m]}^2*{column[m + m]}{k}")
            terms += [f"+2*{theta[m]}*{theta[n]}*{column[m + n]}{k}" for n in members[i + 1 :]]
        both.append("".join(terms))
    return f"=({both[0]}+{both[1]})/2"


def _fold_column(sheets: Sheets, split: str, name: str) -> str:
    """A column of the folds of one split."""
    letter = column_letters(FOLD_NAMES.index(name) + 1)
    folds = [int(values.max()) + 1 for values in sheets.example.splits]
    begin = FIRST if split == "session" else FIRST + folds[0]
    end = begin + (folds[0] if split == "session" else folds[1]) - 1
    return f"Folds!${letter}${begin}:${letter}${end}"


def _write_ridges(sheets: Sheets) -> dict[str, Address]:
    """Ridge of each effect, its plausible range being one measurement of zero: where it stands, by letter."""
    sheets.book.put("Folds", 14, 1, ["effect", "largest plausible", "ridge", "fitted on all rows"], bold=True)
    ridges = {}
    for k, (m, candidate) in enumerate(zip("abc", sheets.example.candidates, strict=True)):
        squares = f"SUM({sheets.column('Sums', m + m)})"
        ridge = f"=1/B{15 + k}^2+{MIN_RIDGE}*{squares}"
        theta = f"=SUM({sheets.column('Sums', 'r' + m)})/({squares}+C{15 + k})"
        sheets.book.put("Folds", 15 + k, 1, [f"{m} {candidate.name}", float(candidate.largest[0]), ridge, theta])
        ridges[m] = Address("Folds", 15 + k, 3)
    sheets.results["theta"] = Address("Folds", 15, 4)
    return ridges
