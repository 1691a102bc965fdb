"""compd: live error compensation for parallel kinematic machines, after T. Oiwa.

What a program or a notebook needs is here: open a recording, compare it with the model, learn which effect is
missing, add it, and plan the next measurement. Every name is imported from its module when it is first used, so that
`import compd` takes milliseconds.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from compd.api.diagnosis import compare as compare
    from compd.api.diagnosis import diagnose as diagnose
    from compd.api.long_recordings import compare_stream as compare_stream
    from compd.api.long_recordings import fit_stream as fit_stream
    from compd.api.long_recordings import open_sample as open_sample
    from compd.api.measurements import plan_measurement as plan_measurement
    from compd.api.models import add_effect as add_effect
    from compd.api.models import open_model as open_model
    from compd.client import connect as connect
    from compd.comparison.open import open_recording as open_recording
    from compd.configuration.shipped import load_machine as load_machine
    from compd.errors import CompdError as CompdError
    from compd.model.effects.effect import Constant as Constant
    from compd.model.effects.effect import Effect as Effect
    from compd.model.effects.effect import Parameter as Parameter
    from compd.model.effects.effect import memoryless_basis as memoryless_basis
    from compd.model.library.effects_file import load_effects as load_effects
    from compd.release import __version__ as __version__
    from compd.simulation.campaign.simulate_campaign import simulate_campaign as simulate_campaign

# Name -> the module that has it, in the order of the reference page.
_MODULES = {
    "load_machine": "compd.configuration.shipped",
    "simulate_campaign": "compd.simulation.campaign.simulate_campaign",
    "open_recording": "compd.comparison.open",
    "compare": "compd.api.diagnosis",
    "diagnose": "compd.api.diagnosis",
    "load_effects": "compd.model.library.effects_file",
    "add_effect": "compd.api.models",
    "open_model": "compd.api.models",
    "compare_stream": "compd.api.long_recordings",
    "open_sample": "compd.api.long_recordings",
    "fit_stream": "compd.api.long_recordings",
    "plan_measurement": "compd.api.measurements",
    "connect": "compd.client",
    "Effect": "compd.model.effects.effect",
    "Parameter": "compd.model.effects.effect",
    "Constant": "compd.model.effects.effect",
    "memoryless_basis": "compd.model.effects.effect",
    "CompdError": "compd.errors",
}
__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _MODULES and name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_MODULES.get(name, "compd.release")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES, "__version__"])
