"""Pages that work offline: comparison, diagnosis, effect and ledger, all from one template (`page`)."""
