"""The path arguments of all commands, checked in one place: none is empty, and none is a folder where a file is due."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum, auto
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

from compd.errors import CompdError, Problem
from compd.files import folder_problem

_ROOT = Path("/")


class PathKind(Enum):
    """What a parameter names; an annotation beside typer's. A parameter of type Path without one names a file."""

    FILE = auto()
    FOLDER = auto()
    # a file, a folder, or a pattern of files
    ANY = auto()
    # a text: a file, or the name of something else, such as a driver or a socket
    NAME_OR_FILE = auto()


class PathParameter(NamedTuple):
    """A path parameter of a command: its name in the code, kind, and help."""

    name: str
    kind: PathKind
    help: str


def path_parameters(command: Callable[..., Any]) -> Iterator[PathParameter]:
    """The path parameters of a command's function, which are of type Path or annotated with a PathKind."""
    function = inspect.unwrap(command)
    for name, hint in get_type_hints(function, include_extras=True).items():
        extras = getattr(hint, "__metadata__", ())
        kind = next((extra for extra in extras if isinstance(extra, PathKind)), None)
        if kind is None and Path in _types_in(hint):
            kind = PathKind.FILE
        if kind is not None and name != "return":
            yield PathParameter(name, kind, next((e.help for e in extras if getattr(e, "help", None)), ""))


def check_paths(command: Callable[..., Any], values: Mapping[str, Any], typed: Sequence[str]) -> None:
    """Raise CompdError with every path among a command's values that cannot be what the command wants.

    values : by parameter. typed : the words of the command line; a Path no longer tells "" from ".".
    """
    has_empty = any(word == "" or (word.startswith("--") and word.endswith("=")) for word in typed)
    defaults = {name: p.default for name, p in inspect.signature(inspect.unwrap(command)).parameters.items()}
    pairs = [
        (parameter, each)
        for parameter in path_parameters(command)
        for each in _each(values.get(parameter.name))
        if each != defaults[parameter.name] or isinstance(each, Path)
    ]
    if problems := [problem for pair in pairs if (problem := _problem(*pair, has_empty))]:
        raise CompdError(problems)


def _each(value: Any) -> list[Path | str]:
    """The values of a parameter: of one that may be repeated all of them, of one that was left out none."""
    return list(value) if isinstance(value, list | tuple) else [] if value is None else [value]


def _problem(parameter: PathParameter, value: Path | str, has_empty: bool) -> Problem | None:
    path, name = Path(value), parameter.name.removesuffix("_file").upper()
    if not path.parts and (value == "" or has_empty):
        return Problem(f"{name}: ''", "is empty", allowed=parameter.help, next_step="give it, or leave it out")
    where = f"{name}: {str(value)!r}"
    if parameter.kind in (PathKind.FOLDER, PathKind.ANY):
        if path == _ROOT:
            what = "is the root of the file system"
        elif parameter.kind is PathKind.FOLDER and path.is_file():
            what = "is a file, not a folder"
        else:
            return None
        return Problem(where, what, allowed=parameter.help, next_step="give a folder of its own")
    if parameter.kind is PathKind.NAME_OR_FILE and path.name and "/" not in str(value):
        return None  # the name of a driver or page, though a folder may have it too
    return folder_problem(path, where, parameter.help)


def _types_in(hint: Any) -> set[Any]:
    """All types in an annotation: those of `Annotated[list[Path] | None, ...]` are list, Path and None."""
    return {hint} | {inner for part in get_args(hint) for inner in _types_in(part)}
