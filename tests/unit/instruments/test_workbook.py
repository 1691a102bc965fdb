"""Excel lists: exact numbers, dates, titles and units; whatever is ambiguous or broken is refused with the cell."""

from __future__ import annotations

import datetime
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from openpyxl import Workbook

from compd.errors import RecordingError
from compd.instruments.export import ReadOptions
from compd.instruments.formats.workbook import parts
from compd.instruments.formats.workbook.cells import cell_name
from compd.instruments.formats.workbook.reader import read_workbook
from compd.instruments.raw_table import RawTable
from compd.instruments.read_limits import ReadLimits

LIST = (("name", "X [mm]", "Y [mm]"), ("P1", 1.1, -2), ("P2", 1e-7, 0.1 + 0.2), ("P3", 123456.789, 4))


def book(tmp_path: Path, *sheets: Sequence[Sequence[Any]], titles: Sequence[str] = ("One", "Two", "Three")) -> Path:
    """A workbook as openpyxl writes it: formulas in it have no value, as a program leaves them."""
    workbook = Workbook()
    workbook.remove(workbook.active)
    for title, rows in zip(titles, sheets, strict=False):
        sheet = workbook.create_sheet(title)
        for row in rows:
            sheet.append(list(row))
    path = tmp_path / "list.xlsx"
    workbook.save(path)
    return path


def edit(path: Path, part: str, change: Callable[[str], str]) -> Path:
    """Change the text of one part of the archive."""
    with zipfile.ZipFile(path) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    contents[part] = change(contents[part].decode()).encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return path


def read(path: Path, **options: Any) -> RawTable:
    return read_workbook(path, ReadOptions(**options))


def refused(path: Path, **options: Any) -> str:
    with pytest.raises(RecordingError) as caught:
        read(path, **options)
    return str(caught.value)


def test_numbers_are_exact_and_lines_are_rows_of_the_sheet(tmp_path: Path) -> None:
    digits = ("<v>0.3</v>", "<v>0.30000000000000004</v>")  # Excel writes 17, the writer of this test 16
    path = edit(book(tmp_path, LIST), "xl/worksheets/sheet1.xml", lambda xml: xml.replace(*digits))
    table = read(path)
    assert table.header == ("name", "X [mm]", "Y [mm]")
    assert (table.shape, table.header_line, table.line.tolist()) == ("xlsx", 1, [2, 3, 4])
    assert [list(column) for column in table.columns] == [
        ["P1", "P2", "P3"],
        ["1.1", "1e-07", "123456.789"],
        ["-2", "0.30000000000000004", "4"],
    ]
    assert (table.decimal, table.unit) == (".", "")
    assert table.assumed["sheet"] == "'One'"


def test_titles_above_the_header_are_skipped_and_told(tmp_path: Path) -> None:
    above = (["Measured in hall 3"], ["operator", "A. Person"], ["temperature", 20.1, "degC"], [])
    table = read(book(tmp_path, (*above, *LIST)))
    assert (table.header_line, table.line.tolist()) == (5, [6, 7, 8])
    assert table.assumed["above the list"] == "rows 1 to 3, not read: 'Measured in hall 3' ..."


def test_a_row_of_units_belongs_to_the_names(tmp_path: Path) -> None:
    table = read(book(tmp_path, (("t", "X", "Y"), ("s", "[mm]", "\u00b5m"), (0.0, 1.0, 2.0), (1.0, 1.0, 2.0))))
    assert table.header == ("t [s]", "X [mm]", "Y [um]")
    assert table.assumed["units"] == "row 2, below the names"
    assert table.line.tolist() == [3, 4]


def test_a_list_without_a_header(tmp_path: Path) -> None:
    table = read(book(tmp_path, (("a note",), (1.0, 2.0), (3.0, 4.0))))
    assert (table.header, table.header_line, table.line.tolist()) == (None, 0, [2, 3])


def test_empty_rows_and_columns_are_passed_over(tmp_path: Path) -> None:
    rows = ((None, "x_mm", None, "y_mm"), (None, 1.0, None, 2.0), (), (None, 3.0, None, None), (None, 5.0, "", 6.0))
    table = read(book(tmp_path, rows))
    assert table.header == ("x_mm", "y_mm")
    assert [list(column) for column in table.columns] == [["1", "3", "5"], ["2", "", "6"]]
    assert table.line.tolist() == [2, 4, 5]


def test_the_header_again_is_counted_and_another_one_refused(tmp_path: Path) -> None:
    table = read(book(tmp_path, (*LIST, LIST[0], *LIST[1:])))
    assert table.left_out == {"the header again": 1}
    assert table.line.tolist() == [2, 3, 4, 6, 7, 8]
    other = ("name", "X [m]", "Y [m]")
    text = refused(book(tmp_path, (*LIST, *LIST[1:], other, *LIST[1:])))
    assert "sheet 'One', row 8: another header in the middle of the list" in text


def test_dates_become_iso_text(tmp_path: Path) -> None:
    moment = datetime.datetime(2026, 2, 10, 12, 58, 22, 250000)
    rows = (
        ("time", "day", "clock", "watch", "length_mm"),
        (moment, moment.date(), datetime.time(12, 58, 22, 125000), datetime.timedelta(hours=25, seconds=1.5), 0.5),
    )
    table = read(book(tmp_path, rows))
    assert [column[0] for column in table.columns] == [
        "2026-02-10T12:58:22.250",
        "2026-02-10T00:00:00.000",
        "12:58:22.125",
        "25:00:01.500",
        "0.5",
    ]
    assert "dates" in table.assumed


def test_several_sheets_with_numbers_are_asked_for(tmp_path: Path) -> None:
    path = book(tmp_path, LIST, (("only text",),), LIST[:3])
    text = refused(path)
    assert "2 sheets hold numbers\n    value: One, Three" in text
    assert "--sheet" in text
    assert read(path, sheet="Three").line.tolist() == [2, 3]
    assert read(path, sheet="Three").assumed["sheet"] == "'Three', of 3"
    assert "has no such sheet\n    value: Four\n    allowed: One, Two, Three" in refused(path, sheet="Four")
    assert "holds no number" in refused(path, sheet="Two")
    assert read(book(tmp_path, LIST, (("only text",),))).assumed["sheet"] == "'One', of 2"
    assert "no sheet holds a number" in refused(book(tmp_path, (("only text",),)))


def test_a_formula_counts_with_its_value_and_is_refused_without(tmp_path: Path) -> None:
    rows = (*LIST, ("P4", "=B2+1", 3.0), ("P5", 2.0, "=B3"))
    text = refused(book(tmp_path, rows))
    assert "sheet 'One', B5, C6: 2 cells with a formula without a value" in text
    with_values = edit(
        book(tmp_path, rows),
        "xl/worksheets/sheet1.xml",
        lambda xml: re.sub(r"(<f>[^<]*</f>)<v ?/>", r"\1<v>2.5</v>", re.sub(r"<v></v>", "<v />", xml)),
    )
    assert read(with_values).columns[1][-2:] == ["2.5", "2"]
    assert read(with_values).columns[2][-1] == "2.5"


def test_a_row_of_formulas_without_values_alone_is_not_lost(tmp_path: Path) -> None:
    assert "B5, C5" in refused(book(tmp_path, (*LIST, (None, "=B2", "=C2"))))


def test_errors_of_the_spreadsheet_are_refused_with_the_cell(tmp_path: Path) -> None:
    text = refused(book(tmp_path, (*LIST, ("P4", "#DIV/0!", 3.0), ("P5", 1.0, "#N/A"))))
    assert "sheet 'One', B5, C6: 2 cells with an error of the spreadsheet\n    value: #DIV/0!, #N/A" in text


def test_a_number_as_text_with_a_comma_is_never_guessed(tmp_path: Path) -> None:
    rows = (("x_mm", "y_mm"), ("1,250", 2.0), (1.5, "2.5"))
    text = refused(book(tmp_path, rows))
    assert "sheet 'One', A2: a number as text, whose comma may be a decimal or a thousands mark" in text
    table = read(book(tmp_path, rows), decimal=",")
    assert [list(column) for column in table.columns] == [["1.250", "1.5"], ["2", "2.5"]]


def test_merged_cells_in_the_list_are_refused_and_those_above_are_not(tmp_path: Path) -> None:
    workbook = Workbook()
    sheet = workbook.active
    for row in (["Positions"], *LIST):
        sheet.append(list(row))
    sheet.merge_cells("A1:C1")
    path = tmp_path / "merged.xlsx"
    workbook.save(path)
    assert read(path).line.tolist() == [3, 4, 5]
    sheet.merge_cells("A3:A4")
    workbook.save(path)
    assert "A3:A4: 1 merged cells in the list" in refused(path)


def test_old_excel_and_what_is_no_workbook(tmp_path: Path) -> None:
    old = tmp_path / "old.xls"
    old.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600))
    assert "an Excel before 2007 (.xls), or has a password" in refused(old)
    assert "save it as .xlsx" in refused(old)
    text = tmp_path / "list.xlsx"
    text.write_text("x,y\n1,2\n")
    assert "is no .xlsx file" in refused(text)
    assert "cannot be read: no such file" in refused(tmp_path / "none.xlsx")
    with zipfile.ZipFile(text, "w") as archive:
        archive.writestr("readme.txt", "no workbook")
    assert "it is an archive, and no workbook" in refused(text)


@pytest.mark.parametrize("kept", [0.2, 0.6, 0.9, 0.99])
def test_a_file_that_was_cut_off(tmp_path: Path, kept: float) -> None:
    path = book(tmp_path, LIST)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    assert "cannot be read as .xlsx" in refused(path)


def test_damaged_xml_and_entities_that_grow(tmp_path: Path) -> None:
    part = "xl/worksheets/sheet1.xml"
    assert "cannot be read as .xlsx" in refused(edit(book(tmp_path, LIST), part, lambda xml: xml[:-30]))
    bomb = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
    grown = f'<!DOCTYPE w [<!ENTITY a0 "1">{bomb}]>'
    path = edit(book(tmp_path, LIST), part, lambda xml: grown + xml.replace("<v>1.1</v>", "<v>&a9;</v>"))
    assert "cannot be read as .xlsx" in refused(path)


def test_a_file_that_unpacks_to_more_than_a_list_is_not_unpacked(tmp_path: Path) -> None:
    path = book(tmp_path, LIST)
    assert "is too large for a list of measurements" in refused(path, limits=ReadLimits(unpacked_bytes=1000))


def test_more_cells_than_are_allowed_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = book(tmp_path, LIST)
    message = refused(path, limits=ReadLimits(sheet_cells=5))
    assert "has too many" in message
    assert "5 cells in a sheet" in message
    assert "save the sheet as CSV" in message


def test_a_cell_far_away_is_refused_and_no_memory_filled(tmp_path: Path) -> None:
    far = '<row r="{row}"><c r="{cell}"><v>1</v></c></row></sheetData>'
    for row, cell in ((5, "XFD5"), (99_999_999, "A99999999")):
        path = edit(
            book(tmp_path, LIST),
            "xl/worksheets/sheet1.xml",
            lambda xml, row=row, cell=cell: xml.replace("</sheetData>", far.format(row=row, cell=cell)),
        )
        assert "is beyond what a list can have" in refused(path, sheet="One")


def test_the_size_that_a_file_states_is_not_believed(tmp_path: Path) -> None:
    wrong = edit(
        book(tmp_path, LIST),
        "xl/worksheets/sheet1.xml",
        lambda xml: re.sub(r'<dimension ref="[^"]*"', '<dimension ref="A1:A2"', xml),
    )
    assert len(read(wrong).columns) == 3


def test_names_of_cells() -> None:
    assert [cell_name(*cell) for cell in ((0, 1), (25, 2), (26, 3), (701, 4), (702, 5))] == [
        "A1",
        "Z2",
        "AA3",
        "ZZ4",
        "AAA5",
    ]


@pytest.mark.parametrize(
    ("attributes", "hidden"), [('hidden="1"', True), ('ht="0" customHeight="1"', True), ('ht="15"', False)]
)
def test_hidden_rows_are_told(tmp_path: Path, attributes: str, hidden: bool) -> None:
    def hide(text: str) -> str:
        return text.replace('<row r="3"', f'<row {attributes} r="3"').replace('<row r="4"', f'<row r="4" {attributes}')

    path = edit(book(tmp_path, LIST), "xl/worksheets/sheet1.xml", hide)
    table = read(path)
    assert table.line.tolist() == [2, 3, 4]
    if hidden:
        assert table.assumed["hidden rows"].startswith("2 rows between 3 and 4 are hidden")
    else:
        assert "hidden rows" not in table.assumed


@pytest.mark.parametrize("chunk", [131, 997, 4096])
def test_a_hidden_row_is_told_wherever_the_sheet_is_cut(
    tmp_path: Path, chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "_CHUNK", chunk)
    rows = [("name", "X [mm]"), *((f"P{k}", k + 0.5) for k in range(200))]
    hidden = set(range(2, 200, 7))

    def hide(text: str) -> str:
        return re.sub(r'<row r="(\d+)"', lambda match: match[0] + ' hidden="1"' * (int(match[1]) in hidden), text)

    table = read(edit(book(tmp_path, rows), "xl/worksheets/sheet1.xml", hide))
    assert table.assumed["hidden rows"].startswith(f"{len(hidden)} rows between 2 and {max(hidden)} are hidden")
