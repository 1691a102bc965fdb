"""The reasons of `compd.model.kernels.solve_status` as plain integers, which compiled code takes as constants."""

from __future__ import annotations

from compd.model.kernels.solve_status import Reason

OK = int(Reason.OK)
NOT_FINITE = int(Reason.NOT_FINITE)
UNREACHABLE = int(Reason.UNREACHABLE)
NO_CONVERGENCE = int(Reason.NO_CONVERGENCE)
NEAR_SINGULAR = int(Reason.NEAR_SINGULAR)
OTHER_ASSEMBLY = int(Reason.OTHER_ASSEMBLY)
