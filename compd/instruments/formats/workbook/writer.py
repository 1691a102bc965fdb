"""An Excel list: a title, an empty row, a header with units, and numbers; names or times before them."""

from __future__ import annotations

import io

from compd.instruments.samples import Samples


def write_workbook(samples: Samples) -> bytes:
    """The bytes of an .xlsx file with one sheet, `Measured`; time in s on the instrument's clock."""
    from openpyxl import Workbook

    workbook = Workbook(write_only=True)
    sheet = workbook.create_sheet("Measured")
    sheet.append(["Measured points" if samples.time_s is None else "Measured track"])
    sheet.append([])
    sheet.append(samples.header("time_s" if samples.time_s is not None else ""))
    times = None if samples.time_s is None else samples.time_s.tolist()
    for k, row in enumerate(samples.written_values.tolist()):
        before = [
            *([times[k]] if times is not None else []),
            *([samples.names[k]] if samples.names is not None else []),
        ]
        sheet.append([*before, *row])
    stream = io.BytesIO()
    workbook.save(stream)
    return stream.getvalue()
