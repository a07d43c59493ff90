"""Bit-accurate twins of the arithmetic, over whole arrays: from pixels to points, and the angle.

A twin is the Python model of an RTL module: it has the module's name and computes the same bits.
``vrscan_chain`` joins them. The twins import no floating-point code; they use ``data`` and
``registers``.
"""
