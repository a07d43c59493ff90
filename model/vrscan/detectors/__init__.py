"""Detectors of a line's position in float64: that of the instrument beside those of the literature.

All have one interface, ``catalogue.Detector``. It takes n lines with the mean and noise of their
background and returns n positions, NaN where there is none.
"""
