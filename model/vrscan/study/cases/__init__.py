"""The hard cases: what the chain does where a line, a number or a clock is at its worst.

An entry has a stable name, says what breaks there, and states the defined result so that it can
be checked; beside its error stands that of VR-SCAN's equations in float64, computed each time.
``vrscan cases`` shows them, ``tb/study/cases/test_cases.py`` proves them at RTL and model.
"""
