"""Secrets in texts: which keys hold one, and texts without them, for messages and logs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, MutableMapping
from typing import Any

# Also keys that name the file of a secret: whoever mistakes one writes the secret itself there.
_KEY = re.compile(r"passw(?:or)?d|passphrase|pwd|secret|token|credential|private_?key|api_?key", re.IGNORECASE)
# RFC 3986, section 3.2.1: what stands before the @ of a URL.
_USER_OF_URL = re.compile(r"(?<=://)[^\s/?#'\"]*@")
# `token=...` of an address, `password: ...` of a file, "token": "..." of a message; no file of that name.
_VALUE = r"""("[^"\n]*"|'[^'\n]*'|[^\s,;&}\]]+)"""
_ASSIGNED = re.compile(rf"""(?<![/-])((?:{_KEY.pattern})["']?\s*[=:]\s*){_VALUE}""", re.IGNORECASE)
HIDDEN = "***"


def holds_secret(keys: Iterable[object]) -> bool:
    """Whether a value under these keys, outermost first, may be a secret: `password`, `token_file`, ..."""
    return any(_KEY.search(str(key)) for key in keys)


def without_users(text: str) -> str:
    """The text with *** in place of user and password of each URL: mqtt://user:password@host."""
    return _USER_OF_URL.sub(f"{HIDDEN}@", text) if "@" in text else text


def without_secrets(text: str) -> str:
    """The text, of a log or of a library, with *** in place of what is assigned to a token, a password, ..."""
    return _ASSIGNED.sub(rf"\1{HIDDEN}", without_users(text))


def has_secret(value: Any) -> bool:
    """Whether a list or mapping has a key, at any depth, under which a secret may be."""
    if isinstance(value, Mapping):
        return any(holds_secret([key]) or has_secret(part) for key, part in value.items())
    return isinstance(value, list | tuple) and any(map(has_secret, value))


def hide_secrets(_logger: Any, _method: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """A processor of structlog: the event without secrets, whatever has logged it."""
    for key, value in event.items():
        if isinstance(value, str):
            event[key] = HIDDEN if holds_secret([key]) else without_secrets(value)
    return event
