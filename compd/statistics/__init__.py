"""Least squares, robust estimates, spectra and scatter of arrays: nothing here knows a recording or a machine."""
