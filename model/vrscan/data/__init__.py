"""What all packages share: configurations, lines, points, index edges, and the files of them.

``pkg`` and ``link_pkg`` are the constants of the RTL packages of these names. ``contract`` defines
which lines and angles an engine takes. Any package may use this one; it uses none.
"""
