"""The base of every message that the daemon sends, and the short messages: VERSION, ERROR, the models in use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model

from compd.live.service.messages import ErrorCode

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Links = Annotated[list[float], Field(min_length=1, max_length=6)]


class Keys(BaseModel):
    """Base of every part of a message."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class SentMessage(Keys):
    """Base of all messages that the daemon sends. wire_name : the message's "class"."""

    wire_name: ClassVar[str]


def keys_of(kind: type[Any]) -> type[Keys]:
    """The keys of a NamedTuple, each as its docstring describes it; one that has a default may be absent."""
    defaults: Mapping[str, Any] = kind._field_defaults
    fields: dict[str, Any] = {name: (hint, defaults.get(name, ...)) for name, hint in get_type_hints(kind).items()}
    return create_model(kind.__name__, __base__=Keys, __doc__=kind.__doc__, **fields)


class VersionKeys(SentMessage):
    """Greets every client, and answers VERSION."""

    wire_name = "VERSION"
    protocol: int = Field(description="version of this protocol; a client ignores keys that it does not know")
    release: str = Field(description="version of compd")
    machine: str = Field(description="the machine's name in the configuration")
    config_hash: str = Field(description="hash of the whole configuration, hexadecimal")
    links: int = Field(description="number of links")
    not_measured: list[str] | None = Field(
        default=None,
        description="for people: what no gauge measures, and what is taken in its place; none of daemons up to 0.2.0",
    )
    computed_by: dict[str, str] | None = Field(
        default=None,
        description="what the last bits of a setpoint follow from, by name: `kernels` (hash of their source), `numba`, "
        "`llvm`, `numpy`, `processor`, `target` (what the kernels are compiled for); none of daemons up to 0.2.0",
    )


class ErrorKeys(SentMessage):
    """A request that could not be followed; the connection stays open, except after too_many_clients."""

    wire_name = "ERROR"
    code: ErrorCode = Field(description="what was wrong, for a program")
    text: str = Field(description="what was wrong, for a person")


class ModelSummaryKeys(Keys):
    """One model."""

    effects: list[str] = Field(description="ids of the effects that are computed")
    not_live: list[str] | None = Field(default=None, description="ids of effects at the reference, not computed")
    warnings: list[str] | None = Field(default=None, description="what the model file does not say of itself")
    from_20_degC: list[str] | None = Field(
        default=None,
        description="ids of effects that count from 20 degC: fitted without the quantities at machine zero",
    )
    model: str | None = Field(default=None, description="hash of its file; absent without effects")
    file: str | None = Field(default=None, description="path of its file; absent without effects, and from STATUS")


class ModelsKeys(Keys):
    """The models that the daemon runs with."""

    applied: ModelSummaryKeys | None = Field(default=None, description="the model whose correction is applied")
    shadow: ModelSummaryKeys | None = Field(default=None, description="a model that is computed and not applied")
