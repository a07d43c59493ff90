"""The papers' equations in float64: the reference for ``vrscan.fixed``, which it never imports.

It uses ``data`` only. Any package that compares with the truth may use it.
"""
