"""Formats of instruments, one package for each; a new package is a new format, nothing else has to be edited.

A package declares its format as `FORMAT` in its `__init__`, a `TextFormat` or a `BinaryFormat`. Beside it stand
`reader.py`, from a file to a table or an export, and `writer.py`, from samples of the simulated instrument to a file.
Both are imported when a file is read or written.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib import import_module

from compd.instruments.instrument_format import InstrumentFormat, WrittenForm


@cache
def instrument_formats() -> Mapping[str, InstrumentFormat]:
    """The formats that are read, by name, in the order of their packages. Raises ValueError for a name given twice."""
    packages = [module.name for module in pkgutil.iter_modules(__path__) if module.ispkg]
    formats: dict[str, InstrumentFormat] = {}
    for package in packages:
        declared: InstrumentFormat = import_module(f"{__name__}.{package}").FORMAT
        if declared.name in formats:
            raise ValueError(f"{__name__}.{package}: another format is called {declared.name!r}")
        formats[declared.name] = declared
    return formats


@cache
def written_forms() -> Mapping[str, WrittenForm]:
    """The forms that the simulated instrument writes, by name. Raises ValueError for a name given twice."""
    forms: dict[str, WrittenForm] = {}
    for form in (form for declared in instrument_formats().values() for form in declared.written):
        if form.name in forms:
            raise ValueError(f"{__name__}: another form is called {form.name!r}")
        forms[form.name] = form
    return forms
