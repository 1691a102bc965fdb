"""The geometry of `machine: external`: a machine whose pose own kinematics or a client gives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, Self

from pydantic import Field, model_validator

from compd.documents import Positive, Section, refusal
from compd.errors import ConfigurationError
from compd.plugins import ListedCode

# The name of such a machine, in configurations, model files and sidecars.
EXTERNAL = "external"
CLIENT = "client"
_SHA256 = "^[0-9a-f]{64}$"
# Where the hash of the class's file stands.
HASH_KEY = "`geometry: sha256`"


class UnknownGeometryError(ConfigurationError, AttributeError):
    """Something asks for the geometry of a machine of which compd knows none."""


class ExternalGeometry(Section):
    """With `machine: external`: a class of your own or a client gives the pose; compd adds the model's effects."""

    kinematics: Annotated[str, Field(pattern=rf"^({CLIENT}|/.+\.py:[A-Za-z_]\w*)$")] = Field(
        description="FILE:CLASS, the absolute path of a Python file and a subclass of `compd.Kinematics` in it; or "
        f"`{CLIENT}`: the controller's `TARGET` has the pose"
    )
    sha256: Annotated[str, Field(pattern=_SHA256)] | None = Field(
        default=None,
        description="with FILE:CLASS: hash of the file's content, which `sha256sum FILE` prints: 64 digits",
    )
    links: Annotated[int, Field(ge=0, le=6)] = Field(
        default=0, description="number of scales; 0: the controller gives the pose and gets a corrected one"
    )
    scale_signal_period_mm: Positive | None = Field(default=None, description="signal period of the linear scales")

    @model_validator(mode="after")
    def _is_listed(self) -> Self:
        if self.kinematics == CLIENT and self.sha256 is not None:
            raise refusal("sha256 is the hash of a file, and a client gives the pose", "no sha256", "leave it out")
        if self.kinematics != CLIENT and self.sha256 is None:
            file = self.kinematics.rpartition(":")[0]
            raise refusal("sha256 is missing", "the hash of the class's file", f"write what `sha256sum {file}` prints")
        if self.kinematics != CLIENT and not self.links:
            raise refusal("links is 0, and a class needs scales", "1 to 6", "write the number of scales")
        return self

    @property
    def scales(self) -> int:
        """Number of scales."""
        return self.links

    @property
    def has_frame(self) -> bool:
        """There is no frame of which compd knows."""
        return False

    @property
    def link_length_mm(self) -> None:
        """No link's length is known."""
        return

    @property
    def own_class(self) -> tuple[Path, str] | None:
        """File and name of the class; None where a client gives the pose."""
        if self.kinematics == CLIENT:
            return None
        file, _, name = self.kinematics.rpartition(":")
        return Path(file), name

    @property
    def code(self) -> ListedCode:
        """The file of the class, listed with its hash."""
        file = self.kinematics.rpartition(":")[0]
        return ListedCode({file: self.sha256} if self.sha256 else {}, HASH_KEY)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> NoReturn:
            if name.startswith("_"):  # of pydantic
                return super().__getattr__(name)
            raise UnknownGeometryError.of(
                f"geometry.{name}",
                "this needs a machine whose geometry compd knows",
                value="machine: external",
                next_step="describe the machine by actuators and rods; or compare recordings with the columns "
                "`model_x_mm` ...",
            )


def external_of(geometry: Any) -> ExternalGeometry | None:
    """The geometry itself where it is that of `machine: external`; None for any other."""
    return geometry if isinstance(geometry, ExternalGeometry) else None
