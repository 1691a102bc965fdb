"""Line kinds: each is one folder that is found, and no list of them leaves one out."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import compd.lines.kinds
from compd.configuration import json_schema
from compd.errors import ConfigurationError
from compd.gauge import Gauge
from compd.gauge_tools.open_gauge import line_settings
from compd.lines.line_definition import PolledDefinition, PushedDefinition
from compd.lines.open import KINDS, definition_of, kinds_that_carry
from compd.lines.port_arguments import PortArguments
from compd.plugins import GAUGES, load, names
from docs.generate import configuration as configuration_page
from docs.generate import gauges as gauges_page
from tests.support.paths import CONFIG, ROOT
from tests.unit.docs.test_paths import pages

FOLDER = Path(compd.lines.kinds.__path__[0])
# By people, not by a program: a list of kinds there has to be completed by hand.
WRITTEN = [*pages(), *sorted((ROOT / "drivers").rglob("*.md"))]


def port(kind: str) -> PortArguments:
    return PortArguments(KINDS[kind].example_port, 9600, "8N1", 0.1, [f"kind={kind}"])


def test_every_folder_is_a_kind() -> None:
    folders = {path.parent.name for path in FOLDER.glob("*/*.py")}
    assert set(KINDS) == folders


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_has_what_all_others_ask_of_it(kind: str) -> None:
    definition = KINDS[kind]
    settings = line_settings(port(kind), definition.carries)
    assert isinstance(settings, definition.settings)
    assert definition_of(settings) is definition
    assert settings.address
    assert (definition.carries in ("bytes", "registers")) is isinstance(definition, PolledDefinition)
    if isinstance(definition, PolledDefinition):
        assert definition.pace(settings, 0.01).exchange_s(1, 1) >= 0.01
        assert "silent" in definition.twin.damages
    else:
        assert isinstance(definition, PushedDefinition)


def test_no_two_kinds_claim_a_port() -> None:
    """Of those that carry the same; without `kind=`, a port is one of the kind whose example it is, or of the first."""
    for definition in KINDS.values():
        alike = kinds_that_carry(definition.carries)
        claiming = [kind for kind in alike if kind.claims(definition.example_port)]
        assert claiming in ([], [definition])
        plain = PortArguments(definition.example_port, 9600, "8N1", 0.1)
        assert line_settings(plain, definition.carries).kind == (claiming or alike)[0].kind


def test_a_library_that_a_kind_needs_is_an_extra() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for definition in KINDS.values():
        if definition.library is not None:
            assert any(definition.library.package in requirement for requirement in extras[definition.library.extra])


def test_the_registry_loads_neither_a_library_nor_a_twin() -> None:
    """A daemon with serial lines alone must not wait for asyncua; `compd check` of such a machine neither."""
    heavy = ("asyncua", "paho", "pymodbus", "serial", "compd.twins", "compd.probes", "compd.lines.stream")
    code = f"import compd.lines.open, sys; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_the_json_schema_has_every_kind() -> None:
    lines = json_schema()["properties"]["lines"]["additionalProperties"]
    assert set(lines["discriminator"]["mapping"]) == set(KINDS)
    assert len(lines["oneOf"]) == len(KINDS)


def test_the_reference_has_every_kind() -> None:
    keys, gauges = configuration_page.page(), gauges_page.page().partition("## ")[0]
    for kind in KINDS:
        assert f"(kind: {kind})" in keys
        assert f"`{kind}`" in gauges


def test_an_unknown_kind_is_answered_with_all_of_them(tmp_path: Path) -> None:
    text = (CONFIG / "tripod-cmm.yaml").read_text(encoding="utf-8")
    (tmp_path / "machine.yaml").write_text(text.replace("kind: serial", "kind: carrier_pigeon", 1), encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        compd.configuration.load(tmp_path / "machine.yaml")
    (problem,) = [problem for problem in caught.value.problems if "lines.scale_1" in problem.where]
    assert re.findall(r"\w+", problem.allowed) == list(KINDS)


@pytest.mark.parametrize("carries", dict.fromkeys(kind.carries for kind in KINDS.values()))
def test_a_gauge_on_a_line_that_carries_something_else_is_told_every_kind_for_it(tmp_path: Path, carries: str) -> None:
    driver = next(name for name in names(GAUGES) if _sampled(load(GAUGES, name, name), carries))
    other = next(kind for kind in KINDS.values() if kind.carries != carries)
    text = (CONFIG / "tripod-cmm.yaml").read_text(encoding="utf-8")
    settings = line_settings(port(other.kind), other.carries).model_dump(mode="json", exclude_unset=True)
    options = json.dumps({**(load(GAUGES, driver, driver).sample_options or {}), "driver": driver, "line": "tried"})
    text = text.replace("\nlines:\n", f"\nlines:\n  tried: {json.dumps(settings)}\n", 1)
    text = text.replace("\ngauges:\n", f"\ngauges:\n  tried: {options}\n", 1)
    (tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        compd.configuration.load(tmp_path / "machine.yaml")
    (problem,) = [problem for problem in caught.value.problems if "needs a line" in problem.what]
    assert set(re.findall(r"\w+", problem.allowed)) - {"kind", "or"} == {k.kind for k in kinds_that_carry(carries)}


def _sampled(driver: type[Gauge], carries: str) -> bool:
    return driver.line_kind == carries and driver.sample_options is not None


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_list_of_kinds_in_a_page_is_complete(page: Path) -> None:
    """Two kinds that carry the same, named in one paragraph, are a list of those."""
    for paragraph in paragraphs(page.read_text(encoding="utf-8")):
        named = {kind for kind in KINDS if f"`{kind}`" in paragraph}
        for carries in {KINDS[kind].carries for kind in named}:
            alike = {kind.kind for kind in kinds_that_carry(carries)}
            if len(named & alike) > 1:
                assert alike <= named, paragraph


def paragraphs(text: str) -> Iterator[str]:
    """Without the blocks of code."""
    yield from re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL).split("\n\n")
