"""`python -m tests.budget`: each number beside its limit."""

from tests.budget.limits import LIMITS
from tests.budget.measures import MEASURES

for name, limit in LIMITS.items():
    print(f"{name:28} {MEASURES[name]():>8,} of {limit:>8,}", flush=True)
