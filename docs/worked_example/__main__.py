"""Make the worked example: `python -m docs.worked_example`."""

from __future__ import annotations

import shutil
from pathlib import Path

from docs.worked_example.example import make_example
from docs.worked_example.pictures import pictures
from docs.worked_example.workbook import make_sheets

# The page takes the pictures and the spreadsheet from here.
FOLDER = Path(__file__).parent.parent / "_build" / "worked-example"
SPREADSHEET = "verdict.xlsx"


def main() -> None:
    """Write the spreadsheet and the pictures."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    example = make_example()
    sheets = make_sheets(example)
    sheets.save(FOLDER / SPREADSHEET)
    for name, svg in pictures(example, sheets).items():
        (FOLDER / f"{name}.svg").write_text(svg, encoding="utf-8")
    print(f"worked example: {sheets.book.value(sheets.results['verdict'])}, {FOLDER / SPREADSHEET}")


if __name__ == "__main__":
    main()
