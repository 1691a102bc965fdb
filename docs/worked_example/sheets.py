"""The sheets: from the residual of each row to the word of the verdict, every step a formula."""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import numpy as np

from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.statistics.last_digit import last_digit_um
from compd.comparison.statistics.replicates import replicate_pairs
from compd.comparison.statistics.robust import SCALE_EFFICIENCY, TRIMMED, WINSORIZED, WINSORIZED_MEAN_SQUARE
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.regression import LEAST_RIDGE
from compd.units import UM_PER_MM
from docs.worked_example.example import Example
from docs.worked_example.spreadsheet import Address, Spreadsheet, column_letters

# Steps of the iteration by which a robust standard deviation is found, and how often outliers are then dropped.
STEPS, PASSES = 40, 3
# First row of the data on every sheet that has one row for each row of the recording.
FIRST = 3
AXES = "xyz"
# Sets of effects: the letters of their columns.
SETS = {"0": "", "a": "a", "ab": "ab", "c": "c"}


class Sheets:
    """The spreadsheet of an example; `results` says where its main results stand."""

    def __init__(self, example: Example) -> None:
        self.example = example
        self.book = Spreadsheet()
        self.results: dict[str, Address] = {}
        self._letters: dict[tuple[str, str], str] = {}
        self._last = FIRST + len(example.problem.known) - 1
        self._criteria: dict[str, Address] = {}
        self._read_me()
        self._criteria_sheet()
        self._rows()
        self._noise()
        self._weights()
        self._sums()
        self._folds()
        self._losses()
        self._blocks()
        self._verdict()

    def save(self, path: Path) -> None:
        """Write the spreadsheet as .xlsx."""
        self.book.save(path, {"Readme": 100.0, "Criteria": 24.0, "Folds": 20.0, "Blocks": 22.0, "Verdict": 44.0})

    # The sheets, in the order in which they are read.

    def _read_me(self) -> None:
        names = [candidate.name for candidate in self.example.candidates]
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
            self.book.put("Readme", number, 1, [line], bold=number == 1)

    def _criteria_sheet(self) -> None:
        self.book.put("Criteria", 1, 1, ["criterion", "value", "unit", "meaning", "reason"], bold=True)
        row = 2
        for kind in (Criteria, ComparisonCriteria):
            for field in fields(kind):
                texts = [field.metadata[key] for key in ("unit", "meaning", "reason")]
                self.book.put("Criteria", row, 1, [field.name, float(field.default), *texts])
                self._criteria[field.name] = Address("Criteria", row, 2)
                row += 1

    def _rows(self) -> None:
        problem = self.example.problem
        residual_um = problem.comparison.residual_um
        visit = problem.aligned.recording.visit
        assert visit is not None
        by_row = [
            problem.aligned.recording.row,
            visit,
            self.example.splits[0] + 1,
            self.example.splits[1] + 1,
            self.example.block + 1,
            problem.known.astype(int),
            *residual_um.T,
            *(column for candidate in self.example.candidates for column in candidate.columns_um[:, :, 0].T),
        ]
        names = ["row", "visit", "session", "sector", "block", "known", *(f"r_{axis}" for axis in AXES)]
        names += [f"{letter}_{axis}" for letter in "abc" for axis in AXES]
        about = "known: 1 where every effect is known; 34 rows lack a speed.  r: residual, um.  a, b, c: um per unit"
        self._table("Rows", about, names, [np.nan_to_num(column).tolist() for column in by_row])

    def _noise(self) -> None:
        """Differences of repeats, their robust scale by iteration, and the declaration."""
        comparison = self.example.problem.comparison
        pairs = replicate_pairs(comparison.used, comparison.aligned.recording.visit)
        assert pairs is not None
        numbers = comparison.aligned.recording.row
        row = self._range("Rows", "row")
        given = [numbers[pairs.first].tolist(), numbers[pairs.second].tolist(), pairs.weight.tolist()]
        names = ["first row", "second row", "weight", *(f"d_{axis}" for axis in AXES)]
        columns: list[list[float | str]] = [*given]
        for axis in AXES:
            residual = self._range("Rows", f"r_{axis}")
            columns.append(
                [
                    f"=(INDEX({residual},MATCH(A{k},{row},0))-INDEX({residual},MATCH(B{k},{row},0)))/SQRT(2)"
                    for k in range(FIRST, FIRST + len(pairs.weight))
                ]
            )
        about = "Pairs of rows of one visit, without outliers; d: difference of their residuals over the root of 2, um"
        self._table("Noise", about, names, columns)
        last = FIRST + len(pairs.weight) - 1
        weight = f"$C${FIRST}:$C${last}"
        values = {axis: f"${letter}${FIRST}:${letter}${last}" for axis, letter in zip(AXES, "DEF", strict=True)}
        scale = self._scale("Noise", 9, values, dict.fromkeys(AXES, weight))
        declared_um = comparison.aligned.recording.reference_sigma_mm * UM_PER_MM
        gauges_um = np.sqrt(np.mean(comparison.uncertainty.gauges_um[comparison.used] ** 2, axis=0))
        reference_mm = comparison.aligned.recording.reference_mm
        assert reference_mm is not None
        digit_um = last_digit_um(reference_mm * UM_PER_MM)
        column, row_number = 14, 2
        self.book.put("Noise", row_number, column, ["the noise floor, um", *AXES], bold=True)
        letters = [column_letters(column + k) for k in (1, 2, 3)]

        def line(offset: int, label: str, cells: list[float | str]) -> None:
            self.book.put("Noise", row_number + offset, column, [label, *cells])

        line(1, "scatter of the repeats", [f"=MAX({scale[axis]},{x}4)" for axis, x in zip(AXES, letters, strict=True)])
        line(2, "uncertainty of the last digit", digit_um.tolist())
        line(3, "declared for the tracker", declared_um.tolist())
        line(4, "gauges, at the tip", gauges_um.tolist())
        line(5, "declared, together", [f"=SQRT({x}5^2+{x}6^2)" for x in letters])
        line(6, "degrees of freedom of the repeats", [f"={SCALE_EFFICIENCY}*SUM({weight})"])
        ratios = "+".join(f"({x}3/{x}7)^2" for x in letters)
        line(7, "ratio of the variances, mean", [f"=({ratios})/3"])
        declared_dof = self._criteria["declared_dof"]
        line(8, "F test: probability of more", [f"=FDIST({letters[0]}9,3*{letters[0]}8,3*{declared_dof})"])
        p_value = self._criteria["contradiction_p_value"]
        line(9, "agree?", [f'=IF(MIN({letters[0]}10,1-{letters[0]}10)>={p_value}/2,"yes","no")'])
        pooled = [
            f'=IF({letters[0]}$11="yes",SQRT(({letters[0]}$8*{x}3^2+{declared_dof}*{x}7^2)/({letters[0]}$8+'
            f"{declared_dof})),{x}3)"
            for x in letters
        ]
        line(10, "noise floor", pooled)
        for k, axis in enumerate(AXES, start=1):
            self.results[f"sigma_{axis}"] = Address("Noise", row_number + 10, column + k)
        means = "+".join(f"{x}12^2" for x in letters)
        line(11, "rms of the three", [f"=SQRT(({means})/3)"])
        self.results["floor"] = Address("Noise", row_number + 11, column + 1)

    def _weights(self) -> None:
        """Whitened residual and effects, the robust fit's residual, gross rows and weights."""
        full, gross = self._criteria["full_weight_sigmas"], self._criteria["gross_sigmas"]
        names = ["row", *(f"r_{axis}" for axis in AXES), *(f"{e}_{axis}" for e in "abc" for axis in AXES)]
        names += [*(f"e_{axis}" for axis in AXES), "d", "far", "confirmed", "gross", "weight"]
        column = {name: column_letters(place) for place, name in enumerate(names, start=1)}
        side = len(names) + 2
        fit = {name: Address("Weights", 3 + k, side + 1) for k, name in enumerate(["c_x", "c_y", "c_z", "a"])}
        consistency = Address("Weights", 8, side + 1)
        self.book.put("Weights", 2, side, ["robust fit, from compd", "standard deviations"], bold=True)
        for (name, address), value in zip(fit.items(), self.example.robust_fit.tolist(), strict=True):
            self.book.put("Weights", address.row, side, [name, value])
        within = f"1-CHIDIST(3*{full}^2,5)"
        beyond = f"EXP(GAMMALN(2)-GAMMALN(1.5))*SQRT(2/3)*CHIDIST(3*{full}^2,4)"
        self.book.put("Weights", 8, side, ["mean weight of the squares of normal noise", f"={within}+{full}*{beyond}"])
        ends = {name: f"${letter}${FIRST}:${letter}${self._last}" for name, letter in column.items()}
        known, visit = self._range("Rows", "known"), self._range("Rows", "visit")
        scale = self._scale("Weights", side + 3, {x: ends[f"e_{x}"] for x in AXES}, dict.fromkeys(AXES, known))
        columns: list[list[float | str]] = [[] for _ in names]
        for k in range(FIRST, self._last + 1):
            here = {name: f"{letter}{k}" for name, letter in column.items()}
            cells: list[float | str] = [f"={self._cell('Rows', 'row', k)}"]
            of_row = self._cell("Rows", "known", k)
            for name in names[1:13]:
                sigma = self.results[f"sigma_{name[-1]}"]
                cells.append(f"={self._cell('Rows', name, k)}/{sigma}")
            for axis in AXES:
                constant = fit[f"c_{axis}"]
                cells.append(f"={here[f'r_{axis}']}-{constant}-{here[f'a_{axis}']}*{fit['a']}")
            distances = [f"{here[f'e_{axis}']}/{scale[axis]}" for axis in AXES]
            cells.append(f"=SQRT(({'+'.join(f'({distance})^2' for distance in distances)})/3)")
            cells.append(f"=IF(MAX({','.join(f'ABS({distance})' for distance in distances)})>{gross},1,0)")
            near = [f"(ABS({ends[f'e_{axis}']}-{here[f'e_{axis}']})<={gross}*SQRT(2))" for axis in AXES]
            same = f"SUMPRODUCT(({visit}={self._cell('Rows', 'visit', k)})*{'*'.join(near)})"
            cells.append(f"=IF({here['far']}=1,IF({same}>1,1,0),0)")
            cells.append(f"={here['far']}*(1-{here['confirmed']})")
            cells.append(f"={of_row}*(1-{here['gross']})*{full}/MAX({here['d']},{full})/{consistency}")
            for values, cell in zip(columns, cells, strict=True):
                values.append(cell)
        about = (
            "r, a, b, c: divided by the noise.  e: what the robust fit leaves.  d: distance in robust standard "
            "deviations.  gross: far, and no repeat confirms it"
        )
        self._table("Weights", about, names, columns)
        self._count("gross", f"=SUM({ends['gross']})", 10, side)
        self._count("values", f"=3*SUMPRODUCT(({ends['weight']}>0)*1)", 11, side)

    def _sums(self) -> None:
        """Products of each row, weighted; what a row leaves by fits without its fold."""
        products = ["rr", "ra", "rb", "rc", "aa", "ab", "bb", "cc"]
        names = ["row", *products, *(f"left by {name}" for name in SETS), "gain of a", "gain of b", "c less a"]
        column = {name: column_letters(place) for place, name in enumerate(names, start=1)}
        columns: list[list[float | str]] = [[] for _ in names]
        for k in range(FIRST, self._last + 1):
            cells: list[float | str] = [f"={self._cell('Rows', 'row', k)}"]
            for first, second in products:
                terms = "+".join(
                    f"{self._cell('Weights', f'{first}_{x}', k)}*{self._cell('Weights', f'{second}_{x}', k)}"
                    for x in AXES
                )
                cells.append(f"={self._cell('Weights', 'weight', k)}*({terms})")
            cells += [self._left(members, k, column) for members in SETS.values()]
            cells.append(f"={column['left by 0']}{k}-{column['left by a']}{k}")
            cells.append(f"={column['left by a']}{k}-{column['left by ab']}{k}")
            cells.append(f"={column['left by c']}{k}-{column['left by a']}{k}")
            for values, cell in zip(columns, cells, strict=True):
                values.append(cell)
        about = (
            "rr ... cc: weight times the products summed over x, y, z.  left: squares that a fit without the row's "
            "session, and one without its sector, leave, on average"
        )
        self._table("Sums", about, names, columns)

    def _left(self, members: str, k: int, column: dict[str, str]) -> str:
        """Squares left in row k by the fits without its folds, averaged over both splits."""
        rr = f"{column['rr']}{k}"
        if not members:
            return f"={rr}"
        both = []
        for split in ("session", "sector"):
            fold = self._cell("Rows", split, k)
            theta = {m: f"INDEX({self._fold_range(split, f'{m} of {members}')},{fold})" for m in members}
            terms = [f"{rr}", *(f"-2*{theta[m]}*{column[f'r{m}']}{k}" for m in members)]
            for i, m in enumerate(members):
                terms.append(f"+{theta[m]}^2*{column[m + m]}{k}")
                terms += [f"+2*{theta[m]}*{theta[n]}*{column[m + n]}{k}" for n in members[i + 1 :]]
            both.append("".join(terms))
        return f"=({both[0]}+{both[1]})/2"

    FOLD_NAMES = (
        *("split", "fold", "rr", "ra", "rb", "rc", "aa", "ab", "bb", "cc"),
        *("a of a", "a of ab", "b of ab", "c of c", "left by 0", "left by a", "left by ab", "left by c"),
    )

    def _folds(self) -> None:
        """Sums over each fold, the fit without it, and what that leaves on it."""
        column = {name: column_letters(place) for place, name in enumerate(self.FOLD_NAMES, start=1)}
        self._ridge()
        row = FIRST
        about = "Sums over each fold; each effect's number fitted without the fold; squares that it leaves on the fold"
        self.book.put("Folds", 1, 1, [about])
        self.book.put("Folds", 2, 1, self.FOLD_NAMES, bold=True)
        for split, folds in zip(("session", "sector"), self.example.splits, strict=True):
            first, last = row, row + int(folds.max())
            for fold in range(1, int(folds.max()) + 2):
                keys = self._range("Rows", split)
                sums = [f"=SUMIF({keys},$B{row},{self._range('Sums', name)})" for name in self.FOLD_NAMES[2:10]]
                cells: list[float | str] = [split, float(fold), *sums]
                rest = {
                    name: f"(SUM({column[name]}${first}:{column[name]}${last})-{column[name]}{row})"
                    for name in self.FOLD_NAMES[2:10]
                }
                ridge = {m: str(address) for m, address in self._ridges.items()}
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
                self.book.put("Folds", row, 1, cells)
                row += 1

    def _ridge(self) -> None:
        """The plausible range as one measurement of zero."""
        self.book.put("Folds", 14, 1, ["effect", "largest plausible", "ridge", "fitted on all rows"], bold=True)
        self._ridges: dict[str, Address] = {}
        for k, (m, candidate) in enumerate(zip("abc", self.example.candidates, strict=True)):
            squares = f"SUM({self._range('Sums', m + m)})"
            ridge = f"=1/B{15 + k}^2+{LEAST_RIDGE}*{squares}"
            theta = f"=SUM({self._range('Sums', 'r' + m)})/({squares}+C{15 + k})"
            self.book.put("Folds", 15 + k, 1, [f"{m} {candidate.name}", float(candidate.largest[0]), ridge, theta])
            self._ridges[m] = Address("Folds", 15 + k, 3)
        self.results["theta"] = Address("Folds", 15, 4)

    def _losses(self) -> None:
        """Mean over the folds of both splits."""
        count = self.results["values"]
        self.book.put("Folds", 20, 1, ["set", "loss, sessions left out", "loss, sectors left out", "loss L"], bold=True)
        ends = np.cumsum([FIRST, *(int(split.max()) + 1 for split in self.example.splits)])
        for k, name in enumerate(SETS):
            letter = column_letters(self.FOLD_NAMES.index(f"left by {name}") + 1)
            by_split = [f"=SUM({letter}{begin}:{letter}{end - 1})/{count}" for begin, end in pairwise(ends)]
            row = 21 + k
            self.book.put("Folds", row, 1, [name, *by_split, f"=(B{row}+C{row})/2"])
            self.results[f"loss_{name}"] = Address("Folds", row, 4)

    def _blocks(self) -> None:
        """Gains summed over blocks of neighbouring rows."""
        count = int(self.example.block.max()) + 1
        gains = ["gain of a", "gain of b", "c less a"]
        keys = self._range("Rows", "block")
        columns: list[list[float | str]] = [[float(block) for block in range(1, count + 1)]]
        for name in gains:
            values = self._range("Sums", name)
            columns.append([f"=SUMIF({keys},A{k},{values})" for k in range(FIRST, FIRST + count)])
        about = (
            "Squares gained on rows left out, summed over each block; divided by the number of values: gain and error"
        )
        self._table("Blocks", about, ["block", *gains], columns)
        last = FIRST + count - 1
        values = self.results["values"]
        labels = ["gain per value", "its standard error", "gain / error"]
        for k, label in enumerate(labels):
            cells = []
            for letter in "BCD":
                block = f"{letter}${FIRST}:{letter}${last}"
                squares = f"SUMPRODUCT(({block}-SUM({block})/{count})*({block}-SUM({block})/{count}))"
                cells.append(
                    [
                        f"=SUM({block})/{values}",
                        f"=SQRT({count}/{count - 1}*{squares})/{values}",
                        f"={letter}{last + 2}/{letter}{last + 3}",
                    ][k]
                )
            self.book.put("Blocks", last + 2 + k, 1, [label, *cells])
        for place, name in enumerate(("a", "b", "c"), start=2):
            self.results[f"gain_{name}"] = Address("Blocks", last + 2, place)
            self.results[f"std_{name}"] = Address("Blocks", last + 3, place)

    def _verdict(self) -> None:
        """Scores, what each member is worth, the rival, and the word."""
        price = self._criteria["effect_price"]
        head = ["set", "loss L", "log of the loss, not below 0", "prices", "score"]
        self.book.put("Verdict", 1, 1, head, bold=True)
        for k, (name, members) in enumerate(SETS.items(), start=2):
            logarithm, prices = f"=LN(MAX(B{k},1))", f"={len(members)}*{price}"
            self.book.put("Verdict", k, 1, [name, f"={self.results[f'loss_{name}']}", logarithm, prices, f"=C{k}+D{k}"])
            self.results[f"score_{name}"] = Address("Verdict", k, 5)
        self.book.put("Verdict", 8, 1, ["question", "number", "limit", "answer"], bold=True)
        sigmas, at_floor = self._criteria["least_sigmas"], self._criteria["most_at_floor"]
        rival_share = self._criteria["rival_share"]
        ratio = {m: f"{self.results[f'gain_{m}']}/{self.results[f'std_{m}']}" for m in "abc"}
        questions = [
            ("a: log loss falls by", "=C2-C3", f"={price}", ">="),
            ("a: gain in standard errors", f"={ratio['a']}", f"={sigmas}", ">="),
            ("b beside a: log loss falls by", "=C3-C4", f"={price}", ">="),
            ("b beside a: gain in standard errors", f"={ratio['b']}", f"={sigmas}", ">="),
            ("c for a: log loss rises by", "=C5-C3", f"={price}", "<="),
            ("c for a: loss rises by, in standard errors", f"={ratio['c']}", f"={sigmas}", "<="),
            ("c for a: misses this share of what a takes", "=(B5-B3)/(B2-B3)", f"={rival_share}", "<="),
            ("set a: its loss", "=B3", f"={at_floor}", "<="),
        ]
        for row, (question, number, limit, comparison) in enumerate(questions, start=9):
            answer = f'=IF(B{row}{comparison}C{row},"yes","no")'
            self.book.put("Verdict", row, 1, [question, number, limit, answer])
        yes = {name: f'D{row}="yes"' for name, row in zip("ABCDEFGH", range(9, 17), strict=True)}
        rows = {
            "a is needed": f'=IF(AND({yes["A"]},{yes["B"]}),"yes","no")',
            "b is needed beside a": f'=IF(AND({yes["C"]},{yes["D"]}),"yes","no")',
            "c is a rival of a": f'=IF(AND(OR({yes["E"]},{yes["F"]}),{yes["G"]}),"yes","no")',
            "verdict": '=IF(D9="no",IF(B2<=C16,"adequate","unexplained"),IF(D16="no","partial",'
            'IF(B20="yes","ambiguous","identified")))',
        }
        for row, (name, formula) in enumerate(rows.items(), start=18):
            self.book.put("Verdict", row, 1, [name, formula], bold=name == "verdict")
        self.results["verdict"] = Address("Verdict", 21, 2)

    # What the sheets share.

    def _table(self, sheet: str, about: str, names: list[str], columns: list[list[float | str]]) -> None:
        """A sheet with one line about it, names, and columns from row FIRST on."""
        self.book.put(sheet, 1, 1, [about])
        self.book.put(sheet, 2, 1, names, bold=True)
        self._letters |= {(sheet, name): column_letters(place) for place, name in enumerate(names, start=1)}
        for row, values in enumerate(zip(*columns, strict=True), start=FIRST):
            self.book.put(sheet, row, 1, values)

    def _range(self, sheet: str, name: str) -> str:
        """A column of a sheet with one row for each row of the recording."""
        letter = self._letters[sheet, name]
        return f"{sheet}!${letter}${FIRST}:${letter}${self._last}"

    def _cell(self, sheet: str, name: str, row: int) -> str:
        return f"{sheet}!{self._letters[sheet, name]}{row}"

    def _fold_range(self, split: str, name: str) -> str:
        """A column of the folds of one split."""
        letter = column_letters(self.FOLD_NAMES.index(name) + 1)
        folds = [int(values.max()) + 1 for values in self.example.splits]
        begin = FIRST if split == "session" else FIRST + folds[0]
        end = begin + (folds[0] if split == "session" else folds[1]) - 1
        return f"Folds!${letter}${begin}:${letter}${end}"

    def _count(self, name: str, formula: str, row: int, column: int) -> None:
        labels = {"gross": "gross rows", "values": "measured values that count"}
        self.book.put("Weights", row, column, [labels[name], formula])
        self.results[name] = Address("Weights", row, column + 1)

    def _scale(self, sheet: str, column: int, values: dict[str, str], weights: dict[str, str]) -> dict[str, Address]:
        """Huber's proposal 2 by iteration, what is beyond 4 standard deviations being dropped after each pass."""
        self.book.put(sheet, 2, column, ["robust scale, step", *values], bold=True)
        for place, (x, d) in enumerate(values.items(), start=column + 1):
            letter, w = column_letters(place), weights[x]
            row = FIRST
            kept = "1"
            for number in range(PASSES):
                start = (
                    f"=SQRT(SUMPRODUCT({w}*{kept},{d}^2)/SUMPRODUCT({w}*{kept}))"
                    if number == 0
                    else f"={letter}{row - 1}"
                )
                self.book.put(sheet, row, place, [start])
                for step in range(STEPS):
                    s = f"{letter}{row + step}"
                    below = f"({d}^2<{WINSORIZED**2:g}*{s}^2)"
                    clipped = f"({below}*{d}^2/{s}^2+(1-{below})*{WINSORIZED**2:g})"
                    mean = f"SUMPRODUCT({w}*{kept},{clipped})/SUMPRODUCT({w}*{kept})"
                    self.book.put(sheet, row + step + 1, place, [f"={s}*SQRT({mean}/{WINSORIZED_MEAN_SQUARE})"])
                row += STEPS + 1
                kept = f"({d}^2<={TRIMMED**2:g}*{letter}${row - 1}^2)"
        for step in range(PASSES * (STEPS + 1)):
            self.book.put(sheet, FIRST + step, column, [float(step)])
        end = FIRST + PASSES * (STEPS + 1) - 1
        return {x: Address(sheet, end, place) for place, x in enumerate(values, start=column + 1)}
