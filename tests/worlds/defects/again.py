"""Play a plan again: `python -m tests.worlds.defects.again INVARIANT`, with the plan on the standard input.

Prints when the invariant fails first, s, or null. Only `tests.worlds.defects.find` calls it.
"""

from __future__ import annotations

import json
import sys

from tests.worlds.plan import Plan
from tests.worlds.shrink import failure_s

if __name__ == "__main__":
    print(json.dumps(failure_s(Plan.from_json(sys.stdin.read()), sys.argv[1])))
