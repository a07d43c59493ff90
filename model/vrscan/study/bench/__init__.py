"""The benchmark: error against cost, of detectors and of the whole instrument.

``cells`` names the work, ``runner`` does it on all cores or on a cluster and keeps what is done,
``sections`` has a module for each part of the page and ``page`` puts them together.
"""
