"""A described gauge as data: the contents of a preset's YAML file, and their use for a gauge's options.

`drivers/compd_drivers/presets/README.md` shows how a preset is written. The model here checks the file when it is
read; `gauge_options` and `simulated_options` fill the description in with the options that a person has chosen.
"""

from __future__ import annotations

import string
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, Field, ValidationError, create_model, model_validator
from pydantic.fields import FieldInfo

from compd.gauge import GaugeOptions
from compd_drivers.analogue import AnalogueModule
from compd_drivers.measured import DescriptionSection

Value = str | int | float


class LineAsDelivered(DescriptionSection):
    """Port settings by the device's manual."""

    baud: int = Field(ge=50, description="bits per second")
    format: str = Field(pattern=r"^[78][NEO][12]$", description="data bits, parity, stop bits: 8N1, 7E2 ...")


class PresetOption(DescriptionSection):
    """An option for the person to choose: exactly one of `one_of`, `some_of`, `whole` and `like`."""

    one_of: tuple[Value, ...] = Field(default=(), description="the values of which one is chosen")
    some_of: tuple[Value, ...] = Field(default=(), description="the values of which at least one is chosen")
    whole: tuple[int, int] | None = Field(default=None, description="[lowest, highest] whole number")
    like: str = Field(
        default="", description="an option of the base driver whose type it has: `fastest_mm_per_s`, `channels.range`"
    )
    default: Any = Field(default=None, description="where nothing is chosen; left out: the option is needed")
    description: str = Field(default="", description="its meaning; that of the base driver's option if left out")

    @model_validator(mode="after")
    def _check_kind(self) -> Self:
        if sum(map(bool, (self.one_of, self.some_of, self.whole, self.like))) != 1:
            raise ValueError("needs exactly one of `one_of`, `some_of`, `whole` and `like`")
        if not self.description and not self.like:
            raise ValueError("needs a `description`")
        return self

    def field(self, base: type[BaseModel]) -> tuple[Any, FieldInfo]:
        """Annotation and field for pydantic. ValueError where `like` names no option of the model `base`."""
        description, default = self.description, self.default
        optional = "default" in self.model_fields_set
        annotation: Any
        if self.one_of:
            annotation = Literal[self.one_of]
        elif self.some_of:
            choice: Any = Literal[self.some_of]
            annotation = Annotated[tuple[choice, ...], Field(min_length=1)]
        elif self.whole:
            annotation = Annotated[int, Field(ge=self.whole[0], le=self.whole[1])]
        else:
            field = field_at(base, self.like)
            annotation = Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation
            description = description or field.description or ""
            if not optional and not field.is_required():
                optional, default = True, field.default
        if not optional:
            return annotation, Field(description=description)
        return (annotation | None if default is None else annotation), Field(default=default, description=description)


class PresetVariant(DescriptionSection):
    """A part of the description that applies to some values of the options only."""

    when: dict[str, Value | tuple[Value | None, ...] | None] = Field(
        default={}, description="option -> its value, or several of which one is enough; {}: always"
    )
    gauge: dict[str, Any] = Field(default={}, description="options of the base driver, in addition")
    simulated: dict[str, Any] = Field(default={}, description="where the simulated device has others")

    def applies(self, options: Mapping[str, Any]) -> bool:
        """Whether the chosen options are those of `when`."""
        return all(
            options[key] in wanted if isinstance(wanted, tuple) else options[key] == wanted
            for key, wanted in self.when.items()
        )


class Preset(DescriptionSection):
    """One described gauge."""

    title: str = Field(min_length=1, description="maker, instrument and what it is, in one line")
    delivers: str = Field(min_length=1, description="what one poll gives, in one line")
    source: str = Field(
        min_length=1, description="manual and page, how it was read, what the protocol is, and what is only guessed"
    )
    base: str = Field(description="driver that speaks the protocol: serial_ascii, serial_frame, modbus ...")
    line: LineAsDelivered | None = Field(
        default=None, description="the port as delivered; without it `compd gauge scan --probe` leaves the preset out"
    )
    absolute: bool = Field(
        default=False,
        description="whether the device shows the same value again after its power was off, whatever is set on it; "
        "left out where that is not certain",
    )
    options: dict[str, PresetOption] = Field(default={}, description="what the person has to choose, in this order")
    gauge: dict[str, Any] = Field(default={}, description="options of the base driver; {name} is the chosen option")
    simulated: dict[str, Any] = Field(default={}, description="where the simulated device has others")
    variants: tuple[PresetVariant, ...] = Field(default=(), description="the first that applies is added")
    inputs: AnalogueModule | None = Field(default=None, description="of an analogue input module, in place of channels")
    chosen_channels: str = Field(
        default="", description="the option that names which of `channels` are read; all of them if left out"
    )
    sample: dict[str, Any] = Field(
        default={}, description="options with which `compd gauge test-driver` tries the preset"
    )
    sample_range: tuple[float, float] | None = Field(
        default=None, description="[lowest, highest] that it can show with them, in its channels' unit"
    )

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        known = {*self.options, "driver", "line"}
        texts = [self.gauge, self.simulated, *(text for v in self.variants for text in (v.gauge, v.simulated))]
        used = {name for text in texts for name in placeholders(text)}
        used |= {key for variant in self.variants for key in variant.when} | ({self.chosen_channels} - {""})
        if unknown := sorted(used - known):
            raise ValueError(f"no option `{unknown[0]}`; options are {', '.join(self.options) or 'none'}")
        if self.inputs is not None and ("channels" in self.gauge or self.chosen_channels):
            raise ValueError("`inputs` stands in place of `gauge.channels` and `chosen_channels`")
        return self

    def options_model(self, name: str, base: type[BaseModel]) -> type[GaugeOptions]:
        """The model of this preset's options; `base` is the base driver's. ValueError for an unknown `like`.

        What the options make of the description is checked with them: a person sees both kinds of error at once.
        """
        preset = self

        class CheckedOptions(GaugeOptions):
            @model_validator(mode="after")
            def _check_description(self) -> Self:
                try:
                    preset.gauge_options(self, base)
                except ValidationError as error:
                    raise ValueError(in_one_line(error)) from error
                return self

        fields: dict[str, Any] = {key: option.field(base) for key, option in self.options.items()}
        if self.inputs is not None:
            fields["channels"] = self.inputs.field(f"{name.removesuffix('Options')}Input")
        return create_model(
            name, __base__=CheckedOptions, __module__=__name__, __doc__=f"Options of {self.title}", **fields
        )

    def gauge_options(self, options: GaugeOptions, base: type[BaseModel]) -> BaseModel:
        """The base driver's options for the chosen ones. ValueError if no variant applies, or they contradict."""
        return base.model_validate(self._described(options, base, simulated=False))

    def simulated_options(self, options: GaugeOptions, base: type[BaseModel]) -> BaseModel:
        """The same for the simulated device, which has every channel of the module, read or not."""
        return base.model_validate(self._described(options, base, simulated=True))

    def _described(self, options: Any, base: type[BaseModel], simulated: bool) -> dict[str, Any]:
        chosen = {key: getattr(options, key) for key in ("driver", "line", *self.options)}
        variant = self._variant(chosen)
        described = {**self.gauge, **variant.gauge}
        if simulated:
            described |= {**self.simulated, **variant.simulated}
        filled: dict[str, Any] = {key: value for key, value in chosen.items() if key in base.model_fields}
        filled |= fill_in(described, chosen)
        if self.inputs is not None:
            filled["channels"] = self.inputs.channels(options.channels)
        elif self.chosen_channels and not simulated:
            names = set(map(str, chosen[self.chosen_channels]))
            filled["channels"] = [channel for channel in filled["channels"] if channel["name"] in names]
        return filled

    def _variant(self, chosen: Mapping[str, Any]) -> PresetVariant:
        if not self.variants:
            return PresetVariant()
        for variant in self.variants:
            if variant.applies(chosen):
                return variant
        keys = dict.fromkeys(key for variant in self.variants for key in variant.when)
        there_are = "; ".join(", ".join(f"{k} {_words(v)}" for k, v in v.when.items()) for v in self.variants)
        raise ValueError(f"{', '.join(f'{key} {chosen[key]}' for key in keys)} is not described; there are {there_are}")


def field_at(model: type[BaseModel], path: str) -> FieldInfo:
    """The field `a`, or `a.b` for a list `a` of sections. ValueError if the model has none."""
    *lists, name = path.split(".")
    for key in lists:
        items = getattr(model.model_fields.get(key), "annotation", None)
        model = next((item for item in getattr(items, "__args__", ()) if isinstance(item, type)), BaseModel)
        if not issubclass(model, BaseModel):
            break
    else:
        if name in model.model_fields:
            return model.model_fields[name]
    raise ValueError(f"the base driver has no option `{path}`")


def placeholders(description: Any) -> Iterator[str]:
    """Names of options in braces anywhere in a description."""
    if isinstance(description, str):
        yield from (name for _, name, _, _ in string.Formatter().parse(description) if name is not None)
    elif isinstance(description, dict):
        for value in description.values():
            yield from placeholders(value)
    elif isinstance(description, list | tuple):
        for value in description:
            yield from placeholders(value)


def fill_in(description: Any, chosen: Mapping[str, Any]) -> Any:
    """The description with {name} replaced: by the option's value where nothing else stands in the text, as text
    by Python's format rules ({address:02X}) where something does."""
    if isinstance(description, str):
        name = description[1:-1]
        if description == f"{{{name}}}" and name in chosen:
            return chosen[name]
        return description.format_map(chosen)
    if isinstance(description, dict):
        return {key: fill_in(value, chosen) for key, value in description.items()}
    if isinstance(description, list | tuple):
        return [fill_in(value, chosen) for value in description]
    return description


def in_one_line(error: ValidationError) -> str:
    """All errors of pydantic with their locations; for a list with faulty items only those of the items."""
    details = error.errors(include_url=False)
    places = [detail["loc"] for detail in details]
    return "; ".join(
        f"{'.'.join(map(str, detail['loc']))}: {detail['msg'].removeprefix('Value error, ')}".removeprefix(": ")
        for detail in details
        if not any(place != detail["loc"] and place[: len(detail["loc"])] == detail["loc"] for place in places)
    )


def _words(value: Any) -> str:
    return " or ".join(map(str, value)) if isinstance(value, tuple) else str(value)
