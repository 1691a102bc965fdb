"""The message that latches all gauges of a line at once, before they are read in turn."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from compd.documents import Section, refusal
from compd.text import unescape

SettleTime = Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)]
Register = Annotated[int, Field(ge=0, le=0xFFFF)]
# Most registers of one request by function 16 (Modbus Application Protocol V1.1b3, 6.12).
MAX_WRITTEN = 123
WRITE_COIL, WRITE_REGISTERS = 5, 16
BROADCAST = 0


class TriggerBytes(Section):
    """Bytes that every gauge on the line receives without answering."""

    out: str = Field(min_length=1, description=r"what is sent, as in a described gauge: \r \n \t \\ \xHH by their code")
    out_terminator: str = Field(default="", description="what ends it")
    settle_s: SettleTime = Field(
        default=0.0, description="how long the devices are busy with it; the first one is polled after that"
    )

    @field_validator("out", "out_terminator")
    @classmethod
    def _has_known_escapes(cls, text: str) -> str:
        unescape(text)
        return text

    @property
    def request(self) -> bytes:
        """The bytes on the wire."""
        return unescape(self.out) + unescape(self.out_terminator)


class TriggerWrite(Section):
    """Values written to all Modbus slaves at once, or to the one that latches the others."""

    function: Literal[5, 6, 16] = Field(description="5: one coil, 6: one register, 16: several registers")
    address: Register = Field(description="of the coil or the first register, from 0")
    values: Annotated[tuple[Register, ...], Field(min_length=1, max_length=MAX_WRITTEN)] = Field(
        description="what is written; for a coil 0 or 1"
    )
    unit: Annotated[int, Field(ge=0, le=247)] = Field(
        default=BROADCAST,
        description="unit; 0 on a serial line: all, without an answer. Over Modbus TCP every unit must answer",
    )
    settle_s: SettleTime | None = Field(
        default=None,
        description="how long the devices are busy with it; the first one is polled after that; required for unit 0",
    )

    @model_validator(mode="after")
    def _fits_its_function(self) -> Self:
        if self.function != WRITE_REGISTERS and len(self.values) != 1:
            raise refusal(f"function {self.function} writes one value", "one value", "use function 16 for several")
        if self.function == WRITE_COIL and self.values[0] > 1:
            raise refusal("a coil is 0 or 1", "values: [1]", "write another value by function 6")
        if self.unit == BROADCAST and self.settle_s is None:
            raise refusal(
                "unit 0 gives no answer: `settle_s` must say when the devices listen again",
                "0.1 to 0.2 s as a rule (Modbus over Serial Line V1.02, 2.4.1), less where the manual says so",
                "look it up in the devices' manual",
            )
        return self
