"""All points of a scan at its full rate: shown in part and recorded whole, with a page open."""

import os
import struct
import time
from pathlib import Path

import browser
import numpy as np
import pytest
from fake_board import FakeBoard
from page_bench import click, opened, says, shown_at, unlock
from random_records import random_records

from vrscan.data import recordings, records
from vrscan.link.protocol import encode_frame

RATE, BATCH, BODIES = 37_400, 24, 50
RECORDED_S = 43.0
SEED = 20261125

pytestmark = [pytest.mark.soak, browser.NEEDED]


class FastBoard(FakeBoard):
    """A board that sends points and free beams at the full rate, in packets made before."""

    packets: tuple[bytes, ...] = ()
    sent = 0

    def _make_lines(self, more: float) -> None:
        if self._streaming is None:
            return
        self._due += more
        count, self._due = int(self._due // BATCH), self._due % BATCH
        self._write(b"".join(self.packets[self.sent : self.sent + count]))
        self.sent += count

    def _give(self, *_: object) -> None:
        pass


def packets(made: records.Records, count: int) -> tuple[bytes, ...]:
    """Return frames of one line after the other, whose records come again and again."""
    bodies = [records.encode_space(made[k * BATCH :][:BATCH]) for k in range(BODIES)]
    head = struct.Struct("<BBBBIH")
    return tuple(
        encode_frame(head.pack(0x42, k & 255, BATCH, 1, k * BATCH, 0) + bodies[k % BODIES])
        for k in range(count)
    )


def spent_s(process: int) -> float:
    """Return the processor's time that a process has taken."""
    words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def test_all_points_of_a_scan_are_recorded(tmp_path: Path) -> None:
    made = records.space(random_records(np.random.default_rng(SEED), range(BATCH * BODIES)))
    with FastBoard(tmp_path / "port") as board:
        board.lines_per_s = float(RATE)
        board.packets = packets(made, round((RECORDED_S + 60.0) * RATE / BATCH))
        words = "--timeout", "4", "--space", "--step", "1"
        with shown_at(board.path, *words) as shown, opened(shown.url) as page:
            says(page, "a board answers")
            unlock(page, shown)
            click(page, "Record")
            says(page, ": recording")
            begun, before = time.monotonic(), spent_s(shown.pid)
            time.sleep(RECORDED_S)
            share = (spent_s(shown.pid) - before) / (time.monotonic() - begun)
            click(page, "End")
            says(page, "points, ")
    (path,) = (tmp_path / "kept").glob("*.mcap")
    kept, first, count = recordings.read(path), -1, 0
    assert kept.complete and kept.notes["account"]["missing"] == "0"
    for found in kept.point_blocks():
        first = int(found.line[0]) if first < 0 else first
        number = first + count + np.arange(len(found))
        np.testing.assert_array_equal(found.line, number)
        z_mm = np.where(found.measured, made["z"][number % len(made)] / 4096.0, found.z_mm)
        np.testing.assert_array_equal(found.z_mm, z_mm)
        count += len(found)
    assert count >= 0.98 * RATE * RECORDED_S
    print(f"{count} points recorded, 0 missing, with {share:.2f} of a processor")
