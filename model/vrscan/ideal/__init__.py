"""The papers' equations in float64: the oracle of ``vrscan.fixed``, which it never imports.

It uses ``data`` alone, and whoever compares with the truth may use it.
"""
