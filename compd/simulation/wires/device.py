"""What the simulated device of a driver package derives from; see `compd.twins.device`."""

from compd.twins.device import Sense, SimulatedByteDevice, SimulatedPushedDevice, SimulatedRegisterDevice

__all__ = ["Sense", "SimulatedByteDevice", "SimulatedPushedDevice", "SimulatedRegisterDevice"]
