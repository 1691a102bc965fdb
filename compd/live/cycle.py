"""One cycle: from a snapshot to a setpoint. No clock, no I/O: a recorded run replays bit for bit."""

from __future__ import annotations

import math

import numpy as np

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.configuration.operation import Limits, Loop
from compd.errors import StateError
from compd.live.limits import limited
from compd.live.loop import Orders
from compd.live.protocol import Target
from compd.live.setpoint import Array, Mode, Numbers, Setpoint, State
from compd.live.stale import Comparators, usable
from compd.live.wiring import MachineWires
from compd.live.zero import MachineZero
from compd.model.machine import MachineModel
from compd.readings import Snapshot
