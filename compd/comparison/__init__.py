"""Comparison of a model with a recording: residual, noise floor, fits, and what the residual follows.

A recording is opened with its machine (`open`), aligned with the model's prediction (`aligned_recording`,
`external_machine`, `registration`, `velocity`) and compared (`compare`: `noise_floor`, `contributions`,
`residual_trends`, `prediction_uncertainty`), in the unit of its reference (`display_unit`). Effects are fitted by `fit`
and, with nonlinear constants, by `shape_search`; both rest on `least_squares`, `robust`, `outliers` and
`cluster_covariance`. Noise is seen between `replicates`, rows of one visit, and in a `last_digit`. Every threshold of a
result stands in `criteria`.
"""
