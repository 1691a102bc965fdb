"""Whose files are trusted: nobody else may be able to put another in their place."""

from __future__ import annotations

import os
import sys

import pytest

from compd.errors import PluginError
from compd.files.file_trust import own_users, trust_problem
from compd.plugins import EFFECTS, load_module

NOBODY = 65534
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files to another user")


@pytest.fixture
def file(tmp_path):
    directory = tmp_path / "own"
    directory.mkdir(mode=0o755)
    path = directory / "effect.py"
    path.write_text("RAN = True\n")
    path.chmod(0o644)
    return path


def test_a_file_of_this_user_that_nobody_else_can_write_is_trusted(file):
    assert trust_problem(file, "here", "effect", own_users()) is None
    assert load_module(file, "here", "effect").RAN


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda file: file.chmod(0o666), "the effect's file may be written by group or others"),
        (lambda file: file.chmod(0o664), "the effect's file may be written by group or others"),
        (lambda file: file.parent.chmod(0o777), "the directory of the effect's file may be written"),
        (lambda file: file.parent.chmod(0o1777), "the directory of the effect's file may be written"),
        (lambda file: file.parent.parent.chmod(0o777), "the directory of the effect's file may be written"),
    ],
)
def test_what_somebody_else_could_exchange_is_not_executed(file, change, says):
    change(file)
    with pytest.raises(PluginError, match=says):
        load_module(file, "here", "effect")


@as_root
@pytest.mark.parametrize(
    ("up", "says"),
    [
        (0, "file belongs to another user"),
        (1, "directory of the effect's file belongs"),
        (2, "directory of the effect"),
    ],
)
def test_neither_is_what_belongs_to_another_user(file, up, says):
    os.chown([file, *file.parents][up], NOBODY, -1)
    with pytest.raises(PluginError, match=says):
        load_module(file, "here", "effect")


@as_root
def test_a_link_in_a_directory_of_ones_own_to_somebody_elses_file_is_looked_at_where_it_leads(file, tmp_path):
    foreign = tmp_path / "foreign.py"
    file.rename(foreign)
    os.chown(foreign, NOBODY, -1)
    file.symlink_to(foreign)
    with pytest.raises(PluginError, match="belongs to another user"):
        load_module(file, "here", "effect")


def test_a_directory_further_up_in_which_only_owners_rename_is_good_enough(file):
    file.parent.parent.chmod(0o1777)
    assert trust_problem(file, "here", "effect", own_users()) is None


@pytest.mark.parametrize(
    "code", ["raise SystemExit(3)", "1 / 0", "def f(): f()\nf()", "import nowhere_to_be_found", "x ="], ids=str
)
def test_whatever_a_persons_own_file_does_is_a_problem_with_its_name(file, code):
    file.write_text(code)
    with pytest.raises(PluginError, match="cannot be loaded") as caught:
        load_module(file, "here", "effect")
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to(path.name), lambda path: None])
def test_what_is_no_file_is_a_problem_and_is_not_waited_for(tmp_path, make):
    path = tmp_path / "effect.py"
    make(path)
    if path.exists():
        path.chmod(0o644 if not path.is_dir() else 0o755)
    with pytest.raises(PluginError):
        load_module(path, "here", EFFECTS)
    assert not any(name.startswith("compd_file_") and str(tmp_path.name) in name for name in sys.modules)
