"""The experiments of the paper (T. Oiwa, figures 18, 20 and 21), reproduced on the simulated machine.

Each experiment is a module with `run` (the measurement), `reductions` and `panels` (its evaluation) and `reproduce`
(all of it, ready for print and page). `frame_experiment` compares equations (4) and (5) with the exact frame, and
`frame_page` shows it. Nothing is tuned to hit the paper's numbers.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
