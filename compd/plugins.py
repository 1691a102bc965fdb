"""Drivers, their simulators and effects, found by entry point or by path: there is no central list.

Gauges that are pure description come from folders of presets, which packages offer in the group `compd.gauge_presets`:
each preset is a driver and a simulated device of its own name.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import re
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from compd.errors import PluginError
from compd.files import own_users, read_small_file, trust_problem

GAUGES = "compd.gauges"
SIMULATED_GAUGES = "compd.simulated_gauges"
GAUGE_PRESETS = "compd.gauge_presets"
EFFECTS = "compd.effects"
_KIND = {GAUGES: "driver", SIMULATED_GAUGES: "simulated device", EFFECTS: "effect"}
# Placeholder in a refusal for the hash of a file, which the reader computes.
HASH_PLACE = "HASH"
# Far above any hand-written file.
_MAX_CODE_BYTES = 10_000_000
_PATH = re.compile(r"^(?P<file>/.+\.py):(?P<name>[A-Za-z_]\w*)$")


class Code(Protocol):
    """Which Python files may be executed: OWN_CODE, NO_CODE, or those of a ListedCode."""

    def module(self, file: Path, where: str, kind: str) -> ModuleType:
        """The executed file.

        file : absolute.  where : the place that names it.  kind : what is sought in it, for messages.
        Raises PluginError where it may not be executed, or cannot be.
        """
        ...


class PresetFolder(Protocol):
    """What an entry point in `compd.gauge_presets` stands for: a folder of described gauges."""

    def names(self) -> list[str]:
        """Of all presets in it."""
        ...

    def driver(self, name: str) -> type:
        """The driver that the preset `name` describes. Raises PluginError for a description that cannot be used."""
        ...

    def simulated_device(self, name: str) -> type:
        """Its simulated device, from the same description."""
        ...


def names(group: str) -> list[str]:
    """Names that installed packages offer in `group`, presets among them, sorted."""
    return sorted({point.name for point in _entry_points(group)} | _preset_folders(group).keys())


def load(group: str, name: str, where: str, code: Code | None = None) -> Any:
    """What `name` stands for, a class or an effect: an entry point's name, a preset's, or /absolute/file.py:Name.

    code : which Python files may be executed; None is OWN_CODE.
    Raises PluginError, which names `where` and lists what there is, or every problem in a preset's file.
    """
    if match := _PATH.match(name):
        return _load_file(Path(match["file"]), match["name"], where, _KIND.get(group, group), code or OWN_CODE)
    points: dict[str, EntryPoint] = {point.name: point for point in _entry_points(group)}
    if name in points:
        return _load_point(points[name], where)
    folders = _preset_folders(group)
    if name in folders:
        return folders[name].driver(name) if group == GAUGES else folders[name].simulated_device(name)
    raise PluginError.of(
        where,
        f"no such {_KIND.get(group, group)}",
        value=name,
        allowed=", ".join(sorted(points.keys() | folders.keys())) or "none installed",
        next_step="choose one of these, or write /absolute/file.py:Name",
    )


def _entry_points(group: str) -> EntryPoints:
    return _entry_points_on(tuple(sys.path), group)


@cache
def _entry_points_on(path: tuple[str, ...], group: str) -> EntryPoints:
    """What packages on `path` offer in `group`. It takes 5 ms to look, and a configuration asks for every gauge."""
    return entry_points(group=group)


def _preset_folders(group: str) -> dict[str, PresetFolder]:
    """Every preset's name with the folder that holds it; of two with one name, the first package's counts."""
    if group not in (GAUGES, SIMULATED_GAUGES):
        return {}
    folders: dict[str, PresetFolder] = {}
    for point in _entry_points(GAUGE_PRESETS):
        folder: PresetFolder = _load_point(point, GAUGE_PRESETS)
        for name in folder.names():
            folders.setdefault(name, folder)
    return folders


def _load_point(point: EntryPoint, where: str) -> Any:
    try:
        return point.load()
    except (ImportError, AttributeError, SyntaxError) as error:
        raise PluginError.of(
            where,
            f"{point.value} cannot be loaded: {error}",
            value=point.name,
            next_step="reinstall the package that offers it",
        ) from error


def _load_file(file: Path, name: str, where: str, kind: str, code: Code) -> Any:
    module = code.module(file, where, kind)
    try:
        return getattr(module, name)
    except AttributeError as error:
        raise _unloadable(f"{file}:{name}", where, kind, error) from error


class _OwnCode:
    """A person's own files, for programs that a person starts: see `load_module`."""

    def module(self, file: Path, where: str, kind: str) -> ModuleType:
        return load_module(file, where, kind)


class _NoCode:
    """No file, for programs that do what somebody else asks for."""

    def module(self, file: Path, where: str, kind: str) -> ModuleType:
        raise PluginError.of(
            where,
            f"the {kind} is Python code, and this program executes no file",
            value=str(file),
            next_step="use it on the command line: `compd compare`, `compd diagnose`, `compd model`",
        )


OWN_CODE: Code = _OwnCode()
NO_CODE: Code = _NoCode()


class ListedCode:
    """Files that are listed with the SHA-256 of their content, wherever they are and whoever may write them.

    A file that is not listed is not opened. What is executed are the bytes whose hash was computed.
    """

    def __init__(self, files: Mapping[str, str], key: str = "`effects:`") -> None:
        """`files`: absolute path -> SHA-256 of the content, 64 small hexadecimal digits. `key`: of the configuration,
        under which they are listed."""
        self._files = dict(files)
        self._key = key

    def module(self, file: Path, where: str, kind: str) -> ModuleType:
        listed = self._files.get(str(file))
        if listed is None:
            raise PluginError.of(
                where,
                f"the {kind} is Python code that the machine configuration does not list",
                value=str(file),
                next_step="look at the file, then write under `effects:` of the configuration "
                f"`- {{file: {file}, sha256: {HASH_PLACE}}}` with the {HASH_PLACE} that `sha256sum {file}` prints, "
                "and let the daemon read its configuration anew (`systemctl reload compd`)",
            )
        try:
            content = read_small_file(file, _MAX_CODE_BYTES)
        except OSError as error:
            raise PluginError.of(
                where,
                f"cannot read the {kind}'s file: {error.strerror or error}",
                value=str(file),
                next_step="let the daemon's user read it",
            ) from error
        if (found := hashlib.sha256(content).hexdigest()) != listed:
            raise PluginError.of(
                where,
                f"the {kind}'s file has another content than the configuration lists",
                value=f"{file}: sha256 {found}",
                allowed=listed,
                next_step=f"look at what has changed, then write the new hash under {self._key} of the "
                "configuration, or restore the file",
            )
        module = ModuleType(_module_name(file))
        module.__file__ = str(file)
        sys.modules[module.__name__] = module
        try:
            exec(compile(content, str(file), "exec", dont_inherit=True), vars(module))
        except (Exception, SystemExit) as error:
            raise _unloadable(str(file), where, kind, error) from error
        return module


def hash_of_code(file: Path) -> str:
    """The hash with which a file is listed. Raises OSError where it cannot be read."""
    return hashlib.sha256(read_small_file(file, _MAX_CODE_BYTES)).hexdigest()


def _module_name(file: Path) -> str:
    """One name per path: its classes look their own module up by it (pydantic resolves annotations there)."""
    return "compd_file_" + re.sub(r"\W", "_", str(file))


def load_module(file: Path, where: str, kind: str) -> ModuleType:
    """Execute a person's own file; one that others may write could run anything as the daemon, and is refused.

    file : absolute.  kind : what is sought in it, for messages.  Raises PluginError, whatever the file's code does.
    """
    try:
        real = file.resolve(strict=True)
        problem = trust_problem(real, where, kind, own_users())
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of symbolic links
        why = getattr(error, "strerror", None) or str(error)
        raise PluginError.of(where, f"cannot read the {kind}'s file: {why}", value=str(file)) from error
    if problem is not None:
        raise PluginError(problem)
    module_name = _module_name(file)
    spec = importlib.util.spec_from_file_location(module_name, real)
    if spec is None or spec.loader is None or not real.is_file():
        raise PluginError.of(where, "not a Python file", value=str(file))
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        if not _uses_compd(real):  # some other file: an error's words may be a part of it
            other = ImportError(f"{type(error).__name__} in a file that is no Python or does not import compd")
            raise _unloadable(str(file), where, kind, other) from None
        raise _unloadable(str(file), where, kind, error) from error
    return module


def _uses_compd(file: Path) -> bool:
    """Whether a file is Python that imports compd, as every driver and effect does."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, RecursionError, MemoryError, OSError):
        return False
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom))
    names = (name for node in imports for name in (getattr(node, "module", None), *(part.name for part in node.names)))
    return any(name is not None and name.partition(".")[0] == "compd" for name in names)


def _unloadable(value: str, where: str, kind: str, error: BaseException) -> PluginError:
    name = "" if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: "
    return PluginError.of(where, f"the {kind}'s file cannot be loaded: {name}{error}", value=value)
