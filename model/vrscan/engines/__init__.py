"""What measures lines: the float equations, the fixed-point twins, or the RTL in Verilator.

``engine`` chooses among them and deals the lines out to processes; ``mirror_engine`` and ``board``
run the mirror's loop and the whole instrument. ``tools`` and ``verilated`` build them.
"""
