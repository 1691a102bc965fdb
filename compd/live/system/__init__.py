"""What the daemon asks of the operating system: priority, limits, child processes, ports, the journal and systemd."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
