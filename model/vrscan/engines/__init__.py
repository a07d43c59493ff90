"""The engines, which turn lines into points: float equations, fixed-point twins, RTL in Verilator.

``engine`` chooses among them and distributes the lines to processes. ``mirror_engine`` and
``board`` run the mirror's loop and the whole instrument. ``tools`` and ``verilated`` build them.
"""
