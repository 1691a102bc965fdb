"""Options that several commands share, declared once: a parameter that is a `NamedTuple` stands for its fields."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import typer

from compd.cli.options import OverwriteOption


class PageOptions(NamedTuple):
    """The page that a command writes beside what it prints."""

    html: Annotated[Path | None, typer.Option("--html", help="Write the page with pictures; works offline.")] = None
    overwrite: OverwriteOption = False

    def check(self) -> None:
        """Raise CompdError unless the page may be written."""
        if self.html is not None:
            from compd.report import check_page_path

            check_page_path(self.html, self.overwrite)


def with_groups(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command with the fields of each `NamedTuple` among its parameters as parameters of its own, for typer."""
    hints = get_type_hints(command, include_extras=True)
    groups = {name: hint for name, hint in hints.items() if hasattr(hint, "_fields")}
    parameters = []
    for name, parameter in inspect.signature(command).parameters.items():
        group = groups.get(name)
        fields, defaults = {name: hints[name]}, {name: parameter.default}
        if group is not None:
            fields = get_type_hints(group, include_extras=True)
            defaults = group._field_defaults if parameter.default is parameter.empty else parameter.default._asdict()
        for field, hint in fields.items():
            default = defaults.get(field, parameter.empty)
            parameters.append(inspect.Parameter(field, parameter.KEYWORD_ONLY, default=default, annotation=hint))

    @functools.wraps(command)
    def grouped(**values: Any) -> Any:
        made = {name: group(*(values.pop(field) for field in group._fields)) for name, group in groups.items()}
        return command(**values, **made)

    del grouped.__wrapped__  # its parameters are not those of typer
    grouped.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    vars(grouped)["__signature__"] = inspect.Signature(parameters)
    return grouped
