"""The sections of the page, a module each: which cells it asks for, and what it makes of them.

A section module has ``SECTION``; ``ALL`` lists them in their order on the page. To add one, write a
module beside these and put its ``SECTION`` here.
"""

from vrscan.bench.sections import compare, design_space, growth, instrument, readme, sweeps
from vrscan.bench.sections.section import Section

ALL: tuple[Section, ...] = (
    compare.SECTION,
    sweeps.SECTION,
    design_space.SECTION,
    instrument.SECTION,
    growth.SECTION,
    readme.SECTION,
)
