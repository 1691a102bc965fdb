"""The verdict: what each effect gains in blocks of rows, scores, and the word."""

from __future__ import annotations

from docs.worked_example.sheets import FIRST, SETS, Sheets
from docs.worked_example.spreadsheet import Address


def write_blocks(sheets: Sheets) -> None:
    """Gains summed over blocks of neighbouring rows."""
    count = int(sheets.example.block.max()) + 1
    gains = ["gain of a", "gain of b", "c less a"]
    keys = sheets.column("Rows", "block")
    columns: list[list[float | str]] = [[float(block) for block in range(1, count + 1)]]
    for name in gains:
        values = sheets.column("Sums", name)
        columns.append([f"=SUMIF({keys},A{k},{values})" for k in range(FIRST, FIRST + count)])
    about = "Squares gained on rows left out, summed over each block; divided by the number of values: gain and error"
    sheets.table("Blocks", about, ["block", *gains], zip(*columns, strict=True))
    last = FIRST + count - 1
    values = sheets.results["values"]
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
        sheets.book.put("Blocks", last + 2 + k, 1, [label, *cells])
    for index, name in enumerate(("a", "b", "c"), start=2):
        sheets.results[f"gain_{name}"] = Address("Blocks", last + 2, index)
        sheets.results[f"std_{name}"] = Address("Blocks", last + 3, index)


def write_verdict(sheets: Sheets) -> None:
    """Scores, what each member is worth, the rival, and the word."""
    price, number_price = sheets.criteria["effect_price"], sheets.criteria["number_price"]
    counts = {name: candidate.parameter_count for name, candidate in zip("abc", sheets.example.candidates, strict=True)}
    head = ["set", "loss L", "log of the loss, not below 0", "prices", "score"]
    sheets.book.put("Verdict", 1, 1, head, bold=True)
    for k, (name, members) in enumerate(SETS.items(), start=2):
        further = sum(counts[member] - 1 for member in members)
        logarithm, prices = f"=LN(MAX(B{k},1))", f"={len(members)}*{price}+{further}*{number_price}"
        sheets.book.put("Verdict", k, 1, [name, f"={sheets.results[f'loss_{name}']}", logarithm, prices, f"=C{k}+D{k}"])
        sheets.results[f"score_{name}"] = Address("Verdict", k, 5)
    sheets.book.put("Verdict", 8, 1, ["question", "number", "limit", "answer"], bold=True)
    sigmas, at_floor = sheets.criteria["least_sigmas"], sheets.criteria["most_at_floor"]
    rival_share = sheets.criteria["rival_share"]
    # for an effect with more numbers the price is no excuse
    ratio = {m: f"{sheets.results[f'gain_{m}']}/{sheets.results[f'std_{m}']}" for m in "abc"}
    questions = [
        ("a: log loss falls by", "=C2-C3", f"={price}", ">="),
        ("a: gain in standard errors", f"={ratio['a']}", f"={sigmas}", ">="),
        ("b beside a: log loss falls by", "=C3-C4", f"={price}", ">="),
        ("b beside a: gain in standard errors", f"={ratio['b']}", f"={sigmas}", ">="),
        ("c for a: log loss rises by", "=C5-C3", f"=IF({counts['c']}<={counts['a']},{price},0)", "<="),
        ("c for a: loss rises by, in standard errors", f"={ratio['c']}", f"={sigmas}", "<="),
        ("c for a: misses this share of what a takes", "=(B5-B3)/(B2-B3)", f"={rival_share}", "<="),
        ("set a: its loss", "=B3", f"={at_floor}", "<="),
    ]
    for row, (question, number, limit, comparison) in enumerate(questions, start=9):
        answer = f'=IF(B{row}{comparison}C{row},"yes","no")'
        sheets.book.put("Verdict", row, 1, [question, number, limit, answer])
    yes = {name: f'D{row}="yes"' for name, row in zip("ABCDEFGH", range(9, 17), strict=True)}
    rows = {
        "a is needed": f'=IF(AND({yes["A"]},{yes["B"]}),"yes","no")',
        "b is needed beside a": f'=IF(AND({yes["C"]},{yes["D"]}),"yes","no")',
        "c is a rival of a": f'=IF(AND(OR({yes["E"]},{yes["F"]}),{yes["G"]}),"yes","no")',
        "verdict": '=IF(D9="no",IF(B2<=C16,"adequate","unexplained"),IF(D16="no","partial",'
        'IF(B20="yes","ambiguous","identified")))',
    }
    for row, (name, formula) in enumerate(rows.items(), start=18):
        sheets.book.put("Verdict", row, 1, [name, formula], bold=name == "verdict")
    sheets.results["verdict"] = Address("Verdict", 21, 2)
