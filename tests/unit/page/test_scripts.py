"""The page's scripts: no method of a class takes the place of another, which would never be called."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from compd.page.server import STATIC

SCRIPTS = sorted(path for path in STATIC.rglob("*.js"))
CLASS = re.compile(r"^(?:export )?class (\w+).*?^\}", re.MULTILINE | re.DOTALL)
METHOD = re.compile(r"^  (?:async )?((?:get |set )?\w+)\([^;]*\) \{$", re.MULTILINE)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: str(path.relative_to(STATIC)))
def test_no_class_has_two_methods_of_one_name(path):
    for found in CLASS.finditer(path.read_text(encoding="utf-8")):
        names = Counter(METHOD.findall(found[0]))
        assert [name for name, count in names.items() if count > 1] == [], found[1]


def test_there_are_scripts_with_classes():
    assert sum(len(METHOD.findall(path.read_text(encoding="utf-8"))) for path in SCRIPTS) > 100
