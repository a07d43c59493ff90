"""Bit-accurate twins of what has a state, stepped by the clock: mirror, light, link, tags.

A twin has its module's name. They use ``fixed`` for their arithmetic, ``registers`` and ``data``.
"""
