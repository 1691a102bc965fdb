"""Results as tables: a pandas data frame to compute with, and a piece of HTML that a notebook shows.

A table is a mapping of column names to values, one per row, all columns equally long. Names end in the unit; a number
that is not known is nan. Example::

    >>> print(html_table("At the floor.", {"axis": ["x"], "rms_um": [0.1512345]}).count("<tr"))
    2
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, TypeAlias

from numpy.typing import NDArray

from compd.errors import CompdError
from compd.extras import install_line

if TYPE_CHECKING:
    import pandas as pd

Columns: TypeAlias = Mapping[str, Sequence[Any] | NDArray[Any]]

# More rows than this are not shown in a notebook; the data frame has all.
MAX_ROWS = 12
# Lines in a grey that is seen on white and on black: notebooks have both.
_ROW = '<tr style="border-bottom:1px solid rgba(128,128,128,.4);vertical-align:top">'


def data_frame(columns: Columns) -> pd.DataFrame:
    """The table as a pandas data frame. Raises CompdError where pandas is not installed."""
    try:
        import pandas as pd
    except ImportError as error:
        raise CompdError.of("to_dataframe", "pandas is not installed", next_step=install_line("notebook")) from error
    return pd.DataFrame(dict(columns))


def html_table(verdict: str, columns: Columns, remarks: Iterable[str] = ()) -> str:
    """HTML that stands by itself: the verdict, then the table, then a line for each remark. All texts are escaped."""
    rows = list(zip(*columns.values(), strict=True))
    head = "".join(_cell("th", name, numeric=_is_numeric(values)) for name, values in columns.items())
    body = "".join(
        _ROW + "".join(_cell("td", _text(value), numeric=_is_number(value)) for value in row) + "</tr>"
        for row in rows[:MAX_ROWS]
    )
    table = (
        '<table style="border-collapse:collapse;font-variant-numeric:tabular-nums">'
        f"<thead>{_ROW}{head}</tr></thead><tbody>{body}</tbody></table>"
    )
    more = [f"{len(rows) - MAX_ROWS} more rows; to_dataframe() has all of them"] if len(rows) > MAX_ROWS else []
    return (
        f'<div style="overflow-x:auto"><p style="max-width:50em"><strong>{escape(verdict)}</strong></p>'
        + (table if rows else "")
        + "".join(f'<p style="max-width:50em;margin:.3em 0">{escape(remark)}</p>' for remark in [*more, *remarks])
        + "</div>"
    )


def _cell(tag: str, text: str, *, numeric: bool) -> str:
    side = "right" if numeric else "left"
    return f'<{tag} style="padding:.2em .8em .2em 0;text-align:{side}">{escape(text)}</{tag}>'


def _is_number(value: Any) -> bool:
    return hasattr(value, "__float__") and not isinstance(value, bool)


def _is_numeric(values: Iterable[Any]) -> bool:
    return all(map(_is_number, values))


def _text(value: Any) -> str:
    """A cell: four digits of a number, a dash where nothing is known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "\N{EN DASH}"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e9 else f"{value:.4g}"
