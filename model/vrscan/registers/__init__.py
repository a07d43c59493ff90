"""The register map, and a configuration as the integers that the registers hold.

``register_map`` is generated from ``rtl/link/registers.toml``; ``chain_registers``,
``mirror_registers``, ``laser_registers`` and ``focus_registers`` fill a group of it each. It uses
``data``, and ``ideal`` for the amplitude table; twins, engines and the host use it.
"""
