"""What the simulated device of a driver package derives from; see `compd.lines.twins.device`."""

from compd.lines.twins.device import Sense, SimulatedByteDevice, SimulatedPushedDevice, SimulatedRegisterDevice

__all__ = ["Sense", "SimulatedByteDevice", "SimulatedPushedDevice", "SimulatedRegisterDevice"]
