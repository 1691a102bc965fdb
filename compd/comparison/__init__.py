"""Comparison of a model with a recording: residual, noise floor, fits, and what the residual follows.

A recording is opened with its machine (`open`), aligned with the model's prediction (`aligned_recording`,
`external_machine`, `registration`, `velocity`) and compared (`compare`: `noise_floor`, `contributions`,
`residual_trends`, `prediction_uncertainty`), in the unit of its reference (`display_unit`). Effects are fitted by `fit`
and, with nonlinear constants, by `shape_search`, without `outliers`; residuals may be correlated in `neighbour_blocks`,
and a fit holds within its `quantity_ranges`.
Methods that know arrays alone stand in `statistics`, among them how noise shows between replicates and in a last digit.
Every threshold of a result stands in `criteria`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
