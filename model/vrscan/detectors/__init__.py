"""Detectors of a line's position in float64, side by side: the instrument's and the literature's.

All have one interface, ``catalogue.Detector``: n lines with the mean and noise of their
background in, n positions out, NaN where there is none.
"""
