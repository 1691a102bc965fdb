"""From a plug to a number: find a gauge, describe it, watch it, and plan what its line can carry."""
