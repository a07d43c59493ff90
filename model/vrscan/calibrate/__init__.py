"""Calibration: what has to be measured on each instrument before it can be used; VR-SCAN V.

It uses ``data``, ``ideal`` and the simulated mirror of ``scene``.
"""
