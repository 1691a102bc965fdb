"""The file of tokens for browsers on other computers: names, roles and SHA-256, never the tokens themselves."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import get_args

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from compd.errors import ConfigurationError, Problem
from compd.page.guard import Role, Token, hashed, new_token

_OTHERS = stat.S_IRWXG | stat.S_IRWXO


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")
    tokens: list[Token]


def read_tokens(path: Path) -> list[Token]:
    """The tokens in the file. Raises ConfigurationError where others may read it, or it is no such file."""
    try:
        mode = path.stat().st_mode
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise _problem(path, f"cannot be read: {error.strerror}", "compd page --new-token makes it") from error
    except UnicodeDecodeError:
        raise _problem(path, "is no file of tokens", "compd page --new-token makes it") from None
    if mode & _OTHERS:
        raise _problem(path, f"can be read by others (mode {stat.S_IMODE(mode):o})", f"chmod 600 {path}")
    try:
        return _File.model_validate(yaml.safe_load(text)).tokens
    except (yaml.YAMLError, ValidationError, RecursionError) as error:
        # without its words, and not as its cause: both repeat what is in the file
        raise _problem(_place(path, error), "is no file of tokens", "compd page --new-token makes it") from None


def add_token(path: Path, role_and_name: str) -> str:
    """A new token, "view:NAME" or "operate:NAME", whose hash is then in the file; the token itself is nowhere else.

    Raises ConfigurationError for another role, or a name that has one already.
    """
    role, _, name = role_and_name.partition(":")
    if role not in get_args(Role) or not name:
        raise _problem(path, f"{role_and_name!r} is no role and name", "write view:NAME or operate:NAME")
    tokens = read_tokens(path) if path.exists() else []
    if any(token.name == name for token in tokens):
        raise _problem(path, f"{name} has a token already", "choose another name, or delete the old entry")
    token = new_token()
    entries = [*tokens, Token(name, role, hashed(token))]  # type: ignore[arg-type]
    text = yaml.safe_dump({"tokens": [vars(entry) for entry in entries]}, sort_keys=False)
    beside = path.with_name(path.name + ".new")
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        file.write(text)
    beside.replace(path)
    return token


def _place(path: Path, error: Exception) -> str:
    """The file, with the line that is no YAML, or with the number of the token that is wrong."""
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        return f"{path}:{error.problem_mark.line + 1}"
    if isinstance(error, ValidationError):
        numbers = [part for detail in error.errors(include_input=False) for part in detail["loc"] if part != "tokens"]
        if numbers and isinstance(numbers[0], int):
            return f"{path}, token {numbers[0] + 1}"
    return str(path)


def _problem(path: Path | str, what: str, next_step: str) -> ConfigurationError:
    return ConfigurationError(Problem(where=str(path), what=what, next_step=next_step))
