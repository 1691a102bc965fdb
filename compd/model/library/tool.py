"""What takes the tip from where the drawing has it; added to the tool vector, in mm, in the vector's own frame.

A tool that the moving platform carries has its vector in {P} and feels the load on the tip. A tool that stands on the
plate has it in {M}, whatever the platform's attitude, and feels the reaction of the work. Effects take vector and force
from the arrangement (`compd.model.kinematics.tool`), so that a parameter has the same meaning and sign in both.
"""

from __future__ import annotations

from compd.model.effects import Effect, KernelBasis, Parameter
from compd.model.kernels.effects import tool

EFFECTS = (
    Effect(
        id="tool_expansion",
        ports=("tool",),
        physics="The tool or stylus grows with temperature.",
        equation="delta = a tool dT_tool",
        symbols={
            "a": "expansion coefficient of the tool, ppm/K",
            "tool": "tool vector in {P}; of a tool that stands on the plate, in {M}; mm",
            "dT_tool": "temperature of the tool since machine zero, K",
        },
        source="ISO 1; stylus stems: carbon fibre 0, tungsten carbide 5, ceramic 7, steel 12",
        needs=("temperature_tool_degC",),
        parameters=(Parameter("a", "ppm/K", 0, 25, "carbon fibre 0, tungsten carbide 5, steel 12, aluminium 23-25"),),
        mistaken_for=("plate_bending",),
        separated_by="two tools of different length, or warm the tool alone",
        basis=KernelBasis(tool.expansion),
    ),
    Effect(
        id="tool_offset",
        ports=("tool",),
        physics="The tip sits elsewhere on the platform, or on the plate, than the drawing says.",
        equation="delta = d",
        symbols={"d": "displacement of the tip in {P}; of a tool that stands on the plate, in {M}; um"},
        source="ISO 10360-5: qualification of a stylus on a sphere",
        needs=(),
        parameters=(Parameter("d", "um", -50, 50, "tool change and qualification", "axis", tolerance="place"),),
        mistaken_for=("link_zero",),
        separated_by="the edges of the workspace, where the platform tilts; a tool of another length",
        basis=KernelBasis(tool.offset),
    ),
    Effect(
        id="tool_bending",
        ports=("tool",),
        physics="The tool gives way under the force on its tip.",
        equation="delta = C F_tool",
        symbols={
            "C": "compliance of the tool, alike in all directions, um/N",
            "F_tool": "load on the tip in {P}; on a tool that stands on the plate, the work's reaction in {M}; N",
        },
        source="cantilever: Young, Roark's Formulas for Stress and Strain, chapter 8",
        needs=("force",),
        parameters=(Parameter("C", "um/N", 0.01, 1, "end mill of 20 mm 0.01, stylus of 50 mm 1"),),
        mistaken_for=("link_elasticity",),
        separated_by="the same force in several directions at the middle and the edges; a tool of another length",
        basis=KernelBasis(tool.bending),
    ),
)
