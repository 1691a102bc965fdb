"""The page of the effects: every physical cause of the library, by the port at which it acts."""

from __future__ import annotations

from compd.model.effects import PORTS, Constant, Effect, Parameter
from compd.model.effects.effect_needs import NEEDS
from compd.model.library import BUNDLED
from docs.generate.markdown import code, escape, heading, join, link, sentence, table, target, term

INTRODUCTION = f"""\
An {term("effect")} is one physical cause of error. It adds something at one place of the machine, its {term("port")},
and the kinematics carries that to the tip. compd knows these {len(BUNDLED)}; `compd model effect ID --html page.html`
draws what one of them does to the tip of your machine. [Add an effect](../how-to/add-an-effect.md) says how to fit one,
and how to write your own as a [formula](model-file.md) or with code.

An effect is linear in its parameters, which are fitted. What it is not linear in, such as a time constant or a period,
is a constant: it is taken from the configuration where a key there gives it, and searched otherwise. The plausible
range of a parameter comes from the source that is named beside it; a parameter that is fitted far outside it says that
the cause is another one. "Needs" are the quantities that have to be measured; where one is missing the effect is not
tried. Telescopes, stages and other machines have [effects of their own](effect-files.md).
"""
_PER = {
    "machine": "the machine",
    "scale": "each scale",
    "link": "each link",
    "axis": "each axis",
    "link_axis": "each link and axis",
}


def page() -> str:
    """Markdown, from the library."""
    by_port: dict[str, list[Effect]] = {}
    for effect in BUNDLED:
        by_port.setdefault(effect.port, []).append(effect)
    rows = [[_link(effect.id), escape(effect.port), escape(effect.physics)] for effect in BUNDLED]
    return join(
        "# Effects",
        INTRODUCTION,
        table(["effect", "port", "what happens"], rows),
        *(_port(port, effects) for port, effects in by_port.items()),
    )


def _link(effect_id: str) -> str:
    return link(code(effect_id), target("effects", effect_id))


def _port(port: str, effects: list[Effect]) -> str:
    meanings = [f"{code(name)}: {escape(PORTS[name])}" for name in effects[0].ports]
    title = "Port " + " and ".join(effects[0].ports)
    return join(
        heading(2, title.replace("_", " ")), "What is added to: " + "; ".join(meanings) + ".", *map(_effect, effects)
    )


def _effect(effect: Effect) -> str:
    """One effect with its parameters and constants."""
    symbols = "\n".join(f"- {code(symbol)}: {escape(meaning)}" for symbol, meaning in effect.symbols.items())
    needs = (
        "; ".join(escape(NEEDS[need]) if need in NEEDS else code(need) for need in effect.needs)
        or "nothing but the links' gauges"
    )
    facts = [
        ["source", escape(effect.source)],
        ["needs", needs],
        ["mistaken for", ", ".join(map(_link, effect.mistaken_for)) or "no other effect of the library"],
        ["separated by", escape(effect.separated_by)],
    ]
    return join(
        heading(3, code(effect.id), target("effects", effect.id)),
        escape(effect.physics),
        code(effect.equation),
        symbols,
        table(
            ["parameter", "unit", "plausible", "one for; where the range comes from"],
            map(_parameter, effect.parameters),
        ),
        table(["constant", "unit", "plausible", "where the range comes from"], map(_constant, effect.constants))
        if effect.constants
        else "",
        "\n".join(f"- **{name.capitalize()}:** {value}" for name, value in facts),
        "" if effect.live else "It belongs to the reference instrument: it is fitted, and never applied by the daemon.",
    )


def _parameter(parameter: Parameter) -> list[str]:
    reciprocal = " Its reciprocal is fitted." if parameter.reciprocal else ""
    return [
        code(parameter.name),
        escape(parameter.unit),
        f"{parameter.low:g} to {parameter.high:g}",
        f"One for {_PER[parameter.per]}; {escape(parameter.source)}.{reciprocal}",
    ]


def _constant(constant: Constant) -> list[str]:
    values = f"{constant.low:g} or {constant.high:g}" if constant.choice else f"{constant.low:g} to {constant.high:g}"
    setting = f" Taken from {code(constant.setting)} of the configuration." if constant.setting else ""
    return [code(constant.name), escape(constant.unit), values, escape(sentence(constant.source)) + setting]
