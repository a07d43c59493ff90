"""Bit-accurate twins of the modules with a state, stepped by the clock: mirror, light, link, tags.

A twin is the Python model of an RTL module; it has the module's name. The twins use ``fixed`` for
their arithmetic, ``registers`` and ``data``.
"""
