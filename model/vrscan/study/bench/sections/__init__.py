"""The sections of the page, one module each: the cells that it needs, and its blocks.

A section module has ``SECTION``; ``ALL`` lists them in their order on the page. To add one, write a
module in this folder and put its ``SECTION`` here.
"""

from vrscan.study.bench.sections import choice_section as choice
from vrscan.study.bench.sections import compare_section as compare
from vrscan.study.bench.sections import design_space_section as design_space
from vrscan.study.bench.sections import growth_section as growth
from vrscan.study.bench.sections import instrument_section as instrument
from vrscan.study.bench.sections import speckle_section as speckle
from vrscan.study.bench.sections import sweeps_section as sweeps
from vrscan.study.bench.sections.section import Section

ALL: tuple[Section, ...] = (
    choice.SECTION,
    compare.SECTION,
    speckle.SECTION,
    sweeps.SECTION,
    design_space.SECTION,
    instrument.SECTION,
    growth.SECTION,
)
