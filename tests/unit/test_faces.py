"""The faces of the packages: every name is there, none exports too many, and the contract sees who goes around one."""

from __future__ import annotations

import ast
from importlib import import_module

import pytest
from grimp import ImportGraph

from tests.support.face_contract import FaceContract
from tests.support.paths import ROOT

MAX_NAMES = 30
STUBS = sorted((ROOT / "compd").rglob("__init__.pyi"))


def package_of(stub: object) -> str:
    return ".".join(stub.parent.relative_to(ROOT).parts)  # type: ignore[attr-defined]


PACKAGES = [package_of(stub) for stub in STUBS]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_of_a_face_is_there_and_there_are_not_too_many(package: str) -> None:
    face = import_module(package)
    stub = ast.parse((ROOT.joinpath(*package.split(".")) / "__init__.pyi").read_text(encoding="utf-8"))
    names = sorted(alias.name for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names)
    assert face.__all__ == names == sorted(set(names))
    assert len(names) <= MAX_NAMES
    for name in names:
        assert getattr(face, name) is not None


def broken(*edges: tuple[str, str]) -> list[tuple[str, str]]:
    graph = ImportGraph()
    for importer, imported in edges:
        for module in (importer, imported):
            if module not in graph.modules:
                graph.add_module(module)
        graph.add_import(importer=importer, imported=imported)
    options = {
        "root": "compd",
        "nested": ["compd.live", "compd.model"],
        "plugin_folders": ["compd.model.kernels.effects"],
    }
    contract = FaceContract("faces", {}, options)
    return list(contract.check(graph, verbose=False).metadata["around"])


@pytest.mark.parametrize(
    ("importer", "imported"),
    [
        ("compd.cli.app", "compd.recording.recording"),
        ("compd_drivers.modbus", "compd.lines.stream"),
        ("compd.live.loop.loop", "compd.live.memory.latest"),
        ("compd.live.daemon", "compd.live.loop.loop"),
        ("compd.model.machine", "compd.model.kernels.compensation"),
        ("compd.machine_check", "compd.configuration.geometry"),
    ],
)
def test_an_import_around_a_face_breaks_the_contract(importer: str, imported: str) -> None:
    assert broken((importer, imported)) == [(importer, imported)]


def test_an_import_of_a_face_of_a_neighbour_or_of_an_exported_module_keeps_it() -> None:
    assert not broken(
        ("compd.cli.app", "compd.recording"),
        ("compd.recording.reader", "compd.recording.recording"),
        ("compd.live.loop.loop", "compd.live.memory"),
        ("compd.cli.app", "compd.units"),
        ("compd.model.formula.program", "compd.model.kernels.formula"),
        ("compd.model.library.link", "compd.model.kernels.effects.link"),
    )
