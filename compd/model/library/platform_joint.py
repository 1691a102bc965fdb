"""What takes the joints of the moving platform from where the drawing has them; added in {P}, in mm or rad."""

from __future__ import annotations

from compd.model.effects import Effect, KernelBasis, Parameter
from compd.model.kernels.effects import platform_joint

EFFECTS = (
    Effect(
        id="platform_joint_position",
        ports=("platform_joint",),
        physics="A platform joint sits elsewhere than the drawing says.",
        equation="delta_i = d_i",
        symbols={"d_i": "displacement of platform joint i in {P}, um"},
        source="Wampler, Hollerbach, Arai (1995): kinematic calibration of closed chains",
        needs=(),
        parameters=(Parameter("d", "um", -100, 100, "machining and assembly", "link_axis", tolerance="place"),),
        mistaken_for=("base_joint_position",),
        separated_by="the whole workspace to its edges; measuring the joints on a coordinate measuring machine",
        basis=KernelBasis(platform_joint.position),
    ),
    Effect(
        id="platform_expansion",
        ports=("platform_joint",),
        physics="The moving platform grows with temperature and takes its joints along.",
        equation="delta_i = a c_i dT_platform",
        symbols={
            "a": "expansion coefficient of the platform, ppm/K",
            "c_i": "place of platform joint i in {P}, mm",
            "dT_platform": "temperature of the platform since machine zero, K",
        },
        source="Slocum, Precision Machine Design (1992), chapter 6; ISO 1",
        needs=("temperature_platform_degC",),
        parameters=(Parameter("a", "ppm/K", 0, 25, "Super-Invar 0.5, cast iron 10, steel 12, aluminium 23-25"),),
        mistaken_for=("frame_rod_expansion",),
        separated_by="warm the platform while the frame keeps its temperature",
        basis=KernelBasis(platform_joint.expansion),
    ),
    Effect(
        id="revolute_axis_tilt",
        ports=("revolute_axis",),
        physics="The revolute axes of the platform joints point elsewhere in the platform's plane than drawn.",
        equation="delta e_i = w_i z_P x e_i",
        symbols={
            "w_i": "angle by which axis i is turned about z_P, urad",
            "e_i": "direction of revolute axis i in {P}, 1",
            "z_P": "third axis of {P}, 1",
        },
        source="Oiwa, figure 4(b): two ball shanks make a revolute joint",
        needs=("revolute_axes",),
        parameters=(
            Parameter("w", "urad", -500, 500, "20 um over 40 mm between the ball shanks", "link", tolerance="tilt"),
        ),
        mistaken_for=("base_joint_position",),
        separated_by="the edges of the workspace, where the platform has yawed",
        basis=KernelBasis(platform_joint.axis_tilt),
    ),
)
