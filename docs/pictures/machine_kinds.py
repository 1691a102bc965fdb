"""Draw the eight kinds of machine with their usual dimensions: `python -m docs.pictures.machine_kinds`."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from compd.configuration import load
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.report import machine_svg


def picture_path(kind: str) -> Path:
    """Where the picture of a kind is."""
    return Path(__file__).with_name(f"kind-{kind}.svg")


def draw(kind: str) -> str:
    """The picture of a kind as SVG, as `compd machine new` and `compd machine draw` make it."""
    with TemporaryDirectory() as directory:
        path = Path(directory) / f"{kind}.yaml"
        path.write_text(machine_text(kind, kind, KINDS[kind].usual), encoding="utf-8")
        configuration = load(path)
    return machine_svg(build_model(configuration.geometry, configuration.wiring), kind)


def main() -> None:
    """Write the pictures."""
    for kind in KINDS:
        picture_path(kind).write_text(draw(kind), encoding="utf-8")


if __name__ == "__main__":
    main()
