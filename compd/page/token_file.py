"""The file of tokens for browsers on other computers: names, roles and SHA-256, never the tokens themselves."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import get_args

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from compd.documents import parse_yaml, read_text
from compd.errors import ConfigurationError
from compd.files import FileKind
from compd.page.guard import Role, Token, hashed, new_token

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_MADE_BY = "compd page --new-token makes it"
TOKENS = FileKind("a file of tokens", frozenset({"tokens"}), least=1, next_step=_MADE_BY)


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")
    tokens: list[Token]


def read_tokens(path: Path) -> list[Token]:
    """The tokens in the file, none in an empty one.

    Raises ConfigurationError if others may read it, or it is no such file.
    """
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise _problem(path, f"cannot be read: {error.strerror}", _MADE_BY) from error
    if mode & _OTHERS:
        raise _problem(path, f"can be read by others (mode {stat.S_IMODE(mode):o})", f"chmod 600 {path}")
    text = read_text(path, TOKENS.name)
    if not text.strip():
        return []
    try:
        data, _ = parse_yaml(text, path, TOKENS, dumped=True)
        return _File.model_validate(data).tokens
    except ConfigurationError as error:
        # messages quote nothing of this file, not even a key
        line = error.problems[0].where.removeprefix(f"{path}").partition(" ")[0]
        raise _problem(f"{path}{line}", f"is not {TOKENS.name}", _MADE_BY) from None
    except ValidationError as error:
        numbers = [detail["loc"][1] for detail in error.errors(include_input=False) if len(detail["loc"]) > 1]
        place = f"{path}, token {int(numbers[0]) + 1}" if numbers else str(path)
        raise _problem(place, f"is not {TOKENS.name}", _MADE_BY) from None


def add_token(path: Path, role_and_name: str) -> str:
    """A new token for "view:NAME" or "operate:NAME". Only its hash is stored in the file.

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
        # where an administrator adds one, the file stays readable for the page's user
        if os.geteuid() == 0 and path.exists():
            owner = path.stat()
            os.fchown(file.fileno(), owner.st_uid, owner.st_gid)
        file.write(text)
    beside.replace(path)
    return token


def _problem(path: Path | str, what: str, next_step: str) -> ConfigurationError:
    return ConfigurationError.of(str(path), what, next_step=next_step)
