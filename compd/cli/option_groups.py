"""Options that several commands share, declared once: a parameter that is a `NamedTuple` stands for its fields."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints


def with_groups(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command with the fields of each `NamedTuple` among its parameters as parameters of its own, for typer."""
    hints = get_type_hints(command, include_extras=True)
    groups = {name: hint for name, hint in hints.items() if hasattr(hint, "_fields")}
    if not groups:
        return command
    parameters = []
    for name, parameter in inspect.signature(command).parameters.items():
        group = groups.get(name)
        inside = {} if group is None else get_type_hints(group, include_extras=True)
        for field, hint in (inside or {name: hints[name]}).items():
            default = parameter.default if group is None else group._field_defaults.get(field, parameter.empty)
            parameters.append(inspect.Parameter(field, parameter.KEYWORD_ONLY, default=default, annotation=hint))

    @functools.wraps(command)
    def grouped(**values: Any) -> Any:
        made = {name: group(*(values.pop(field) for field in group._fields)) for name, group in groups.items()}
        return command(**values, **made)

    del grouped.__wrapped__  # its parameters are not those of typer
    grouped.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    vars(grouped)["__signature__"] = inspect.Signature(parameters)
    return grouped
