"""Tables of measured values as CSV and Parquet: their columns, units and cells, whole or block by block."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
