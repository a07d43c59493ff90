"""What has to be found out of each instrument before it can measure; VR-SCAN V.

It uses ``data``, ``ideal`` and the simulated mirror of ``scene``.
"""
