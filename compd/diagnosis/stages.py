"""The stages of a diagnosis in their order, by the texts that its `progress` gets."""

from __future__ import annotations

COMPARISON = "comparing the model with the recording"
CANDIDATES = "what each effect would do"
EFFECTS = "every effect, then the next beside it, on rows left out"
COVARIATES = "every covariate, lag, direction and time"
DESCRIPTIONS = "effects against descriptions"
FIT = "fitting on the real forward model"

STAGES = (COMPARISON, CANDIDATES, EFFECTS, COVARIATES, DESCRIPTIONS, FIT)
# Left out where effects alone bring the error down to the noise. These and EFFECTS may come twice, as rows are weighed
# anew.
ONLY_WHERE_NEEDED = frozenset({COVARIATES, DESCRIPTIONS})
