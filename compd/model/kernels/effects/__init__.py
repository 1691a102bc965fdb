"""The equations of the library's effects, one kernel each, one file per port.

A kernel takes one instant and fills the effect's basis at its ports, mm (rad for directions) per unit of each fitted
number; see `compd.model.effects.effect.Effect`::

    kernel(row, machine, quantities, constants, memory, basis)

row, machine : structures of `compd.model.structures.effect_row`.
quantities (2 q,) : those that the effect needs, in the order of `compd.model.effects.needed_quantities`; then the
    same at machine zero, or under the standard conditions where the effect counts from these.
constants (c,) : the nonlinear constants in the order of the effect's entry.
memory (m,) : what the effect remembers, nan at the start; the kernel leaves in it what the next row needs.
basis (size, P) : zero on entry.
"""
