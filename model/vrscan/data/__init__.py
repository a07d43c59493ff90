"""What all rooms speak of: configurations, lines, points, edges, and the files that they are in.

``pkg`` and ``link_pkg`` are the constants of the RTL packages of these names. ``contract`` says
which lines and angles an engine takes. Any room may use this one; it uses none.
"""
