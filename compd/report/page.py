"""A page that works offline: a verdict in words, then tables and figures. One file, no network.

Every page of compd (comparison, diagnosis, effect, ledger, demo, the paper's experiments) is `templates/page.html`
filled by `write_page`. Example::

    table = PageTable(("coordinate", "rms"), [("x", "0.31 um"), ("y", "0.28 um")])
    write_page(Path("page.html"), "My machine", "At the noise floor.", [Panel("In numbers", "", table)], "")
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup
from plotly.graph_objects import Figure
from plotly.io import templates, to_html
from plotly.offline import get_plotlyjs

from compd.files import check_directory, check_replaceable
from compd.release import __version__
from compd.report.page_table import PageTable
from compd.text import typeset

# Colours that stay apart for colour-blind readers (Okabe and Ito, 2008), in a fixed order of meaning.
COLOURS = {"worst": "#d55e00", "middle": "#e69f00", "best": "#009e73", "plain": "#0072b2", "quiet": "#8a8f98"}

# Disables Plotly 7's offer to upload a figure to its makers' site.
_PLOTLY_CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "showSendToCloud": False,
    "modeBarButtonsToRemove": ["select2d", "lasso2d", "autoScale2d"],
}

# Marks of a page of compd in its head: the generator; up to 0.2 the style of the text.
_PAGE_MARKS = (b'<meta name="generator" content="compd">', b'body { font: 16px/1.5 system-ui, "Segoe UI"')

# Colour of lines that are white in a dark theme, where the page's script changes it.
INK = "black"
# Plotly's template of every figure; in a dark theme the page's script replaces it.
TEMPLATE = "plotly_white"

# Name of plotly's script where pages share it.
SHARED_SCRIPT = "plotly.min.js"


@dataclass(frozen=True)
class PageText:
    """Verbatim lines, to be read or copied; the page's source keeps quotes and spaces, too."""

    text: str

    @property
    def html(self) -> Markup:
        """The text with HTML markup characters escaped."""
        return Markup(escape(self.text, quote=False))


@dataclass(frozen=True)
class Panel:
    """A heading, a sentence on how to read it, and a figure, several side by side, a table or lines of text."""

    title: str
    caption: str
    content: Figure | Sequence[Figure] | PageTable | PageText

    @property
    def figures(self) -> Sequence[Figure]:
        """The figures of the panel; empty for tables and text."""
        if isinstance(self.content, Figure):
            return [self.content]
        return [] if isinstance(self.content, PageTable | PageText) else self.content


def check_page_path(path: Path, overwrite: bool | None = None) -> None:
    """Raise CompdError if a page cannot be written; called before long work.

    overwrite : whether to write over a file that is no page of compd; another page is replaced in any case.
    """
    check_directory(path)
    check_replaceable(path, _PAGE_MARKS, "a page of compd", overwrite)


def write_page(
    path: Path, title: str, verdict: str | PageText, panels: Sequence[Panel], footer: str, shared_script: bool = False
) -> None:
    """Write the page to `path`; all texts are escaped. Its footer ends with the date and the release of compd.

    verdict : a sentence or two, or lines.
    shared_script : plotly's script (4.8 MB) is inside a page with figures, which is then a single file. True writes it
    to SHARED_SCRIPT beside the page instead, where all pages of a directory share it.
    """
    has_figure = any(panel.figures for panel in panels)
    if shared_script:
        path.with_name(SHARED_SCRIPT).write_text(get_plotlyjs(), encoding="utf-8")
    page = _template().render(
        title=title,
        verdict=PageText(typeset(verdict.text)).html if isinstance(verdict, PageText) else typeset(verdict),
        verdict_is_lines=isinstance(verdict, PageText),
        panels=[
            {
                "title": panel.title,
                "caption": panel.caption,
                "table": panel.content if isinstance(panel.content, PageTable) else None,
                "lines": panel.content.html if isinstance(panel.content, PageText) else None,
                "figures": [
                    _figure_html(figure, f"{number}-{k}" if k else str(number))
                    for k, figure in enumerate(panel.figures)
                ],
            }
            for number, panel in enumerate(panels)
        ],
        footer=f"{footer} Written on {datetime.now(UTC):%Y-%m-%d} by compd {__version__}.".strip(),
        figure_grounds=_figure_grounds() if has_figure else "",
        shared_script=SHARED_SCRIPT if shared_script and has_figure else "",
        plotly_script=get_plotlyjs() if has_figure and not shared_script else "",
    )
    path.write_text(page, encoding="utf-8")


def style_figure(figure: Figure, x: str, y: str, height_px: int = 340) -> Figure:
    """The figure in the common style: axis titles with units, quiet grid, legend on top."""
    figure.update_layout(
        template=TEMPLATE,
        height=height_px,
        margin={"l": 70, "r": 20, "t": 30, "b": 50},
        font={"family": "system-ui, DejaVu Sans, sans-serif", "size": 13},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        xaxis_title=x,
        yaxis_title=y,
    )
    return figure


@cache
def _figure_grounds() -> str:
    """The templates of figures for a light and a dark theme, as JSON for the page's script."""
    grounds = {"light": templates[TEMPLATE], "dark": templates["plotly_dark"]}
    return json.dumps({name: template.to_plotly_json() for name, template in grounds.items()})


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("compd.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["typeset"] = typeset
    return environment.get_template("page.html")


def _figure_html(figure: Figure, number: str) -> str:
    """The figure as an element of its own; plotly's script is in the page's head."""
    return str(
        to_html(
            _typeset(figure.to_dict()),
            full_html=False,
            include_plotlyjs=False,
            div_id=f"figure-{number}",
            config=_PLOTLY_CONFIG,
            validate=False,
        )
    )


def _typeset(part: Any) -> Any:
    """A figure's parts with every text as people read it; numbers, which may be coded as text, stay."""
    if isinstance(part, str):
        return typeset(part)
    if isinstance(part, Mapping):
        return {key: value if key == "bdata" else _typeset(value) for key, value in part.items()}
    if isinstance(part, list | tuple):
        return [_typeset(value) for value in part]
    if isinstance(part, np.ndarray) and part.dtype == object:
        return [_typeset(value) for value in part]
    return part
