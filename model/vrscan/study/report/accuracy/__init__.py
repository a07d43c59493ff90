"""The chain's accuracy against float64: measured errors, predictions from the widths, and limits.

``vrscan numbers`` prints these measurements and the tests assert them.
"""
