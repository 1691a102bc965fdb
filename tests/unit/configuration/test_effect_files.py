"""The section `effects:`: which Python files the daemon may execute for a model."""

from __future__ import annotations

import hashlib

import pytest

from compd.configuration import load
from compd.errors import ConfigurationError, PluginError
from compd.machine_check import load_whole
from compd.model.library import find_effect
from compd.plugins import NO_CODE, OWN_CODE, ListedCode
from tests.support.paths import CONFIG

CODE = """\
from dataclasses import replace
from compd.model.library.link import EFFECTS
MINE = replace(EFFECTS[0], id="m")
"""


@pytest.fixture
def code(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(CODE)
    path.chmod(0o644)
    return path


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def machine(tmp_path):
    """Writes a configuration with this text at its end; its path."""

    def write(text=""):
        path = tmp_path / "machine.yaml"
        path.write_text((CONFIG / "tripod-cmm.yaml").read_text() + text)
        return path

    return write


def entry(path, hash_):
    return f"effects:\n  - {{file: {path}, sha256: {hash_}}}\n"


def test_the_hash_covers_the_list_and_is_the_former_one_without(machine, code):
    plain = load(machine())
    assert plain.config_hash == load(CONFIG / "tripod-cmm.yaml").config_hash
    assert load(machine("effects: []\n")).config_hash == plain.config_hash
    listed = load_whole(machine(entry(code, sha256(code))))
    assert [(item.file, item.sha256) for item in listed.effects] == [(str(code), sha256(code))]
    assert listed.config_hash != plain.config_hash
    assert load(machine(entry(code, "a" * 64))).config_hash != listed.config_hash
    assert listed.zero_hash == plain.zero_hash


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda code: code.unlink(), "cannot read the effect's file: No such file"),
        (lambda code: code.write_text(CODE + "\n"), "has another content than the configuration lists"),
        (lambda code: (code.unlink(), code.mkdir()), "it is a directory"),
    ],
)
def test_check_names_the_line_of_a_file_that_cannot_be_used(machine, code, spoil, says):
    path = machine(entry(code, sha256(code)))
    assert load_whole(path)
    spoil(code)
    with pytest.raises(ConfigurationError, match=says) as caught:
        load_whole(path)
    (problem,) = caught.value.problems
    assert problem.where.endswith("effects.1") or "effects" in problem.where


def test_check_loads_each_file(machine, code):
    code.write_text("raise RuntimeError('not today')\n")
    with pytest.raises(ConfigurationError, match="RuntimeError: not today"):
        load_whole(machine(entry(code, sha256(code))))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("effects:\n  - {file: mine.py, sha256: " + "0" * 63 + "a}\n", "absolute path"),
        ("effects:\n  - {file: /mine.py, sha256: abc}\n", "64 hexadecimal digits"),
        ("effects:\n  - {file: /mine.py}\n", "is missing"),
        ("effects: /mine.py\n", "must be a list"),
    ],
)
def test_an_entry_that_is_written_wrongly_is_named(machine, text, says):
    with pytest.raises(ConfigurationError, match=says):
        load_whole(machine(text))


def test_a_file_is_listed_once(machine, code):
    text = entry(code, sha256(code)) + f"  - {{file: {code}, sha256: {sha256(code)}}}\n"
    with pytest.raises(ConfigurationError, match="is listed twice"):
        load_whole(machine(text))


def test_what_is_executed_is_what_was_hashed(code, monkeypatch):
    """The file is read once: another content that comes after it counts no more."""
    listed = ListedCode({str(code): sha256(code)})
    from compd import plugins

    real = plugins.read_small_file

    def read_and_replace(path, limit_bytes):
        content = real(path, limit_bytes)
        code.write_text("raise RuntimeError('the other file')\n")
        return content

    monkeypatch.setattr(plugins, "read_small_file", read_and_replace)
    assert find_effect(f"{code}:MINE", "m.yaml", code=listed).id == "m"


def test_a_listed_file_may_be_anybodys_and_one_of_no_list_is_refused(code):
    code.chmod(0o666)
    assert find_effect(f"{code}:MINE", "m.yaml", code=ListedCode({str(code): sha256(code)})).declared
    with pytest.raises(PluginError, match="written by group or others"):
        find_effect(f"{code}:MINE", "m.yaml", code=OWN_CODE)
    with pytest.raises(PluginError, match="does not list"):
        find_effect(f"{code.parent}/./{code.name}:MINE", "m.yaml", code=ListedCode({"/another.py": "0" * 64}))


def test_a_program_that_loads_no_code_names_the_command_that_does(code):
    code.write_text("raise RuntimeError('executed')\n")
    with pytest.raises(PluginError, match="executes no file") as caught:
        find_effect(f"{code}:MINE", "m.yaml", code=NO_CODE)
    assert "compd compare" in str(caught.value)
