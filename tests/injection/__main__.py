"""`python -m tests.injection`: see `tests.injection.run`."""

from tests.injection.run import main

raise SystemExit(main())
