"""The live view: a local web page of a board's points, or of a recording, while they come.

``vrscan.cli`` alone uses it. ``docs/view.md`` describes the page.
"""
