"""A workbench whose process has ended: opened again from its files, and browsers go on where they were."""

from __future__ import annotations

import pytest

from compd.api import add_effect
from compd.page.workbench.workbench import Workbench
from tests.support.measured import gauges, hidden, record


@pytest.fixture
def path(tmp_path):
    return record(tmp_path, gauges(120, 1), [hidden("link_expansion", 2.0)])


def test_with_the_same_files_it_has_the_same_revision(path, tmp_path):
    before = Workbench(path, tmp_path / "a.model.yaml", None)
    before.exclude([10], "fog", before.revision)
    again = Workbench(path, tmp_path / "a.model.yaml", None, before.kept)
    assert again.revision == before.revision
    assert again.make("add", "link_expansion", before.revision)["revision"] == before.revision + 1


def test_with_other_files_a_browser_is_told_that_it_shows_what_was(path, tmp_path):
    model = tmp_path / "a.model.yaml"
    before = Workbench(path, model, None)
    add_effect(None, "link_expansion", path).write(model)
    again = Workbench(path, model, None, before.kept)
    assert again.revision == before.revision + 1


def test_the_libraries_that_were_chosen_are_chosen_again(path, tmp_path):
    library = tmp_path / "x.effects.yaml"
    library.write_text(
        "{id: swelling, port: link, formula: k * temperature_room,"
        " parameters: {k: {unit: um, plausible: [0, 1], source: s}}}"
    )
    before = Workbench(path, tmp_path / "a.model.yaml", None)
    before.use_libraries([str(library)])
    again = Workbench(path, tmp_path / "a.model.yaml", None, before.kept)
    assert again.sources.libraries == [str(library)]
    assert again.revision == before.revision
    library.write_text("{id: swelling}")
    with_a_mistake = Workbench(path, tmp_path / "a.model.yaml", None, before.kept)
    assert with_a_mistake.sources.libraries == []
    assert with_a_mistake.revision == before.revision + 1
