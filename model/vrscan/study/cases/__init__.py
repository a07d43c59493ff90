"""The hard cases: results of the chain for lines, numbers and clocks at their extremes.

An entry has a stable name, says what breaks there, and states the defined result so that it can be
checked. Its error is shown beside that of VR-SCAN's equations in float64, computed each time.
``vrscan cases`` shows the entries, ``tb/study/cases/test_cases.py`` proves them at RTL and model.
"""
