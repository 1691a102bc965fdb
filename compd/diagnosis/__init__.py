"""Which physical effect is missing from a model, how sure that is, and what to measure next.

`diagnose` takes a recording to a verdict. What may be missing (`candidates`) and what an error may follow
(`descriptions`) compete in the `search`. Its result becomes a `verdict` with its `findings` (`candidate_results`,
`constant_finding`, `empirical_findings`, `proposed_measurement`), and is put into `words`. `planning` chooses rows that
tell effects apart. `model_changes` writes what was found into a model file, `holdout` tries it on a recording that took
no part. Every threshold stands in `criteria`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
