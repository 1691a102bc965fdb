"""The fault matrix: what fails, what is injected for it, what must happen, and how the daemon comes out of it.

One table for the run in virtual time (`python -m tests.injection`), the sample with real parts
(tests/system/test_fault_matrix.py) and the page of the documentation (docs/generate/faults.py). The machine is the
shipped tripod, at rest with its scales at `REST_MM`, unless a case says that it drives.
"""

from __future__ import annotations

from tests.injection.case import Case
from tests.injection.cases_of_displays import DISPLAYS
from tests.injection.cases_of_lines import LINES
from tests.injection.cases_of_numbers import NUMBERS
from tests.injection.cases_of_processes import PROCESSES_AND_CLIENTS
from tests.injection.cases_of_readings import READINGS
from tests.injection.cases_of_signals import SIGNALS
from tests.injection.cases_of_thermometers import THERMOMETERS

MATRIX: tuple[Case, ...] = (*READINGS, *LINES, *NUMBERS, *PROCESSES_AND_CLIENTS)
# With those of which nothing is demanded but that the setpoints keep their bound: `make faults`.
FAULTS: tuple[Case, ...] = (*MATRIX, *SIGNALS, *DISPLAYS, *THERMOMETERS)
VIRTUAL = tuple(case for case in FAULTS if case.virtual)
REAL = tuple(case for case in MATRIX if case.real)
