"""The register map, and the conversion of a configuration into the integers of the registers.

``register_map`` is generated from ``rtl/link/registers.toml``. ``chain_registers``,
``mirror_registers``, ``laser_registers`` and ``focus_registers`` each fill one group of it. This
package uses ``data``, and ``ideal`` for the amplitude table; twins, engines and the host use it.
"""
