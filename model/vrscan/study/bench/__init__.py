"""The benchmark: error against cost, for detectors and for the whole instrument.

A cell is one piece of work with its figures. ``cells`` defines cells, ``runner`` computes them on
all cores or on a cluster and keeps the results, ``sections`` has a module for each part of the
page, and ``page`` puts the parts together.
"""
