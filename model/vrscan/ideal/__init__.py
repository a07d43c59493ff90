"""The papers' equations in float64: the oracle of ``vrscan.fixed``, which it never imports."""
