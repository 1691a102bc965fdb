"""Where the numbers of a geometry stand in its file, in either form of a geometry.

`described` reads both forms into one description; this is the way back.
"""

from __future__ import annotations

from typing import NamedTuple

from compd.documents import Location

_ROOT = "geometry"


class GeometryKeys(NamedTuple):
    """The places of a geometry's numbers; links, hinges and actuators count from 0.

    by_rods : whether it is stated by `actuators` and `rods`.  hinge_names : the key of the axis of each hinge.
    tool_on_platform : whether the platform carries the tool.
    """

    by_rods: bool
    hinge_names: tuple[str, ...]
    tool_on_platform: bool

    def base_joint(self, link: int) -> Location:
        """A vector in {B}, mm."""
        return (_ROOT, "rods", link, "base_B_mm") if self.by_rods else (_ROOT, "base", "joints_B_mm", link)

    def platform_joint(self, link: int) -> Location:
        """A vector in {P}, mm."""
        return (_ROOT, "rods", link, "platform_P_mm") if self.by_rods else (_ROOT, "platform", "joints_P_mm", link)

    def hinge_axis(self, hinge: int) -> Location:
        """A unit vector, in {P} or, where the base carries the hinge, in {B}."""
        if not self.by_rods:
            return (_ROOT, "platform", "revolute_axes_P", hinge)
        return (_ROOT, "hinges", hinge, self.hinge_names[hinge])

    def rod_length(self, link: int) -> Location:
        """Of a rod that no actuator extends, mm."""
        return (_ROOT, "rods", link, "length_mm")

    def actuator(self, actuator: int, name: str) -> Location:
        """A number of an actuator: `along_B`, `cosine_B`, `sine_B`, `radius_mm`."""
        return (_ROOT, "actuators", actuator, name)

    @property
    def tool(self) -> Location:
        """The tip: a vector in {P}, of a tool on the plate in {M}; mm."""
        return (_ROOT, "tool", "at_P_mm" if self.tool_on_platform else "at_M_mm")

    @property
    def zero_contact(self) -> Location:
        """The place of the tip at machine zero: a vector in {M}, of a tool on the plate in {P}; mm."""
        return (_ROOT, "tool", "zero_tip_M_mm" if self.tool_on_platform else "zero_tip_P_mm")

    @property
    def zero_attitude(self) -> Location:
        """The attitude of {P} at machine zero: a rotation vector in {M}, rad."""
        return (_ROOT, "tool", "zero_rotation_P_in_M_rad")
