"""A recording of any length against a model, in constant memory: block after block, in two passes.

The first pass draws a sample, spread evenly over the recording (`sample`). It fixes what all rows share: the
instrument's frame, the limits of outliers, the nuisance terms, the noise floor, trends and the prediction's own
uncertainty. The second pass goes through all rows with these (`block_comparison`) and adds up what a comparison reports
(`residual_totals`, `time_envelope`); a fit adds up normal equations instead (`block_fit`). Effects with memory are
carried from block to block (`carried_effects`).
"""
