"""A recording: raw readings of a machine beside an external reference, as files and as arrays.

On disk a recording is NAME.csv (one row per instant, a header, `.` decimal, UTF-8), or NAME.parquet with the same
columns, beside NAME.yaml, the sidecar.

An empty cell is a missing value. A column's name ends in its unit. The format is described where it is checked:
`columns.COLUMN_KINDS`, `sidecar.SECTIONS`, `checks.LIMITS`. For example, a sidecar:

    format: 2                        # without it: 1, of release 0.1
    machine: tripod-cmm              # a machine configuration, or `external`
    reference:
      quantity: tool_position
      frame: machine
      sigma_um: 0.15
    excluded_rows:                   # by a person, with the reason
    - {row: 17, reason: the tracker's beam was cut}

Module `columns` has the names, units and decimals, `sidecar` the YAML; `writer` writes both files, `reader` reads and
checks them, or a `sample` of a long one; `convert` makes one table into the other.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
