"""Bit-accurate twins of the arithmetic, over whole arrays: from pixels to points, and the angle.

A twin has its module's name; ``vrscan_chain`` joins them. The twins import no float code: they use
``data`` and ``registers``.
"""
