"""Which model files the page offers, and what their names stand for."""

from __future__ import annotations

import os

import pytest

from compd.page.model_files import MOST, ModelFiles, opened


@pytest.fixture
def files(tmp_path):
    for name in ("my.model.yaml", "model.yaml", "tripod-cmm.yaml", "run-0001.model-4fab0ff7dace0f56.yaml", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "a.model.yaml").mkdir()
    return ModelFiles(tmp_path)


def names(files, models=None):
    return [entry["name"] for entry in files.listed(models)]


def test_model_files_of_the_directory_are_offered_and_nothing_else(files):
    assert names(files) == ["model.yaml", "my.model.yaml"]
    assert files.path_of("my.model.yaml") == files.directory / "my.model.yaml"


def test_what_the_daemon_runs_with_is_shown_wherever_it_is_and_offered_from_the_directory_alone(files):
    inside, outside = str(files.directory / "my.model.yaml"), "/elsewhere/my.model.yaml"
    models = {"applied": {"effects": ["backlash"], "file": inside}, "shadow": {"effects": [], "file": outside}}
    assert names(files, models) == ["model.yaml", "my.model.yaml", "shadow: my.model.yaml"]
    assert [entry["runs"] for entry in files.listed(models)] == ["", "applied", "shadow"]
    assert [entry["offered"] for entry in files.listed(models)] == [True, True, False]
    assert files.listed(models)[2]["changed"] is None, "the page does not look at it"
    assert files.path_of("shadow: my.model.yaml") is None


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../my.model.yaml", "tripod-cmm.yaml", "a.model.yaml", "my.model.yaml/"]
)
def test_no_other_name_is_a_file(files, name):
    assert files.path_of(name) is None


def test_a_link_a_path_and_what_is_no_file_are_not_offered(files):
    (files.directory / "link.model.yaml").symlink_to("/etc/shadow")
    os.mkfifo(files.directory / "pipe.model.yaml")
    assert names(files) == ["model.yaml", "my.model.yaml"]
    for name in ("link.model.yaml", "pipe.model.yaml", "/etc/shadow", str(files.directory / "my.model.yaml")):
        assert files.path_of(name) is None
    with pytest.raises(OSError, match="not a regular file"):
        opened(files.directory / "link.model.yaml")


def test_without_a_directory_there_is_what_runs(tmp_path):
    models = {"applied": {"effects": [], "file": "/a/b.yaml"}}
    assert names(ModelFiles(None)) == []
    assert names(ModelFiles(None), models) == ["applied: b.yaml"]


def test_a_directory_that_somebody_filled_is_not_shown_whole(tmp_path):
    for k in range(MOST + 10):
        (tmp_path / f"{k}.model.yaml").touch()
    assert len(names(ModelFiles(tmp_path))) == MOST
