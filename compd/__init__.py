"""compd: live error compensation for parallel kinematic machines, after T. Oiwa.

What a program or a notebook needs is here: open a recording, compare it with the model, learn which effect is
missing, add it, and plan the next measurement. Every name is imported from its module when it is first used, so that
`import compd` takes milliseconds.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
