"""The README's figures: a row each, which the README links to."""

from collections.abc import Sequence

from vrscan.engines.tools import installed, repository_root
from vrscan.study.bench.bench_page import Block, Heading, Row, Table, Text
from vrscan.study.bench.cells import Cell
from vrscan.study.bench.sections.section import Found, Order, Section
from vrscan.study.report import readme_tables as readme

TITLES = {
    "numbers": "Accuracy, latency and speed",
    "timing": "Each module alone on an LFE5U-85F, speed 6",
    "bitstream": "The whole instrument on a ULX3S",
}


def _cells(order: Order) -> Sequence[Cell]:
    del order
    return ()


def _blocks(order: Order, found: Found) -> Sequence[Block]:
    del order, found
    if installed():
        return [
            Text("They stand in the README of the repository, which this package came without.")
        ]
    blocks: list[Block] = [
        Text(
            "As they stand in the README. This run does not make them; the command at each table "
            "does, and writes them there."
        )
    ]
    for table in readme.tables(repository_root() / "README.md"):
        headings = [heading or "figure" for heading in table.headings]
        blocks += [
            Heading(f"readme-{table.name}", TITLES[table.name]),
            Table(
                name=f"readme-{table.name}-figures",
                headings=headings,
                rows=[Row(readme.row_id(table.name, row[0]), row) for row in table.rows],
                caption=f"Made by <code>{readme.MAKERS[table.name]}</code>.",
                columns=headings,
                values=table.rows,
            ),
        ]
    return blocks


SECTION = Section("readme", "The README's figures", _cells, _blocks)
