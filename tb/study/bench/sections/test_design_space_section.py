"""The design space: its detector is the shipped one at the shipped widths, and its front is one.

The variants' RTL is checked against its model too: what is counted is what errs so.
"""

import csv
import io
import re
from dataclasses import replace
from itertools import pairwise
from typing import Any

import cocotb
import harness
import numpy as np
import pytest
from harness import assert_equal, generator, reset, run_vectors, simulate
from hypothesis import given, settings
from hypothesis import strategies as st

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.engines.tools import build_folder, rtl_module
from vrscan.fixed import peak_position, phase_correlate, quarter_wave
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal.geometry import project
from vrscan.registers.chain_registers import Registers
from vrscan.study.bench import bench_page as page
from vrscan.study.bench import design, design_cost
from vrscan.study.bench.cells import Cell, Figures, plain
from vrscan.study.bench.design import Cut, bound, clocks, every, exact, noisy, skewed
from vrscan.study.bench.design_cost import (
    PARTS,
    SECOND_PASS,
    WHOLE,
    cell,
    changed,
    synthesise,
    texts,
)
from vrscan.study.bench.sections import design_space_section as design_space
from vrscan.study.bench.sections.section import Order
from vrscan.study.bench.widths import Design
from vrscan.study.report.accuracy.position_accuracy import guarantee
from vrscan.study.report.efficiency import PEAKS, SIGMAS_PX, with_window

ORDER = Order(Config(), 1, quick=True)
SHIPPED = Design()
VARIANT = Design(7, 22, 20, 23, 18, 15)  # what the simulation builds


@pytest.mark.parametrize("period_n", [True, False])
@pytest.mark.parametrize("pixel_width", [8, 12, 16])
def test_at_the_shipped_widths_it_is_the_shipped_detector(pixel_width: int, period_n: bool) -> None:
    draw = np.random.default_rng([7, pixel_width, period_n])
    count, length = 3000, 512
    lines = draw.integers(0, 1 << pixel_width, (count, length)).astype(np.uint16)
    width = draw.integers(3, 256, count)
    left = (draw.random(count) * (length - width + 1)).astype(np.int64)
    background = draw.integers(0, 1 << pkg.COUNT_WIDTH, count)
    want = phase_correlate.phase_correlate(
        lines,
        left=left,
        width=width,
        background=background,
        measured=np.ones(count, np.bool_),
        pixel_width=pixel_width,
        period_n=period_n,
    )
    own = replace(SHIPPED, pixel_width=pixel_width)
    (found,) = every(lines, Cut(left, width, background), [own], period_n=period_n)
    np.testing.assert_array_equal(found.phase, want.phase)
    position = peak_position.peak_position(left, want.period, want.phase, line_length=length)
    np.testing.assert_array_equal(np.minimum(found.position, (length << 12) - 1), position)
    apart = found.unrounded - found.position * 2.0**-pkg.POSITION_FRACTION
    assert np.abs(apart).max() <= 2.0**-13


def test_its_lines_and_windows_are_those_of_the_chain() -> None:
    config = with_window(Config(), "threshold")
    true = np.random.default_rng(3).uniform(500.0, 1500.0, 64)
    lines = design.converted(design.light(3.0, 0.4, true, config, None)[0], 12)
    nothing = np.zeros(64, np.int64)
    points = run_fixed(lines, nothing, nothing, Registers.from_config(config))
    assert points.measured.all()
    cut = Cut(points.left, points.width, points.background)
    (found,) = every(lines, cut, [SHIPPED], period_n=True)
    np.testing.assert_array_equal(found.position, points.position)
    assert np.abs(found.unrounded - true).max() < 0.01


def test_clocks_are_those_of_the_shipped_modules_and_fall_with_the_rotations() -> None:
    for width in (3, 32, 255):
        own = phase_correlate.latency(width) + peak_position.LATENCY
        assert clocks(SHIPPED, width) == own
        assert clocks(replace(SHIPPED, rotations=16), width) == own - 20
    assert clocks(SHIPPED, 32, 20) > clocks(SHIPPED, 32) + phase_correlate.first_latency(20)


def _errors(*wanted: Design) -> list[dict[str, float]]:
    parameters: dict[str, Any] = {"config": plain(Config()), "steps": 48}
    found: list[dict[str, float]] = exact(
        parameters | {"designs": [each.plain() for each in wanted]}, 0
    )["errors"]
    return found


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("table_bits", (4, 5, 6, 7)),
        ("entry_width", (18, 20, 22)),
        ("sine_width", (16, 18, 20)),
        ("phase_width", (16, 18, 20, 22)),
        ("rotations", (10, 12, 14, 16, 18, 20)),
        ("angle_width", (14, 16, 18, 20)),
    ],
)
def test_more_of_a_width_is_not_worse(name: str, values: tuple[int, ...]) -> None:
    small = replace(SHIPPED, sine_width=16) if name == "entry_width" else SHIPPED
    wanted = [replace(small, **{name: value}) for value in values]
    rows = _errors(*wanted)
    for worse, better in pairwise(rows):
        assert better["unrounded"] <= 1.02 * worse["unrounded"]
    assert rows[-1]["unrounded"] < 0.75 * rows[0]["unrounded"]
    bounds = [bound(each) for each in wanted]
    assert bounds == sorted(bounds, reverse=True)
    for row, most in zip(rows, bounds, strict=True):
        assert row["rms"] <= row["max"] <= most


def test_the_shipped_error_is_its_rounding_and_its_bound_that_of_the_numbers() -> None:
    (row,) = _errors(SHIPPED)
    assert row["rms"] == pytest.approx(2.0**-12 / 12**0.5, rel=0.05)
    assert row["unrounded"] < 0.003e-3
    assert bound(SHIPPED) <= guarantee(period_n=True)
    assert bound(SHIPPED) == pytest.approx(guarantee(period_n=True), rel=0.2)
    # The bound is that of any heights: so is the worst of random ones.
    assert row["max"] < bound(SHIPPED)


def test_micrometres_are_the_slope_of_the_triangle() -> None:
    geometry = Config().geometry
    zero = np.zeros(3)
    near, far = (project(zero, np.array(design.RANGES_MM) + d, geometry) for d in (-0.01, 0.01))
    slope = np.abs(0.02 / (far - near)) * 1e3
    np.testing.assert_allclose(design.micrometres(Config()), slope, rtol=1e-5)


def test_noise_of_all_designs_is_the_same_and_pixels_of_eight_bits_add_theirs() -> None:
    fine, coarse = replace(SHIPPED, pixel_width=16), replace(SHIPPED, pixel_width=8)
    wanted = [SHIPPED, SHIPPED, replace(SHIPPED, table_bits=8), fine, coarse]
    parameters: dict[str, Any] = {"config": plain(Config()), "sigma_px": 2.0, "lines": 60}
    parameters["designs"] = [each.plain() for each in wanted]
    peak = Config().peak
    own = {"k_noise": peak.k_noise, "k_height": peak.k_height}
    loose = {"k_noise": 0.5, "k_height": 0.0}
    parameters["rules"] = [own, {**own, "k_height": 0.2}, {**own, "window": "two_pass"}, loose]
    found = noisy(parameters, 5)
    assert len(found["designs"]) == len(found["rules"]) == len(found["bound_px"]) == len(PEAKS)
    for scores, ruled in zip(found["designs"], found["rules"], strict=True):
        assert scores[0] == scores[1]
        assert scores[2]["rms"] == pytest.approx(scores[0]["rms"], rel=1e-3)
        assert scores[3]["rms"] == pytest.approx(scores[0]["rms"], rel=0.15)
        assert {k: ruled[0][k] for k in scores[0]} == scores[0]  # the chain itself
        assert ruled[1]["width"] < ruled[0]["width"] == ruled[0]["first"]
        assert ruled[2]["first"] < ruled[2]["width"]
        # A rival has a quarter of the height, however much noise is above the threshold.
        assert ruled[3]["rival"] == ruled[0]["rival"] == 0
        assert ruled[3]["width"] > ruled[0]["width"]
    square = [sum(scores[k]["rms"] ** 2 for scores in found["designs"]) for k in (0, 4)]
    assert square[1] > 1.05 * square[0]


def test_a_relative_threshold_holds_a_skewed_spot() -> None:
    parameters: dict[str, Any] = {"config": plain(Config()), "lines": 200}
    parameters["rules"] = [{"k_noise": 3.0, "k_height": 0.0}, {"k_noise": 2.5, "k_height": 0.05}]
    loose, held = skewed(parameters, 1)["moved"]
    assert held < 0.02 < loose


# The RTL that is counted.


def test_shipped_widths_are_the_rtl_as_it_is() -> None:
    for part in (*PARTS, SECOND_PASS, WHOLE):
        for name, text in texts(part, SHIPPED).items():
            plain_text = text.replace("(* blackbox *) module", "module")
            assert plain_text == rtl_module(name.removesuffix(".sv")).read_text(), name


def test_every_width_reaches_the_rtl() -> None:
    small = Design(7, 20, 18, 22, 16, 14, 8)
    sources = texts(WHOLE, small)

    def value(file: str, name: str) -> str:
        (found,) = re.findall(rf"int unsigned {name}\s*= ([^;,/\n]*?)\s*[;,/\n]", sources[file])
        return str(found)

    package = {
        "SineWidth": "18", "PhaseWidth": "22", "AngleWidth": "16", "HarmonicWidth": "42",
        "MagnitudeWidth": "44", "SineAmplitude": str(small.sine_amplitude),
    }  # fmt: skip
    assert {name: value("vrscan_pkg.sv", name) for name in package} == package
    assert value("quarter_wave.sv", "TableBits") == "7"
    assert value("quarter_wave.sv", "EntryWidth") == "20"
    assert value("quarter_wave.sv", "StepCut") == "PhaseWidth - 10"
    assert value("quarter_wave.sv", "SlopeCut") == "21"
    assert value("cordic_vector.sv", "Iterations") == "14"
    assert value("phase_correlate.sv", "PixelWidth") == "8"
    assert sources["quarter_wave_rom.sv"].count("    mem[") == 128
    assert sources["cordic_pkg.sv"].count(": arc_tangent = ") == 14
    with pytest.raises(ValueError, match="Missing is there 0 times"):
        changed("localparam int unsigned Other = 1;", {"Missing": 2})


def test_designs_that_share_a_part_share_its_synthesis() -> None:
    other = replace(SHIPPED, table_bits=8)
    same = [cell(part, SHIPPED).key() == cell(part, other).key() for part in PARTS]
    assert same == [part.module != "quarter_wave" for part in PARTS]
    wanted = design_space.cells(ORDER)
    assert len({each.key() for each in wanted}) == len(wanted)


def test_cells_are_counted_by_what_they_take() -> None:
    counted = design_cost.resources({"LUT4": 3, "CCU2C": 2, "PFUMX": 9, "MULT9X9D": 1})
    assert counted == {"lut": 7, "ff": 0, "ebr": 0, "dsp": 0.5}


@pytest.mark.soak
def test_a_smaller_part_takes_less() -> None:
    (part,) = (part for part in PARTS if part.module == "cordic_vector")
    small = replace(SHIPPED, sine_width=16, angle_width=12, rotations=8)
    found = synthesise(cell(part, small).parameters, 0)
    assert 100 < found["lut"] < 900 and 100 < found["ff"] < 400
    assert found["ebr"] == found["dsp"] == 0


@cocotb.test()
async def a_variant_is_its_model(dut: Any) -> None:
    """A table of another depth and other widths, to the last bit."""
    own = VARIANT
    await reset(dut)
    phase = generator(9).integers(0, 1 << own.phase_width, 4000)
    sine, cosine = quarter_wave.quarter_wave(
        phase,
        phase_width=own.phase_width,
        ampl_width=own.sine_width,
        table_bits=own.table_bits,
        entry_width=own.entry_width,
    )
    operands, want = {"phase_i": phase}, {"sine_o": sine, "cosine_o": cosine}
    signs = dict.fromkeys(want, True)
    got = await run_vectors(dut, operands, signs, latency=quarter_wave.LATENCY, spacing=1)
    assert_equal(got, want, operands)


def test_a_variant_that_is_counted_is_its_model(monkeypatch: pytest.MonkeyPatch) -> None:
    sources = texts(WHOLE, VARIANT)
    folder = build_folder() / "sim" / f"design_{VARIANT.key}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in sources.items():
        (folder / name).write_text(text)
    packages = [folder / name for name in sources if name.endswith("_pkg.sv")]
    monkeypatch.setattr(harness, "rtl_packages", lambda: packages)
    monkeypatch.setattr(harness, "rtl_folders", lambda: [folder])
    monkeypatch.setattr(harness, "rtl_module", lambda name: folder / f"{name}.sv")
    widths = {"PhaseWidth": VARIANT.phase_width, "AmplWidth": VARIANT.sine_width}
    simulate("quarter_wave", __file__, widths, sources=[folder / "quarter_wave_rom.sv"])


# The front.

COST = st.tuples(st.integers(0, 8), st.integers(0, 8))


@given(st.lists(COST, max_size=40))
@settings(max_examples=300, deadline=None)
def test_the_front_is_what_nothing_dominates(costs: list[tuple[int, int]]) -> None:
    def dominated(own: tuple[int, int]) -> bool:
        return any(c != own and c[0] <= own[0] and c[1] <= own[1] for c in costs)

    found = design_space.front(costs)
    assert sorted(found) == [k for k, own in enumerate(costs) if not dominated(own)]
    assert [costs[k] for k in found] == sorted(costs[k] for k in found)


def test_fronts_take_what_is_shown_for_a_difference() -> None:
    def point(which: Design, lut: int, rms: float) -> design_space.Point:
        rest = (rms, rms, 2.0 * rms, 1.0, 0.01, lut, 1, 1, 1.0, 100)
        return design_space.Point(which, rms, *rest)

    own, other = point(SHIPPED, 1000, 1e-4), replace(SHIPPED, table_bits=8)
    better, near = point(other, 900, 0.5e-4), point(other, 900, 1.04e-4)
    assert design_space._front([own, better], "L") == [better]
    assert design_space._front([own, near], "L") == [near, own]
    assert design_space._front([own, point(other, 1000, 0.99999999e-4)], "L") == [own]


def made_up(each: Cell) -> Figures:
    """Return figures of the form that the work of a cell has."""
    given_designs = each.parameters.get("designs", ())
    if each.work == design_cost.WORK:
        return {"lut": 100 + len(str(each.parameters["widths"])), "ff": 10, "ebr": 1, "dsp": 2}
    if each.work == design.EXACT:
        sizes = [1e-4 * (1.0 + 0.1 * k) for k, _ in enumerate(given_designs)]
        rows = [{"rms": s, "max": 2.0 * s, "unrounded": 0.5 * s} for s in sizes]
        return {"errors": rows, "converter": 1e-3, "windows": 99}
    if each.work == design.SKEWED:
        return {"moved": [0.01 * (1 + k) for k, _ in enumerate(each.parameters["rules"])]}
    assert each.work == design.NOISY
    score = {"rms": 0.011, "bias": 0.0, "spread": 0.011, "lost": 0.0}
    rules = [
        score | {"rms": 0.012 - 1e-4 * k, "width": 30.0 + k, "first": 20.0, "rival": 0.01}
        for k, _ in enumerate(each.parameters["rules"])
    ]
    return {
        "bound_px": [0.01] * len(PEAKS),
        "designs": [[score] * len(given_designs)] * len(PEAKS),
        "rules": [rules] * len(PEAKS),
    }


def test_the_section_shows_what_its_cells_came_to() -> None:
    part = page.Part("design", "Design", design_space.blocks(ORDER, made_up))
    beside = page.files([part])
    text = page.page("Title", "lead", [], [part])
    for name in ("design-series", "design-front", "design-window"):
        rows = list(csv.DictReader(io.StringIO(beside[f"{name}.csv"].decode())))
        assert rows and f'href="{name}.csv"' in text
    rows = list(csv.DictReader(io.StringIO(beside["design-front.csv"].decode())))
    assert len(rows) == len(design_space.designs(ORDER))
    (own,) = (row for row in rows if row["shipped"] == "1")
    assert (own["table_bits"], own["rotations"]) == ("10", "26")
    assert float(own["rms_um_500mm"]) == pytest.approx(
        float(own["rms_px"]) * design.micrometres(Config())[1], rel=1e-4
    )
    total = sum(made_up(cell(each, SHIPPED))["lut"] for each in PARTS)
    assert int(own["lut"]) == total
    assert float(own["noise_over_bound"]) == pytest.approx(1.1)
    assert f'id="design-{SHIPPED.key}"' in text and 'id="design-pixel-12"' in text
    assert 'id="design-window-two-pass"' in text
    assert len(SIGMAS_PX) == len([c for c in design_space.cells(ORDER) if c.work == design.NOISY])


def test_the_whole_space_has_every_series_and_the_shipped_widths_in_each() -> None:
    order = replace(ORDER, quick=False)
    wanted = design_space.designs(order)
    assert wanted[0] == SHIPPED and len(set(wanted)) == len(wanted) > 140
    for each in design_space.series(order):
        assert SHIPPED in each.values.values() and len(each.values) >= 3, each.key
    rules = design_space.rules(order)
    assert rules[0] == {"k_noise": Config().peak.k_noise, "k_height": Config().peak.k_height}
    assert rules[-1]["window"] == "two_pass"
    for rule in rules:
        Config().peak.model_validate(Config().peak.model_dump() | rule)
