"""A machine whose pose own kinematics or a client gives: the pose, the model's effects there, and the derivatives."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
