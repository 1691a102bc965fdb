"""The simulated machine: the truth against which the model is tested; it shares no code with the model.

Displacements of parts come from causes, and the closure gives the tip; no tip error is ever stated directly:

    weather -> warm_up (heat) -> frame: supports, plate points, rods    -.
                              -> joints: balls   <- closure: forces      +-> equilibrium -> tip
    motion, plan_motion       -> scales: link lengths, rods             -'
    causes (hidden)           -> parts, gauges, reference instrument
                                        sensors <- readings of the gauges

truth     the machine itself: `strengths` of its ordinary error sources, the protocol of a `cause`, `world` as a whole
causes    causes that can be hidden in it, one module per family; `catalogue` lists them, `hidden_cause` draws one
campaign  recordings computed without real time: `simulated_recording.simulate_recording`
wires     the world on real ports: `server.Simulation`, its lines and devices, its control socket and client
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
