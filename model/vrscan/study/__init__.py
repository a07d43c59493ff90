"""Studies made with the instrument: scans, reports, hard cases, the benchmark.

``plan`` chooses the effects that a scan needs, ``scan`` makes lines and measures them block by
block. A study may use all packages but ``cli``.
"""
