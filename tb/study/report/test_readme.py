"""Every figure of the README's tables has its row on the benchmark's page, and links to it."""

import re

from vrscan.data.config import Config
from vrscan.engines.tools import repository_root
from vrscan.scene.description import shipped
from vrscan.study.bench.sections import readme_section as section
from vrscan.study.bench.sections.section import Order
from vrscan.study.report import readme_tables as readme


def test_every_figure_links_to_its_row() -> None:
    beside = {"total-default"}  # of the text
    assert beside <= {f"total-{scene}" for scene in shipped()}
    text = (repository_root() / "README.md").read_text()
    links = re.findall(rf"\]\({re.escape(readme.PAGE)}#([^)]*)\)", text)
    blocks = section.SECTION.blocks(Order(Config(), 1, quick=True), lambda cell: {})
    rows = [row.key for block in blocks for row in getattr(block, "rows", ())]
    assert [link for link in links if link not in beside] == rows
    assert beside <= set(links)
    assert len(set(rows)) == len(rows)
    assert {table.name for table in readme.tables(repository_root() / "README.md")} == set(
        readme.MAKERS
    )


def test_links_are_taken_off_for_the_page(tmp_path) -> None:
    page = tmp_path / "README.md"
    row = f"| {readme.linked('timing', 'a_b c')} | 1 |"
    page.write_text(
        f"<!-- timing: begin -->\n\n| m | f |\n|---|--:|\n{row}\n\n<!-- timing: end -->"
    )
    assert list(readme.tables(page)) == [readme.Shown("timing", ("m", "f"), (("a_b c", "1"),))]
    assert readme.row_id("timing", "a_b c") == "readme-timing-a-b-c"
