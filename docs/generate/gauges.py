"""The page of the gauges: every driver and preset with what it speaks, its options and an example."""

from __future__ import annotations

from typing import Any

import yaml

from compd.gauge import Gauge, GaugeOptions, Quality
from compd.gauge_tools import catalogue
from compd.gauge_tools.driver_catalogue import GIVEN_BY_THE_CONFIGURATION, driver_text
from compd.lines import kinds_that_carry
from compd.lines.open import KINDS
from compd.plugins import GAUGES, load
from compd.text import join_words
from docs.generate.configuration import keys_table
from docs.generate.markdown import code, codes, escape, fence, heading, join, link, prose, table, target, term
from docs.generate.schema import Key, ModelSchema


def _line_kinds() -> str:
    """Which kinds of line carry what drivers need, in a sentence."""
    carried = dict.fromkeys(kind.carries for kind in KINDS.values())
    on = [f"{what} on {join_words([code(kind.kind) for kind in kinds_that_carry(what)], 'or')}" for what in carried]
    return f"A driver needs a line of a kind that carries what it reads: {', '.join(on)}."


INTRODUCTION = f"""\
A gauge of the configuration names its driver and its line; every other key belongs to the driver. A {term("driver")} is
a class, or a {term("preset")}: a description in a YAML file that the drivers `serial_ascii`, `serial_frame` and
`modbus` carry out. `compd gauge show NAME` prints what stands here. [Add a gauge](../how-to/add-a-gauge.md) goes from
the plug to the number, for a gauge that is here and for one that is not.

{_line_kinds()} See [lines](#configuration-lines).
In the descriptions, (M) stands for what was read in a maker's manual, (C) for what was read in public code, (P) for
what is only plausible. A length is delivered in mm, whatever the device shows.
"""
QUALITIES = """\
A reading has a value, or a reason why not: its quality. These are the words in `compd gauge watch`, in the messages
[`STATUS`](#protocol-status) and [`READINGS`](#protocol-readings), and in the log.
"""


def page() -> str:
    """Markdown, from the installed drivers and presets."""
    entries = catalogue()
    rows = [
        [_link(entry.name), entry.line_kind, escape(entry.title.partition(":")[0]), codes(entry.needed_options) or "-"]
        for entry in entries
    ]
    described: set[str] = set()
    return join(
        "# Gauges and drivers",
        INTRODUCTION,
        table(["driver", "line", "what it is", "options it needs"], rows),
        heading(2, "Options of every gauge", "gauges-common"),
        keys_table(ModelSchema(GaugeOptions).keys()),
        heading(2, "Drivers and presets", "gauges-drivers"),
        *(_driver(entry.name, described) for entry in entries),
        heading(2, "Quality of a reading", "gauges-quality"),
        QUALITIES,
        table(["quality", "meaning"], [[code(quality), escape(quality.text)] for quality in Quality]),
    )


def _link(name: str) -> str:
    return link(code(name), target("gauges", name))


def _driver(name: str, described: set[str]) -> str:
    """One driver. described : the parts of options that have been described already; its own are added."""
    driver: type[Gauge[Any]] = load(GAUGES, name, name)
    title, _, text = driver_text(driver).partition("\n")
    schema = ModelSchema(driver.Options, lambda model: link(_part_name(model), target("gauges", "part", model)))
    keys = _own(schema.keys())
    blocks = [heading(3, code(name), target("gauges", name)), f"**{escape(title)}**", prose(text)]
    blocks += ["Options:", keys_table(keys)] if keys else ["It has no options of its own."]
    for model, definition in schema.definitions.items():
        if "properties" in definition and model not in described:
            described.add(model)
            blocks += [
                f"({target('gauges', 'part', model)})=\n**{_part_name(model).capitalize()}.** "
                f"{escape(definition.get('description', ''))}",
                keys_table(schema.keys(model)),
            ]
    return join(*blocks, "For example:", fence(_example(name, driver), "yaml"))


def _own(keys: list[Key]) -> list[Key]:
    """The keys without those of every gauge."""
    return [key for key in keys if key.name not in GaugeOptions.model_fields]


def _part_name(model: str) -> str:
    """`ModbusChannel` -> "modbus channel"."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in model).strip()


def _example(name: str, driver: type[Gauge[Any]]) -> str:
    """The options with which the driver is tried, as a gauge of a configuration; checked as one."""
    options = {**dict(zip(GIVEN_BY_THE_CONFIGURATION, (name, "my_line"), strict=True)), **(driver.sample_options or {})}
    driver.Options.model_validate(options)
    return yaml.safe_dump({"gauges": {"my_gauge": options}}, sort_keys=False, default_flow_style=None, width=100)
