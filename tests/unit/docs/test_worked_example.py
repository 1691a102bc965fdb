"""The spreadsheet of the worked example computes compd's own verdict, by formulas that follow their inputs."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from docs.worked_example.example import Example, make_example
from docs.worked_example.sheets import Sheets
from docs.worked_example.spreadsheet import Address, Spreadsheet, column_letters
from docs.worked_example.workbook import make_sheets

pytestmark = pytest.mark.long

MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"


@pytest.fixture(scope="module")
def example() -> Example:
    return make_example()


@pytest.fixture(scope="module")
def sheets(example: Example) -> Sheets:
    return make_sheets(example)


@pytest.fixture(scope="module")
def file(sheets: Sheets, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("worked-example") / "verdict.xlsx"
    sheets.save(path)
    return path


def stored(file: Path, address: Address, sheets: Sheets) -> tuple[str, str]:
    """(formula, value) of a cell as the file has them."""
    number = list(sheets.book.sheets).index(address.sheet) + 1
    with zipfile.ZipFile(file) as archive:
        page = ElementTree.fromstring(archive.read(f"xl/worksheets/sheet{number}.xml"))
    name = f"{column_letters(address.column)}{address.row}"
    (cell,) = (cell for cell in page.iter(f"{MAIN}c") if cell.get("r") == name)
    return cell.findtext(f"{MAIN}f", ""), cell.findtext(f"{MAIN}v", "")


def compd_numbers(example: Example) -> Iterator[tuple[str, float]]:
    losses, (a, b, c) = example.explanation.losses, example.members
    for axis, sigma_um in zip("xyz", example.problem.comparison.floor.by_axis_um, strict=True):
        yield f"sigma_{axis}", sigma_um
    sets = {"0": (), "a": (a,), "ab": (a, b), "c": (c,)}
    for name, subset in zip(sets, losses.evaluate(sets.values()), strict=True):
        yield f"loss_{name}", subset.cv_loss
        yield f"score_{name}", losses.score(subset)
    for name, gain in {
        "a": losses.gain((a,), ()),
        "b": losses.gain((a, b), (a,)),
        "c": losses.gain((a,), (c,)),
    }.items():
        yield f"gain_{name}", gain[0]
        yield f"std_{name}", gain[1]
    yield "theta", losses.estimates((a,))[0][0][0]
    yield "gross", float(example.problem.gross.sum())
    yield "values", float(losses.data.value_count)


def test_the_file_holds_compds_numbers_as_formulas(example: Example, sheets: Sheets, file: Path) -> None:
    numbers = dict(compd_numbers(example))
    assert set(numbers) | {"floor", "verdict"} == set(sheets.results)
    for name, number in numbers.items():
        formula, value = stored(file, sheets.results[name], sheets)
        assert formula, name
        assert float(value) == pytest.approx(number, rel=1e-6), name


def test_the_file_holds_the_verdict_of_the_diagnosis(example: Example, sheets: Sheets, file: Path) -> None:
    assert stored(file, sheets.results["verdict"], sheets)[1] == example.diagnosis.verdict
    unit_um = float(stored(file, sheets.results["floor"], sheets)[1])
    loss = float(stored(file, sheets.results["loss_a"], sheets)[1])
    assert unit_um * loss**0.5 == pytest.approx(example.diagnosis.heldout_after_um, rel=1e-6)


def test_the_verdict_follows_the_criteria() -> None:
    """A formula of a formula is computed anew when a number is changed."""
    book = Spreadsheet()
    book.put("Rows", 1, 1, [1.1, 1.25, '=IF(A1<=B1,"identified","partial")', "=LN(MAX(A1,1))^2"])
    assert book.value(Address("Rows", 1, 3)) == "identified"
    book.put("Rows", 1, 1, [2.0])
    assert book.value(Address("Rows", 1, 3)) == "partial"
    assert book.number(Address("Rows", 1, 4)) == pytest.approx(0.480453)


def test_ranges_and_other_sheets_are_read() -> None:
    book = Spreadsheet()
    book.put("Rows", 1, 1, [1.0, 2.0, 3.0])
    book.put("Rows", 2, 1, [4.0, 5.0, 6.0])
    book.put(
        "Sums", 1, 1, ["=SUMPRODUCT(Rows!$A$1:$C$1,Rows!A2:C2*(Rows!A2:C2>=5))", "=SUMIF(Rows!A1:C1,2,Rows!A2:C2)"]
    )
    book.put("Sums", 2, 1, ["=INDEX(Rows!A2:C2,MATCH(3,Rows!A1:C1,0))-Sums!B1"])
    assert [book.value(Address("Sums", 1, column)) for column in (1, 2)] == [28.0, 5.0]
    assert book.value(Address("Sums", 2, 1)) == 1.0
