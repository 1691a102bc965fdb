"""Effects of one's own: YAML files of formulas, Python files, directories of both, and those that come with compd."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from compd.configuration import shipped_effects
from compd.documents import Document, read_entries, unknown_key
from compd.errors import CompdError, ConfigurationError, PluginError, Problem
from compd.files import FileKind
from compd.model.effects import Effect
from compd.model.formula import FormulaDeclaration, formula_effect
from compd.model.library import find_effect, load_library
from compd.plugins import load_module

YAML_SUFFIXES = (".yaml", ".yml")
SUFFIXES = (*YAML_SUFFIXES, ".py")
_KEY = "effects"
EFFECTS_FILE = FileKind(
    "a file of effects",
    frozenset({"id", "port", "formula", "parameters"}),
    least=2,
    others=frozenset(FormulaDeclaration.model_fields),
    next_step="see the guide `Add an effect`",
    listed_under=_KEY,
)


def load_effects(source: str | Path) -> dict[str, Effect]:
    """Load effects of one's own, to be tried beside those of the library.

    Parameters
    ----------
    source : str or Path
        A YAML file: a list of effects written as formulas, a mapping with that list under ``effects:``, or a single
        effect. A Python file: every `Effect` in it. A directory of such files. Or the name of a file that comes with
        compd for a kind of machine, such as ``"telescope"``.

    Returns
    -------
    dict
        The effects by id, each declared so that a model file can keep it.

    Raises
    ------
    ConfigurationError
        With every problem of every effect: file, line, key, value, what is allowed and what to do; where a Python file
        cannot be loaded.

    Examples
    --------
    >>> import compd
    >>> from pathlib import Path
    >>> _ = Path("growth.yaml").write_text('''
    ... - {id: ram_growth, port: reference, axis: z, formula: "k * (temperature_ram_degC - 20)",
    ...    parameters: {k: {unit: um/K, plausible: [-12, 12], source: drawing of the ram}}}
    ... ''')
    >>> list(compd.load_effects("growth.yaml"))
    ['ram_growth']
    """
    path = _source_path(source)
    found: list[tuple[Effect, str]] = []
    problems: list[Problem] = []
    for file in _files_in(path) if path.is_dir() else [path]:
        try:
            found += [(effect, str(file)) for effect in _read_file(file)]
        except CompdError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    return _by_id(found)


def gather_effects(effects: str | Path | Effect | Sequence[Effect | str | Path]) -> dict[str, Effect]:
    """Effects and sources of effects together, by id. Raises as `load_effects`.

    One that has the id of an effect of the library takes its place.
    """
    found: list[tuple[Effect, str]] = []
    for part in [effects] if isinstance(effects, str | Path | Effect) else effects:
        if isinstance(part, Effect):
            found.append((part, f"effect {part.id}"))
        else:
            found += [(effect, str(part)) for effect in load_effects(part).values()]
    return _by_id(found)


def named_effect(name: str, where: str, given: Mapping[str, Effect] | None = None) -> Effect:
    """An effect as a person names it on the command line.

    name : an id; FILE.yaml that has one effect, or FILE.yaml:ID; FILE.py:NAME; or LIBRARY:ID of one that comes with
        compd.
    where : the place, for messages.  given : effects beside those of the library, by id.
    Raises CompdError where there is no such effect.
    """
    given = given or {}
    source, _, chosen = name.rpartition(":") if ":" in name else (name, "", "")
    if source.endswith(".py") and chosen:
        return find_effect(f"{Path(source).resolve()}:{chosen}", where)
    if name in given:
        return given[name]
    if not chosen and not _is_source(source):
        return find_effect(name, where, given)
    effects = load_effects(source)
    if not chosen and len(effects) == 1:
        return next(iter(effects.values()))
    if chosen not in effects:
        raise PluginError.of(
            where,
            "no such effect in this file" if chosen else "holds several effects: which one?",
            value=name,
            allowed=", ".join(effects),
            next_step=f"write {source}:{next(iter(effects))}",
        )
    return effects[chosen]


def _is_source(name: str) -> bool:
    """Whether a text names a file, a directory or a shipped file of effects, and no effect."""
    return "/" in name or name.endswith(SUFFIXES) or name in shipped_effects()


def _source_path(source: str | Path) -> Path:
    """The file or directory; of a name, the shipped file."""
    path = Path(source)
    if isinstance(source, Path) or "/" in source or path.suffix in SUFFIXES or path.is_dir():
        return path
    shipped = shipped_effects()
    if source not in shipped:
        raise ConfigurationError.of(
            "effects",
            "no file of effects of this name comes with compd",
            value=source,
            allowed=", ".join(shipped) or "none are installed",
            next_step="choose one of these, or give a file (NAME.yaml, NAME.py) or a directory",
        )
    return shipped[source]


def _files_in(directory: Path) -> list[Path]:
    files = sorted(path for path in directory.iterdir() if path.suffix in SUFFIXES)
    if not files:
        raise ConfigurationError.of(str(directory), "holds no file of effects", allowed="NAME.yaml or NAME.py")
    return files


def _read_file(path: Path) -> list[Effect]:
    """The effects of one file. Raises CompdError with every problem in it."""
    if path.suffix == ".py":
        return _python_effects(path)
    if path.suffix not in YAML_SUFFIXES:
        raise ConfigurationError.of(str(path), "is no file of effects", value=path.suffix, allowed=", ".join(SUFFIXES))
    document = read_entries(path, EFFECTS_FILE)
    problems = [unknown_key(document, (key,), [_KEY]) for key in document.data if key != _KEY]
    entries = document.data[_KEY]
    if isinstance(entries, dict):
        return [formula_effect(entries, str(path))]
    if not isinstance(entries, list | None):
        problems.append(Problem(document.where((_KEY,)), "is no list of effects", allowed="- id: ..."))
        raise ConfigurationError(problems)
    effects: list[Effect] = []
    for number, entry in enumerate(entries or ()):
        try:
            effects.append(_entry_effect(document, number, entry))
        except ConfigurationError as error:
            problems += error.problems
    if not effects and not problems:
        problems.append(Problem(str(path), "holds no effects", next_step="write one, or delete the file"))
    if problems:
        raise ConfigurationError(problems)
    return effects


def _entry_effect(document: Document, number: int, entry: object) -> Effect:
    where = document.where((_KEY, number))
    if not isinstance(entry, Mapping):
        raise ConfigurationError.of(where, "is no effect", allowed="a mapping: id, port, formula ...")
    return formula_effect(entry, where)


def _python_effects(path: Path) -> list[Effect]:
    """Every Effect in a Python file, declared as /absolute/file.py:NAME."""
    file = path.resolve()
    effects: dict[int, Effect] = {}
    for name, value in vars(load_module(file, str(path), "effect")).items():
        if isinstance(value, Effect) and id(value) not in effects:
            effects[id(value)] = value if value.declared else replace(value, declared=f"{file}:{name}")
    if not effects:
        raise PluginError.of(
            str(path),
            "holds no effect",
            allowed="objects of compd.Effect, each under a name of its own",
            next_step="see `An effect in Python` in the guide `Add an effect`",
        )
    return list(effects.values())


def beside_library(given: Mapping[str, Effect]) -> list[Effect]:
    """The effects of the library, then effects of one's own, which take the places of those with the same ids."""
    return list({**load_library(), **given}.values())


def _by_id(found: Iterable[tuple[Effect, str]]) -> dict[str, Effect]:
    """Effects by id, from effects with their places. Raises ConfigurationError for every id that is there already."""
    effects: dict[str, Effect] = {}
    places: dict[str, str] = {}
    problems: list[Problem] = []
    for effect, place in found:
        if effect.id in places:
            what = f"this id is taken, by {places[effect.id]}"
            step = "rename one of them"
            problems.append(Problem(place, what, value=effect.id, next_step=step))
        effects[effect.id] = effect
        places.setdefault(effect.id, place)
    if problems:
        raise ConfigurationError(problems)
    return effects
