"""The chain's accuracy against float64: what is measured, what the widths predict, what is asked.

One home for the measurements that ``vrscan numbers`` prints and the tests assert.
"""
