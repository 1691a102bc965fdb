"""Tokens for browsers on other computers."""

from __future__ import annotations

import pytest

from compd.errors import ConfigurationError
from compd.page.guard import hashed
from compd.page.token_file import add_token, read_tokens


def test_a_token_is_told_once_and_kept_as_its_hash(tmp_path):
    path = tmp_path / "tokens.yaml"
    first, second = add_token(path, "operate:Anna"), add_token(path, "view:screen by the door")
    assert [(token.name, token.role, token.sha256) for token in read_tokens(path)] == [
        ("Anna", "operate", hashed(first)),
        ("screen by the door", "view", hashed(second)),
    ]
    assert path.stat().st_mode & 0o777 == 0o600
    assert not {first, second} & set(path.read_text().split())
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("text", ["operate", "master:Anna", "view:", "operate:Anna"])
def test_what_is_no_role_or_has_a_token_already_is_refused(tmp_path, text):
    path = tmp_path / "tokens.yaml"
    add_token(path, "view:Anna")
    with pytest.raises(ConfigurationError):
        add_token(path, text)
    assert len(read_tokens(path)) == 1


def test_an_empty_file_lets_nobody_in(tmp_path):
    path = tmp_path / "tokens.yaml"
    path.touch(0o600)
    assert read_tokens(path) == []


@pytest.mark.parametrize("text", ["3", "[1, 2", "tokens: 3", "tokens: [{name: a, role: master, sha256: b}]", "more: 1"])
def test_a_file_that_is_none_is_named(tmp_path, text):
    path = tmp_path / "tokens.yaml"
    path.write_text(text)
    path.chmod(0o600)
    with pytest.raises(ConfigurationError, match=r"tokens\.yaml"):
        read_tokens(path)


def test_a_file_that_others_may_read_is_refused(tmp_path):
    path = tmp_path / "tokens.yaml"
    add_token(path, "view:Anna")
    path.chmod(0o640)
    with pytest.raises(ConfigurationError, match="chmod 600"):
        read_tokens(path)
