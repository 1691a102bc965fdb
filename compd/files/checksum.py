"""The checksum that a file of compd's carries, of what it says and not of how it is written."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

CHECKSUM = "checksum"
_HEX_DIGITS = 16


def checksum_of(content: Mapping[str, Any]) -> str:
    """First 16 hexadecimal digits of the SHA-256 of the content as JSON, sorted by key; its own key is left out.

    Raises TypeError where a mapping in it has keys of several kinds, which no file of compd's has.
    """
    said = {key: value for key, value in content.items() if key != CHECKSUM}
    text = json.dumps(said, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:_HEX_DIGITS]
