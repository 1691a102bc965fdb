"""The import contract of the packages' faces, which `lint-imports` checks; pyproject.toml names it as type `faces`."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output

from tests.support.paths import ROOT


class FaceContract(Contract):
    """A package is entered by the names of its `__init__` alone.

    A package is a folder directly below `root`, and within the folders of `nested` each of theirs. A module of another
    package imports from the package itself, or from a module that the package's `__init__.pyi` exports as a module.
    The files of a folder in `plugin_folders` are found by their names and may be imported each.
    """

    root = fields.StringField()
    nested = fields.ListField(subfield=fields.StringField())
    plugin_folders = fields.ListField(subfield=fields.StringField(), required=False)

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        around = sorted(
            (importer, imported)
            for importer in graph.modules
            for imported in graph.find_modules_directly_imported_by(importer)
            if self._goes_around(importer, imported)
        )
        return ContractCheck(kept=not around, metadata={"around": around})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for importer, imported in check.metadata["around"]:
            face = self._package(imported)
            output.print_error(f"{importer} imports {imported}: import the name from {face}, or export it there")

    def _goes_around(self, importer: str, imported: str) -> bool:
        package = self._package(imported)
        folder = imported.rpartition(".")[0]
        return (
            package not in (None, imported, self._package(importer))
            and folder not in set(self.plugin_folders or ())
            and imported not in _exported_modules(package)
            and importer != self.root
        )

    def _package(self, module: str) -> Any:
        """The package that a module is in; None for a module that is in none."""
        parts = module.split(".")
        depth = 3 if ".".join(parts[:2]) in set(self.nested) and len(parts) > 2 else 2
        for length in (depth, 2):
            name = ".".join(parts[:length])
            if parts[0] == self.root and (_folder(name) / "__init__.py").is_file():
                return name
        return None


def _folder(package: str) -> Path:
    return ROOT.joinpath(*package.split("."))


def _exported_modules(package: str) -> set[str]:
    stub = _folder(package) / "__init__.pyi"
    if not stub.is_file():
        return set()
    froms = (node for node in ast.parse(stub.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom))
    return {f"{package}.{alias.name}" for node in froms if node.module is None for alias in node.names}
