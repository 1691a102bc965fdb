"""The base of every message that the daemon sends, and the short messages: VERSION, ERROR, the models in use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model

from compd.live.service.messages import ErrorCode, line
from compd.text import omit_unknown

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Links = Annotated[list[float], Field(min_length=1, max_length=6)]


class Keys(BaseModel):
    """Base of every part of a message."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class SentMessage(Keys):
    """Base of all messages that the daemon sends. wire_name : the message's "class"."""

    wire_name: ClassVar[str]

    @classmethod
    def message(cls, **keys: Any) -> dict[str, Any]:
        """The message as plain data, without unknown values. Raises TypeError for a key that is not declared."""
        if other := keys.keys() - cls.model_fields.keys():
            raise TypeError(f"{cls.wire_name} has no {', '.join(sorted(other))}")
        return {"class": cls.wire_name, **omit_unknown(keys)}

    @classmethod
    def line(cls, **keys: Any) -> bytes:
        """The message as it is sent."""
        return line(cls.message(**keys))


def present(description: str) -> Any:
    """A key that is always there."""
    return Field(description=description)


def absent(description: str) -> Any:
    """A key that is left out where it is not known."""
    return Field(default=None, description=description)


def keys_of(kind: type[Any]) -> type[Keys]:
    """The keys of a NamedTuple, each as its docstring describes it; one that has a default may be absent."""
    defaults: Mapping[str, Any] = kind._field_defaults
    fields: dict[str, Any] = {name: (hint, defaults.get(name, ...)) for name, hint in get_type_hints(kind).items()}
    return create_model(kind.__name__, __base__=Keys, __doc__=kind.__doc__, **fields)


class VersionKeys(SentMessage):
    """Greets every client, and answers VERSION."""

    wire_name = "VERSION"
    protocol: int = present("version of this protocol; a client ignores keys that it does not know")
    release: str = present("version of compd")
    machine: str = present("the machine's name in the configuration")
    config_hash: str = present("hash of the whole configuration, hexadecimal")
    links: int = present("number of links")
    not_measured: list[str] | None = absent(
        "for people: what no gauge measures, and what is taken in its place; none of daemons up to 0.2.0"
    )
    computed_by: dict[str, str] | None = absent(
        "what the last bits of a setpoint follow from, by name: `kernels` (hash of their source), `numba`, `llvm`, "
        "`numpy`, `processor`, `target` (what the kernels are compiled for); none of daemons up to 0.2.0"
    )


class ErrorKeys(SentMessage):
    """A request that could not be followed; the connection stays open, except after too_many_clients."""

    wire_name = "ERROR"
    code: ErrorCode = present("what was wrong, for a program")
    text: str = present("what was wrong, for a person")


class ModelSummaryKeys(Keys):
    """One model."""

    effects: list[str] = present("ids of the effects that are computed")
    not_live: list[str] | None = absent("ids of effects at the reference, not computed")
    warnings: list[str] | None = absent("what the model file does not say of itself")
    from_20_degC: list[str] | None = absent(
        "ids of effects that count from 20 degC: fitted without the quantities at machine zero"
    )
    model: str | None = absent("hash of its file; absent without effects")
    file: str | None = absent("path of its file; absent without effects, and from STATUS")


class ModelsKeys(Keys):
    """The models that the daemon runs with."""

    applied: ModelSummaryKeys | None = absent("the model whose correction is applied")
    shadow: ModelSummaryKeys | None = absent("a model that is computed and not applied")
