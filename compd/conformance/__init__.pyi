from .case_result import CaseResult as CaseResult
from .report import DriverUnderTest as DriverUnderTest
from .report import driver_under_test as driver_under_test
from .report import run_conformance as run_conformance
