"""Prove that the tests can fail: put one deliberate fault after another into a copy of the tree.

Every fault of the table names the test file that must turn red. A fault that survives is a weak
test, one whose text is gone or does not build is a stale line of the table; both end with status 1.
``make mutate MODULES="divide triangulate"`` takes only the faults of those files.

``make mutate ARGS="--systematic 1000"`` takes that many mutants made from the code instead, and
``--write`` puts their score into docs/verification.md. An interrupted run goes on where it ended.
"""

import argparse
import os
import queue
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import mutant_score
from rich.console import Console
from rich.progress import track
from rich.table import Table

from vrscan.engines.tools import repository_root

ROOT = repository_root()
SECONDS = 200  # a test that takes longer hangs, which is red too
NO_RTL = "not rtl"  # for a model: mathematics has to notice, not only the RTL


@dataclass(frozen=True)
class Fault:
    """One replacement, and the tests that must notice it."""

    file: str
    what: str
    old: str
    new: str
    test: str
    only: str  # pytest's -k


def faults(file: str, *edits: tuple[str, str, str], test: str = "", only: str = "") -> list[Fault]:
    """Return faults of one file, by default for the test that has the file's name."""
    name = f"test_{test or Path(file).stem}.py"
    path = str(next((ROOT / "tb").rglob(name)).relative_to(ROOT))
    return [Fault(file, *edit, path, only) for edit in edits]


FAULTS = [
    # ---- rtl/trig ----
    *faults(
        "rtl/trig/multiply.sv",
        ("a column's carry without its sign", "sum >>> LimbWidth : sum", "sum >> LimbWidth : sum"),
        ("limbs swapped", "a_index_q == ATop && b", "b_index_q == BTop && b"),
        ("no reset of the result", "      valid_o      <= 1'b0;\n", ""),
        ("no reset of the terms", "      term_valid_q <= 1'b0;\n", ""),
        ("a result after a new start", "term_last_q && !valid_i;", "term_last_q;"),
    ),
    *faults(
        "rtl/trig/divide.sv",
        ("rounds down", "(SumWidth'(divisor_i) >> 1)", "SumWidth'(0)"),
        ("overflow one late", ">= HighWidth'(divisor_q)", "> HighWidth'(divisor_q)"),
        ("no reset of the steps", "start_q <= 1'b0;\n      steps_q <= '0;", "start_q <= 1'b0;"),
        (
            "a reset that begins to count",
            "1'b0;\n      steps_q <= '0;",
            "1'b0;\n      steps_q <= '1;",
        ),
    ),
    *faults(
        "rtl/trig/square_root.sv",
        ("rounds down", "root_q[0] && root", "1'b0 && root"),
        ("rounding wraps", "root_q[0] && root_q[RootWidth:1] != '1", "root_q[0]"),
        ("remainder survives", "      remainder_q <= '0;\n", ""),
        ("no reset of the steps", "steps_q <= '0;\n      done_q", "done_q"),
    ),
    *faults(
        "rtl/trig/quarter_wave.sv",
        ("small angle not turned around", "odd ? -Turn : Turn", "odd ? Turn : Turn"),
        ("d rounds down", "assign rounded = scaled_q + (S", "assign rounded = scaled_q + 0 * (S"),
        ("cosine's sign", "phase_i[PhaseWidth-1] ^ odd}", "phase_i[PhaseWidth-1]}"),
        (
            "factors swapped",
            "cosine_slope_q  <= step_q2 * sine",
            "cosine_slope_q  <= step_q2 * cosine",
        ),
        ("no reset", "if (rst_i) valid_q <= '0;", ""),
    ),
    *faults(
        "rtl/trig/quarter_wave_rom.sv",
        ("an entry off by one", "mem[576] = 32'hc60256da", "mem[576] = 32'hc60256db"),
        ("ports swapped", "a_entry_o <= mem[a_index_i]", "a_entry_o <= mem[b_index_i]"),
        test="quarter_wave",
    ),
    *faults(
        "rtl/trig/cordic_pkg.sv",
        (
            "an angle a little off",
            "5'd20: arc_tangent = 40'h0000028be6",
            "5'd20: arc_tangent = 40'h0000028fe6",
        ),
        ("an angle missing", "5'd1: arc_tangent", "5'd31: arc_tangent"),
        test="cordic_vector",
    ),
    *faults(
        "rtl/trig/cordic_vector.sv",
        (
            "angle rounds down",
            "(SumWidth - 1)'(1) << (AngleGuard",
            "(SumWidth - 1)'(0) << (AngleGuard",
        ),
        ("wrong quadrant", "below ^ x_negative_q ^ y_negative_q", "below ^ y_negative_q"),
        ("magnitude rounds down", "+ ScaledWidth'(1)) >> 1", "+ ScaledWidth'(0)) >> 1"),
        ("zero has an angle", "zero_q ? '0 : angle_q", "angle_q"),
        ("no reset", "if (rst_i) state_q <= IDLE;", ""),
    ),
    # ---- rtl/sensor ----
    *faults(
        "rtl/sensor/line_receiver.sv",
        ("a pixel long is good", "&& !over && !is_early && !skip_i;", "&& !is_early && !skip_i;"),
        ("lost is forgotten", "(lost_q || dropped) && !good;", "dropped && !good;"),
        ("period a clock short", "period_i - PeriodWidth'(1)", "period_i - PeriodWidth'(2)"),
        (
            "a counter wraps",
            "vrscan_pkg::counted(short_count_o, CountWidth)",
            "16'((short_count_o + 16'd1) % (1 << CountWidth))",
        ),
        ("no reset of the period", "      too_early_q        <= 1'b0;\n", ""),
        ("no reset of lost", "      lost_q             <= 1'b0;\n", ""),
        ("no reset of a counter", "      early_count_o      <= '0;\n", ""),
    ),
    *faults(
        "rtl/sensor/line_extent.sv",
        ("a pixel short is good", "!line_start_i && pixel_valid_i));", "!line_start_i));"),
        ("no reset of the line", "if (rst_i) in_line_q <= 1'b0;", ""),
        ("what was too long stays so", "(over_q && !line_start_i)", "over_q"),
    ),
    *faults(
        "rtl/sensor/line_buffer.sv",
        (
            "reads the bank that is written",
            "<= !write_bank_q;\n      read",
            "<= write_bank_q;\n      read",
        ),
        ("last one early", "(LineLength - 1)", "(LineLength - 2)"),
        ("no reset of the replay", "      reading_q    <= 1'b0;\n", ""),
        ("no reset of the last stage", "      valid_o      <= 1'b0;\n", ""),
    ),
    *faults(
        "rtl/sensor/line_statistics.sv",
        ("the last maximum", "pixel_q2 > max_q", "pixel_q2 >= max_q"),
        (
            "a guard block less",
            "distance_q <= DistanceWidth'(GuardBlocks)",
            "distance_q < DistanceWidth'(GuardBlocks)",
        ),
        ("a short block in a pair", "on_line && reach < Reach", "on_line; // && reach < Reach"),
        ("the brightest pairs", "other_sum_q < pair_sum_q\n", "other_sum_q > pair_sum_q\n"),
        (
            "of equal pairs the farther",
            "other_index_q < pair_index_q",
            "other_index_q > pair_index_q",
        ),
        ("a missing block is none", "left_whole_q ? left_sum_q : read_sum", "left_sum_q"),
        ("the block is one part", "(first_part_q3 ? '0 : part_squares_q)", "'0"),
        ("last block's length", "? LengthWidth'(LastLength)", "? LengthWidth'(BlockBits)"),
        ("sums of the line before", "(block_q == '0 ? '0 : sum_q)", "sum_q"),
        ("flag though the row was asked for", "none_kept && !noise_row_i;", "none_kept;"),
        (
            "moment's sign",
            "product[MomentWidth-1:0] - sum_squared_q",
            "sum_squared_q - product[MomentWidth-1:0]",
        ),
        (
            "mean and background swapped",
            "(use_row_q ? DividendWidth'(row_sum_q)",
            "(!use_row_q ? DividendWidth'(row_sum_q)",
        ),
        (
            "no reset of the moments",
            "      moment_q        <= MOMENT_IDLE;\n      factors",
            "factors",
        ),
        (
            "no reset of the quotients",
            "      quotient_q     <= QUOTIENT_IDLE;\n      divide",
            "divide",
        ),
        ("no reset of the selection", "      reading_q     <= 1'b0;\n", ""),
    ),
    # ---- rtl/peak ----
    *faults(
        "rtl/peak/peak_isolate.sv",
        (
            "S/N at its limit is low",
            "dim_q     <= height_limit < product",
            "dim_q     <= height_limit <= product",
        ),
        (
            "the threshold itself is above",
            "{CountShift{1'b0}}}) > compare_threshold",
            "{CountShift{1'b0}}}) >= compare_threshold",
        ),
        (
            "the core level itself is above",
            "{CountShift{1'b0}}}) > compare_core",
            "{CountShift{1'b0}}}) >= compare_core",
        ),
        ("gaps are lit", "lit_q + WindowWidth'(above_q)", "lit_q + WindowWidth'(1)"),
        ("clipped noise", "(thrice_q) << raise_q[4:1]", "(thrice_q)"),
        ("isolated pixels are a spot", "<= enough && pair;", "<= enough;"),
        ("the row's noise is raised", "raise == '0 || row_q) r", "raise == '0) r"),
        ("dark without a floor", "= background_q == '0 ? CountW", "= 1'b0 ? CountW"),
        ("the smaller term", "spread_term_q > TermWidth'", "spread_term_q < TermWidth'"),
        ("the paper's threshold is limited", "!peak_i.noise_row && spread_term", "spread_term"),
        ("a broad core is clear", "!broad_q && rivals_q", "rivals_q"),
        ("broad rivals are narrow", "if (!core_broad && rivals_q", "if (rivals_q"),
        ("the smaller noise", "end_noise_q > end_spread_q", "end_noise_q < end_spread_q"),
        ("saturated beyond the level", ") >= peak_i.saturation", ") > peak_i.saturation"),
        ("a saturated core is too wide", "|| (broad_q && !end_saturated_q)", "|| broad_q"),
        (
            "noise term rounds down",
            "TermWidth'(1 << (vrscan_pkg::KNoiseFraction - 1))",
            "TermWidth'(0)",
        ),
        (
            "height term rounds down",
            "TermWidth'(1 << (vrscan_pkg::KHeightFraction - 1))",
            "TermWidth'(0)",
        ),
        (
            "flag of the next line",
            "clear ? end_low_clear_q",
            "clear ? compare_low_clear_q",
        ),
        (
            "edge one early",
            "found_right_q == IndexWidth'(LineLength - 1)",
            "found_right_q == IndexWidth'(LineLength - 2)",
        ),
        (
            "any run is a rival",
            "core_ends && core_enough",
            "core_ends",
        ),
        (
            "least width is too narrow",
            "(above_q && lit_q == below_min_q)",
            "(above_q && lit_q == min_width_q)",
        ),
        (
            "largest width is too wide",
            "(found_width_q) > WiderWidth'(max",
            "(found_width_q) >= WiderWidth'(max",
        ),
        ("the ring goes on", "(first_q || late_q != LateWidth'(vrscan_pkg::RingMargin))", "1'b1"),
        (
            "the ring stops early",
            "LateWidth'(vrscan_pkg::RingMargin));",
            "LateWidth'(vrscan_pkg::RingMargin - 60));",
        ),
        ("limit of the register", "? WindowWidth'(vrscan_pkg::MinWindow)", "? WindowWidth'(2)"),
        ("a gap is a pixel longer", "GapWidth'(MostGap) : '0", "GapWidth'(MostGap + 1) : '0"),
        (
            "a row is even with more spread",
            "CountWidth + 5)'(noise_q)",
            "CountWidth + 5)'(spread_q)",
        ),
        ("a dim spot of no spread", "dim_q || far_dim_q", "dim_q"),
        ("a row's noise is even", "(row_q || !even_q ? faint", "(!even_q ? faint"),
        ("less is sure", "'0 : (product_wide << 2) + product_wide)", "'0 : product_wide << 2)"),
        ("sure by the paper, too", "(peak_i.noise_row ? '0 : (", "(("),
        ("unclear by the noise alone", "|| faint_q || far_faint_q", "|| faint_q"),
        (
            "a gap without a fit",
            "peak_i.window_fit ? GapWidth'(MostGap) : '0",
            "GapWidth'(MostGap)",
        ),
        ("a gap is the window's end", "= above_q ? index_q : run_right_q", "= index_q"),
        ("a gap counts at the core level", "+ WidthWidth'(core_above_q)", "+ WidthWidth'(1)"),
        ("a gap ends no part", "core_above_q && !last_q ? core_part_q", "!last_q ? core_part_q"),
        ("gaps add up", "core_gap_q     <= core_above_q ? '0 : core", "core_gap_q     <= core"),
        ("no reset of the run", "      in_run_q <= 1'b0;\n", ""),
        ("no reset of the compared pixel", "if (rst_i) seen_q <= 1'b0;", ""),
        ("no reset of the end", "finish_q <= 1'b0;\n      in_run_q", "in_run_q"),
        ("no reset of the state", "state_q  <= IDLE;\n      start_q  <= 1'b0;\n", ""),
    ),
    *faults(
        "rtl/peak/phase_correlate.sv",
        ("pedestal put back for T = N", "period_o == width_o ? '0 : ", ""),
        ("T and N swapped", "(!(peak_i.period_n || peak", "((peak_i.period_n || peak"),
        (
            "two passes with T = N - 1",
            "(peak_i.period_n || peak_i.window_two_pass)",
            "(peak_i.period_n)",
        ),
        (
            "noise on a level baseline",
            "        slope_q      <= '0;\n        sum_o",
            "        sum_o",
        ),
        ("ramp a pixel late", "    if (issue_q2) begin", "    if (issue_q2 && issue_q) begin"),
        ("a third window", "        again_q       <= 1'b0;\n", ""),
        ("a sum below zero", "sum_o      <= sum_q < 0 ? '0 : sum_q", "sum_o      <= sum_q"),
        ("second harmonic from the wrong side", "<= -{cordic_angle", "<= {cordic_angle"),
        ("no phase but measured", "measured_o && !no_phase_o;", "measured_o;"),
        ("wave rounds down", "HarmonicWidth'(1 << (WaveShift - 1))", "HarmonicWidth'(0)"),
        ("sine and cosine swapped", "y_q + HarmonicWidth'(sine_p", "y_q + HarmonicWidth'(cosine_p"),
        ("no reset of the state", "state_q      <= IDLE;\n      step_start_q", "step_start_q"),
        ("no reset of the CORDIC's start", "      cordic_start_q <= 1'b0;\n      summed", "summed"),
    ),
    *faults(
        "rtl/peak/peak_neighbours.sv",
        (
            "a line before a pause as neighbour",
            "centre_there_q <= after_there_q;\n",
            "centre_there_q <= 1'b1;\n",
        ),
        (
            "a line that comes late is lost",
            "pending_q        <= comes && state_q != IDLE;",
            "pending_q        <= 1'b0;",
        ),
        ("the wait is a clock longer", "NeighbourClks - 2)", "NeighbourClks - 1)"),
        (
            "noise of the own width only",
            " + product + PixelNoise;\n          {a_q, b_q, multiply_start_q} <= squared(diff",
            ";\n          {a_q, b_q, multiply_start_q} <= squared(diff",
        ),
        (
            "a missing neighbour's light",
            "before_q.measured ? before_q.light : '0",
            "before_q.light",
        ),
        ("a steady spot lacks light", "alone_q ? Whole : Steady", "Whole"),
        ("darker than dark", "Dark     = Whole >> 3", "Dark     = Whole >> 4"),
        ("brighter than dark", "Dark     = Whole >> 3", "Dark     = Whole >> 2"),
        ("faint is less", "Faint    = Whole >> 2", "Faint    = Whole >> 3"),
        ("dim is more", "Dim      = (Whole >> 1) - (Whole >> 4)", "Dim      = Whole >> 1"),
        ("narrower and dimmer", "(Whole >> 1) + (Whole >> 3) + ", "(Whole >> 1) + "),
        ("slender and no brighter", "Brighter = Whole + (Whole >> 3)", "Brighter = Whole"),
        ("out of the row a little", "{centre_q.scale, 2'b0}", "{centre_q.scale, 1'b0}"),
        ("astray is out of the row", "(out_of_row_q && strayed_q)", "out_of_row_q"),
        ("astray in the row", "(out_of_row_q && strayed_q)", "strayed_q"),
        ("dimmer than one of both", "share_q < Dim && &dimmer_q", "share_q < Dim && dimmer_q[1]"),
        ("faint beside one of both", "(&dimmer_q || ", "(|dimmer_q || "),
        ("faint of any width", " && (&dimmer_q || !remote_q[brighter_q])", ""),
        ("far from the dimmer one's width", "!remote_q[brighter_q]", "!remote_q[!brighter_q]"),
        ("narrower is astray", " || (astray_q && mixed_astray_q)", " || mixed_astray_q"),
        ("slim beside none", "(below_q & least_q)) && |there;", "(below_q & least_q));"),
        ("as slim as one", "&(~there | (below_q & least_q))", "|(~there | (below_q & least_q))"),
        (
            "slender beside one",
            "&(~there | (below_q & remote_q))",
            "(~there[1] | (below_q[1] & remote_q[1]))",
        ),
        (
            "the dimmer one's width",
            "brighter_q     <= light[1] > light[0];",
            "brighter_q     <= light[1] < light[0];",
        ),
        ("wider than one of both", "&(below_q & unlike_q)", "&unlike_q"),
        ("thin beside alike ones", "&(below_q & thin_q) && |wide_q", "&(below_q & thin_q)"),
        ("fair is less", "Fair     = Whole - (Whole >> 4)", "Fair     = Whole - (Whole >> 3)"),
        ("dark beside one", "Single   = (Whole >> 2) + (Whole >> 4)", "Single   = Whole >> 2"),
        ("a width turns less", "Turn          = 8;", "Turn          = 9;"),
        ("pixels make no width", "(1 << 18);", "(0);"),
    ),
    *faults(
        "rtl/peak/peak_fit.sv",
        (
            "history of a line more",
            "signed'(42'(weight_q)) - signed'(42'(oldest_weight_q))",
            "signed'(42'(weight_q))",
        ),
        ("differences of second order", "21'(second_15) - 21'(second_16)", "21'(second_15)"),
        ("saturated pixels count", "online_5 && !clipped_5;", "online_5;"),
        (
            "clipped above the level only",
            "(pixel_2) >= saturation_level_i",
            "(pixel_2) > saturation_level_i",
        ),
        ("far is near", "<= {reach_q, 1'b0}", ">= {reach_q, 1'b0}"),
        ("sigma without neighbours", "+ (35'(speckle_part_q) >> 2)", "+ 35'd0"),
        ("no wings", "power_13 == 3'd5 || power_13 == 3'd6", "1'b0"),
        ("no far wings", "{power_13 == 3'd7,", "{1'b0,"),
        ("wings begin late", "power_13 == 3'd5 ||", "1'b0 ||"),
        (
            "before the line",
            "<= fit_place_q >= 0 && fit_place_q < LineEnd",
            "<= fit_place_q < LineEnd",
        ),
        ("beyond the line", "fit_place_q >= 0 && fit_place_q < LineEnd", "fit_place_q >= 0"),
        ("a start outside", "enough_q && start_inside_q", "enough_q"),
        ("mixed with saturated pixels", "chi_large_q && whole_q", "chi_large_q && unclipped_q"),
        ("two spots lean", "inner_q && !chi_large_q)", "inner_q)"),
        ("a cut spot leans", "&& eligible_q && inner_q", "&& eligible_q"),
        ("a cut spot has grains", "(inner_q && whole_q)", "whole_q"),
        ("a saturated spot has grains", "(inner_q && whole_q)", "inner_q"),
        ("a fit of more chi squared", "close_q && chi_small_q", "close_q && !chi_large_q"),
        ("grains excuse all", "close_q && chi_small_q", "chi_small_q"),
        ("a foot of any side", "foot_change[LeanWidth] ^ foot_drop", "foot_drop"),
        ("a foot is told sooner", "MoreLean = 17'(8 << 8)", "MoreLean = 17'(7 << 8)"),
        ("a large foot is larger", "{1'b0, clear_q, 10'd0}", "{1'b0, clear_q, 10'd1}"),
        ("the oldest foot stays", "foot_drop = state_q == LEVEL ||", "foot_drop ="),
        ("a saturated line has a foot", "whole_q ? limited_lean : '0", "limited_lean"),
        ("a saturated line ends as others", "(pass_q[1] && clear_line_q)", "pass_q[1]"),
        ("a foot in the first pass", "told_q && (pass_q == 2'd1 || ", "told_q && (!pass_q[1] || "),
        (
            "the whole leans as the middle",
            "foot_q ? 36'(b1_whole) : 36'(b1_middle)",
            "36'(b1_middle)",
        ),
        ("a foot in grains", "by_itself_q <= foot_q || ", "by_itself_q <= "),
        ("no lean by itself", "|| (own_lean_q > OwnLean && own_lean_q > common_q)", ""),
        ("less leans by itself", "OwnWidth'(12 << 8)", "OwnWidth'(11 << 8)"),
        ("more grains", "27'(7 << 8)", "27'(8 << 8)"),
        ("grains grow less", " + (27'(first_quotient) >> 3)", ""),
        ("fine grains before the first line", "17'(3 << 8)", "17'(2 << 8)"),
        ("fine grains lean less", "27'sd600", "27'sd599"),
        ("grains hide nothing", "grains_q >= CoarseGrains ? FactorWidth'(total_q) :", ""),
        ("mixed at the fit's limit", "{1'b0, mixed_limit_q}", "{1'b0, chi_limit_q}"),
        ("mixed without a spot", "measured_q && mixed_q;", "mixed_q;"),
        ("never a jump", "jump_q ? second_quotient[19:0] : first", "first"),
        ("noise jumps", "<= uneven_q && second_quotient[Quo", "<= second_quotient[Quo"),
        ("a jump from the sum on", "{first_quotient[18:0], 1'b0}", "first_quotient[19:0]"),
        ("more of its own speckle", "weight_q >> 8", "weight_q >> 9"),
        ("a pass before its product", "multiplied && divided) begin", "divided) begin"),
        ("not reset", "history_full_q <= 1'b0;", "history_full_q <= history_full_q;"),
    ),
    *faults(
        "model/vrscan/fixed/peak_fit.py",
        ("never a jump", "JUMP = 2 ", "JUMP = 1 << 30 "),
        test="peak_fit_model",
    ),
    *faults(
        "model/vrscan/ideal/peak_fit.py",
        ("never a jump", "UNEVEN, JUMP = 4.0, 2.0", "UNEVEN, JUMP = 4.0, 1e9"),
        test="peak_fit_model",
    ),
    *faults(
        "rtl/trig/multiply_fast.sv",
        ("high limbs are lost", "{high_q, low_q}", "{36'd0, low_q}"),
        ("no reset", "valid_q <= '0;", "valid_q <= valid_q;"),
    ),
    *faults(
        "rtl/peak/peak_refine.sv",
        ("a limit belongs above", "2'(dark_q > (2", "2'(dark_q >= (2"),
        ("a plateau has a phase", "sigma_q == spot_sigma_pkg::Largest\n", "1'b0\n"),
        ("width rounds down", "(1 << (WidthShift - 1))) >>>", "(0)) >>>"),
        ("place rounds down", "next_first = first_q + PlaceWidth'(1)", "next_first = first_q"),
        (
            "two pixels are a window",
            "count_q < PlaceWidth'(vrscan",
            "count_q < PlaceWidth'(0 * vrscan",
        ),
        ("left end not cut", "next_first < 0 ? '0 : next_first", "next_first"),
        ("a pair that is cut counts", "whole ? sum_q : {SumWidth{1'b1}}", "sum_q"),
        (
            "a bright pair counts",
            "whole_q && excess_q <= noise_i[CountWidth-1-:SumWidth]",
            "whole_q",
        ),
        ("brightness at its limit", "excess_q <= noise_i", "excess_q < noise_i"),
        ("no pair, a slope", "span_q == '0 ? '0\n                   : falling", "falling"),
        ("a falling slope rises", "falling_q <= total_q < 0", "falling_q <= 1'b0"),
        ("no reset of the state", "state_q          <= IDLE;\n      multiply", "multiply"),
        ("no reset of the reading", "      reading_o        <= 1'b0;\n", ""),
    ),
    *faults(
        "rtl/peak/peak_position.sv",
        ("rounds down", "(1 << (Shift - 1))", "(0)"),
        ("a result after a new start", "product_valid && !valid_i;", "product_valid;"),
        ("left a pixel off", "signed'({1'b0, left_i})) <<<", "signed'({1'b0, left_i + 1'b1})) <<<"),
        ("no reset", "if (rst_i) valid_o <= 1'b0;", ""),
    ),
    *faults(
        "rtl/peak/peak_confidence.sv",
        (
            "C_sfm where there is an object",
            "clear_q ? confidence : '0",
            "clear_q ? '0 : confidence",
        ),
        (
            "S/N of no height",
            "snr_o            <= height_q == '0 ? '0 : quotient",
            "snr_o            <= quotient",
        ),
        ("negative variance", "variance_q < 0 ? '0 : ", ""),
        ("N + C", "{1'b0}}}) - count_i", "{1'b0}}}) + count_i"),
        ("kappa f rounds down", "(1 << (KappaShift - 1))", "(0)"),
        ("sigma of nothing", "measured_q ? quotient : '0", "quotient"),
        ("wrong flag", "no_noise_o       <= noise_q", "no_noise_o       <= height_q"),
        ("no reset of the state", "state_q          <= IDLE;\n      multiply", "multiply"),
    ),
    # ---- rtl/geometry ----
    *faults(
        "rtl/geometry/distortion.sv",
        ("odd and even swapped", "geometry_i.even && r_q", "!geometry_i.even && r_q"),
        ("complement for negation", " + SlopeSumWidth'(flip_q)", ""),
        ("saturated slope is not told", "!offset_fits || !slope_fits;", "!offset_fits;"),
        ("2 k1 for 3 k1", "(FactorWidth + 4)'(factor_q) + ((F", "((F"),
        ("no reset", "store_q <= 1'b0;\n      done_q", "done_q"),
    ),
    *faults(
        "rtl/geometry/correction_map.sv",
        ("rounds down", " + ValueWidth'(product[ValueFraction-1]);", ";"),
        (
            "the result rounds down",
            "\n                       + SumWidth'(value[Drop-1]);",
            ";",
        ),
        ("always one bank", "if (bank_i) base", "if (1'b0) base"),
        ("always one bank is accessed", "(access_bank_i ? AddressWidth'(Entries) : '0)", "('0)"),
        ("as many maps as there is room for", "last_q <= map_count_i", "last_q <= 4'(MapCount)"),
        ("a write in a reset", "write_i && !rst_i;", "write_i;"),
        ("the last row begins", "row_q       <= '1;", "row_q       <= '0;"),
        ("a filled node is not told", "|| first_q[MapWidth] || second", "|| second"),
        ("filled without maps", "filled_q && enable_i;", "filled_q;"),
        ("corrects without maps", "if (enable_i) begin", "if (1'b1) begin"),
        ("wraps around", "<= fits              ?", "<= 1'b1              ?"),
        ("no reset", "      state_q <= IDLE;\n    end\n  end\n", "    end\n  end\n"),
    ),
    *faults(
        "rtl/geometry/triangulate.sv",
        ("n = 0 has a range", "|| numerator_q == '0 ||", "||"),
        ("confidence turns over", "|quotient[RangeWidth-1:8] ? '1 :", "1'b0 ? '1 :"),
        ("confidence without a range", "in_range_q ? c_obj : '0", "c_obj"),
        ("printed as by tolerance", "by_snr_q ? share_q : by_tolerance", "by_tolerance"),
        ("printed over sigma_z", "by_snr_q ? DivisorWidth'(1) :", "1'b0 ? DivisorWidth'(1) :"),
        ("a share of sigma_z", "SHARE:   dividend = DividendWidth'(scale_q);", ""),
        ("gradient's sign", "move_q - GradientWidth'", "move_q + GradientWidth'"),
        ("x beyond its format", "&& x_fits && z_fits;", "&& z_fits;"),
        ("a saturated offset is a place", "&& !saturated_q &&", "&&"),
        ("x and z swapped", "LengthWidth'(x_q) : '0", "LengthWidth'(z_q) : '0"),
        ("a flag without a position", "measured_q && no_range_q;", "no_range_q;"),
        ("a drop is forgotten", "(missing_q || drop) && !accept", "drop && !accept"),
        ("full though it is taken", "full = valid_o && !ready_i", "full = valid_o"),
        ("no reset of missing", "      missing_q    <= 1'b0;\n", ""),
        ("no reset of valid", "      dropped_o    <= 1'b0;\n      valid_o      <= 1'b0;", ""),
    ),
    # ---- rtl/mirror ----
    *faults(
        "rtl/mirror/scan_angle.sv",
        ("a step of the inverse length", "31'sd536887218", "31'sd536887217"),
        ("the table's 1.0 for a power of two", "31'sd536887218", "31'sd536870912"),
        ("even harmonics", "{phase_i[vrscan_pkg::PhaseWidth-2:0], 1'b0}", "phase_i"),
        ("phi_k from the other side", "turn_q - shift", "turn_q + shift"),
        ("sine for cosine", "b = FactorWidth'(cosine)", "b = FactorWidth'(sine)"),
        (
            "constants of the next harmonic",
            "n[StepWidth-3:0], next_q[1:0]}",
            "n[StepWidth-3:0], next_q[1:0] ^ 2'd1}",
        ),
        ("the last harmonic forgotten", "(Harmonics - 1)", "(Harmonics - 2)"),
        ("sum of the phase before", "sum_q        <= '0;\n", ""),
        ("rounds down", "(SumWidth + 1)'(1 << (AngleDrop - 1))", "(SumWidth + 1)'(0)"),
        (
            "products to nearest",
            "SumWidth'(product >>> Fraction)",
            "SumWidth'((product + (ProductWidth'(1) << (Fraction - 1))) >>> Fraction)",
        ),
        (
            "overflow a step late",
            "<= AngleSumWidth'(AngleMax) &&",
            "<= AngleSumWidth'(AngleMax) + 1 &&",
        ),
        ("overflow untold", "overflow_o <= !fits;", "overflow_o <= 1'b0;"),
        (
            "saturates to the wrong end",
            "angle_q[AngleSumWidth-1] ? ~AngleMax : AngleMax",
            "angle_q[AngleSumWidth-1] ? AngleMax : ~AngleMax",
        ),
        ("amplitude of a later phase", "(amplitude_q)) <<<", "(amplitude_i)) <<<"),
        ("waves of the phase before", "assign clear = rst_i || valid_i", "assign clear = rst_i"),
        ("no reset of the pipelines", "assign clear = rst_i || valid_i", "assign clear = valid_i"),
        (
            "a result after a new start",
            "      valid_o      <= 1'b0;\n    end\n    if (rst_i)",
            "    end\n    if (rst_i)",
        ),
        (
            "a start within the start",
            "prepare_q    <= 1'b1;\n      wave_start_q <= 1'b0;\n      start_q      <= 1'b0;\n",
            "prepare_q    <= 1'b1;\n      wave_start_q <= 1'b0;\n",
        ),
        ("no reset of the result", "      valid_o      <= 1'b0;\n    end\n  end", "    end\n  end"),
        (
            "no reset of its last clock",
            "      done_q       <= 1'b0;\n      valid_o      <= 1'b0;\n    end\n  end",
            "      valid_o      <= 1'b0;\n    end\n  end",
        ),
        (
            "no reset of the start",
            "    if (rst_i) begin\n      prepare_q    <= 1'b0;\n",
            "    if (rst_i) begin\n",
        ),
    ),
    *faults(
        "rtl/mirror/index_capture.sv",
        ("one clock less to settle", "left_q <= 8'd1 : run", "left_q <= 8'd2 : run"),
        (
            "an entry level taken for a crossing",
            "known_q && value_q != level_q",
            "value_q != level_q",
        ),
        ("a glitch forgotten", "burst_q && value_q == level_q", "1'b0"),
        (
            "missing a clock late",
            "(period_max) - (TimeWidth + 1)'(1)",
            "(period_max)",
        ),
        ("a period without a ceiling", "mirror_i.period_max_clks > PeriodCeilingClks", "1'b0"),
        ("a width without a ceiling", "mirror_i.width_max_clks > PeriodCeilingClks", "1'b0"),
        ("a doubled one unseen", "before_outward_q == crossing_outward_q", "1'b0"),
        ("alive after a deadline", "(alive_o && !late)", "alive_o"),
        (
            "an early one let through",
            "(early || crossing_age_q[AgeWidth]);\n  assign doubled",
            "(crossing_age_q[AgeWidth]);\n  assign doubled",
        ),
        ("no reset of the pair", "      pending_q          <= 1'b0;\n", ""),
    ),
    *faults(
        "rtl/mirror/mirror_phase.sv",
        ("the outward kept after a fault", "if (broken_i) pending_q <= 1'b0;", ""),
        ("the last entry not held", "if (index_q != '1) index_q", "index_q"),
        ("the rate not rounded", "middling_q >>> by_q3", "middling_q >>> (by_q3 | 2'd1)"),
        (
            "never acquires again",
            "assign acquire = !tracking_q || beyond_q || anew_q;",
            "assign acquire = !tracking_q;",
        ),
        ("the middle a bit off", "first_q + (distance_q >> 1)", "first_q + (distance_q >> 1) + 1"),
        ("no reset of the tracking", "      tracking_q  <= 1'b0;\n", ""),
    ),
    *faults(
        "rtl/mirror/mirror_drive.sv",
        (
            "a runt at a stop",
            "assign keep     = drive_o && high_q",
            "assign keep     = 1'b0 && high_q",
        ),
        ("RUN without settling", "index_alive_i && settled_i", "index_alive_i"),
        ("a RUN without a ceiling", "mirror_limits_i.lost_timeout > LostCeilingClks", "1'b0"),
        (
            "a search without a ceiling",
            "mirror_limits_i.settle_timeout > SettleCeilingClks",
            "1'b0",
        ),
        (
            "the cause of the fault",
            "state_q == Sweep  ? FaultWidth'(vrscan_pkg::FaultSweep)",
            "state_q == Settle ? FaultWidth'(vrscan_pkg::FaultSweep)",
        ),
        (
            "the word wraps below zero",
            "else if (sum_q[SumWidth-1]) word_o <= '0;",
            "else if (1'b0) word_o <= '0;",
        ),
        ("a level without a ceiling", "32'(level_i) > LevelCeiling ?", "1'b0 ?"),
        (
            "a sweep's level without a ceiling",
            "32'(mirror_limits_i.sweep_level) > LevelCeiling ?",
            "1'b0 ?",
        ),
        ("a duty without a ceiling", "32'(mirror_limits_i.duty) > DutyCeiling ?", "1'b0 ?"),
        ("level after a fault", "if (!active_d) level_o <= '0;", "if (1'b0) level_o <= '0;"),
        (
            "no reset of the pin",
            "u_level_pin (\n    .clk_i, .rst_i,",
            "u_level_pin (\n    .clk_i, .rst_i(1'b0),",
        ),
    ),
    *faults(
        "rtl/mirror/amplitude_control.sv",
        ("windup", "stands_q ? '0 : TermWidth'(product)", "TermWidth'(product)"),
        (
            "a settled limit beyond equality",
            "e_size_q <= mirror_i.settle_limit",
            "e_size_q < mirror_i.settle_limit",
        ),
        ("a shock at equality", "e_size_q > mirror_i.shock", "e_size_q >= mirror_i.shock"),
        ("the trim the other way", "more_new_q == mirror_i", "more_new_q != mirror_i"),
        (
            "no largest step",
            "> mirror_i.trim_step ? mirror_i.trim_step :",
            "> mirror_i.trim_step ? TrimStepWidth'(rate_q) :",
        ),
        ("a fault keeps the confidence", "unsettled || index_fault ? '0", "unsettled ? '0"),
    ),
    *faults(
        "rtl/mirror/mirror_loop.sv",
        (
            "half a clock forgotten",
            "centre_half_o ? vrscan_pkg::TurnWidth'(increment) >> 1 : '0",
            "'0",
        ),
        ("harmonics that change at work", ".busy_i(centre_q || scanning_q)", ".busy_i(1'b0)"),
        ("the flag of an angle that saturates", "unsettled || overflow", "unsettled"),
        ("a fault of the index unheard", "missing || doubled || impossible", "missing || doubled"),
    ),
    *faults(
        "rtl/timing/line_trigger.sv",
        ("the laser a clock longer", "if (ahead_q == pulse_end_q)", "if (time_q == pulse_end_q)"),
        (
            "a pulse of no clocks",
            "line_i.pulse_delay_clks != '0 || line_i.pulse_clks != '0",
            "1'b1",
        ),
        ("the laser on after a stop", "      laser_o         <= 1'b0;\n", ""),
        (
            "a centre of odd pulses",
            "half_q           <= line_i.pulse_clks[0];",
            "half_q           <= 1'b0;",
        ),
        ("an overrun unseen", "wrap_q && (pulse_left_q ||", "wrap_q && (1'b0 ||"),
        ("a step beyond the largest", "rounded_q[RoundedWidth-1:StepTop] != '0", "1'b0"),
    ),
    *faults(
        "rtl/mirror/motion_map.sv",
        ("the offset rounds down", " + PhaseWidth'(offset_i[OffsetDrop-1]);", ";"),
        (
            "the offset from the other side",
            "(offset_q - motion_i.drive_phase)",
            "(motion_i.drive_phase - offset_q)",
        ),
        ("products round down", "dropped + PhaseWidth'(half)", "dropped"),
        (
            "the half of a_k for phi_k",
            "of_phi_q ? product[PhiDrop-1] : product[MotionDrop-1]",
            "product[MotionDrop-1]",
        ),
        ("base values forgotten", "sum_q     <= base_q + moved_q", "sum_q     <= moved_q"),
        (
            "a negative a_k is a large one",
            "PhaseWidth'(signed'(motion_i.motion_a[MotionWidth*n+:MotionWidth]))",
            "PhaseWidth'(motion_i.motion_a[MotionWidth*n+:MotionWidth])",
        ),
        ("a_k wraps", "fits   = signs == '0 || signs == '1", "fits   = 1'b1 || signs == '0"),
        ("a_k saturates to the wrong end", "? ~MotionMax : MotionMax", "? MotionMax : ~MotionMax"),
        ("a_k for phi_k", "step_q[Done-1:Harmonics] != '0", "step_q[Done-1:Harmonics+1] != '0"),
        ("a result of the next kind", "if (store_q && of_phi_q2)", "if (store_q && of_phi_q)"),
        ("busy is nothing", "commit = waiting_q && (!busy_i || renewing_o)", "commit = waiting_q"),
        ("the last product forgotten", "store_q && step_q[Done]", "store_q && step_q[Done-1]"),
        (
            "results again and again",
            "      waiting_q <= 1'b0;\n      mapped_q  <= 1'b1;",
            "      mapped_q  <= 1'b1;",
        ),
        ("base values come back", "      mapped_q  <= 1'b1;\n", ""),
        (
            "results that wait survive a start",
            "prepare_q <= 1'b1;\n      waiting_q <= 1'b0;\n",
            "prepare_q <= 1'b1;\n",
        ),
        ("products of the offset before", "(rst_i || start),", "(rst_i),"),
        ("no reset of the products", "(rst_i || start),", "(start),"),
        (
            "a start goes on with the step",
            "      step_q    <= (Done + 1)'(1);\n      prepare_q <= 1'b1;",
            "prepare_q <= 1'b1;",
        ),
        ("no reset before the start", "      prepare_q <= 1'b0;\n", ""),
        ("no reset of the start", "      start_q   <= 1'b0;\n", ""),
        ("no reset of the sum", "      add_q     <= 1'b0;\n", ""),
        ("no reset of the last clock", "      store_q   <= 1'b0;\n", ""),
        (
            "no reset of what waits",
            "      waiting_q <= 1'b0;\n      mapped_q  <= 1'b0;",
            "mapped_q  <= 1'b0;",
        ),
        ("results survive a reset", "      mapped_q  <= 1'b0;\n", ""),
        (
            "base values only with results",
            "    end else if (!mapped_q) begin",
            "    end else if (1'b0) begin",
        ),
    ),
    # ---- the chain's wires ----
    *faults(
        "rtl/vrscan.sv",
        (
            "the laser's limits at their ceilings",
            ".laser_limits_i(laser_limits)",
            ".laser_limits_i('1)",
        ),
        ("a host that is always heard", ".alive_i(alive || host_valid_i)", ".alive_i(1'b1)"),
        ("a laser that sees no point", ".point_valid_i(seen_valid_q)", ".point_valid_i(1'b0)"),
        (
            "a mirror that runs backwards for the laser",
            ".phase_i(mirror_status",
            ".phase_i(~mirror_status",
        ),
        ("the direction of a point", ".inward_i(inward_line)", ".inward_i(!inward_line)"),
        ("the power of a point", ".power_i(power_line)", ".power_i(16'd1)"),
        ("the mirror's confidence", "e_i(mirror_confidence)", "e_i(~mirror_confidence)"),
        (
            "a lens that sees no point",
            ".rst_i(rst_focus_control), .valid_i(seen_valid_q)",
            ".rst_i(rst_focus_control), .valid_i(1'b0)",
        ),
        ("time stands", "uptime_q + 48'd1", "uptime_q + 48'd0"),
    ),
    *faults(
        "rtl/vrscan.sv",
        ("a lens that stands still", ".lens_i(focus_status.focus_position)", ".lens_i('0)"),
        ("no maps", ".map_i(map_q)", ".map_i('0)"),
        ("no nodes", ".map_table_i(map_table)", ".map_table_i('0)"),
        test="board_commit",
        only="maps",
    ),
    *faults(
        "rtl/vrscan_chain.sv",
        ("mirror's flags untold", "= line_q.mirror_flags;", "= '0;"),
        ("a filled node is not told", "map_i.map_enable && map_filled\n", "1'b0\n"),
        ("filled where nothing is measured", "\n" + 55 * " " + "&& placed.measured;", ";"),
        ("the lens stands still", "map_i.map_follow ? placed.line.lens :", "1'b0 ? '0 :"),
        ("the maps follow a later line", "? placed.line.lens :", "? line_q.lens :"),
        (
            "mirror's flags of a later line",
            "    point.flags[vrscan_pkg::FlagNoNoise] = no_noise;\n",
            "    point.flags[vrscan_pkg::FlagNoNoise] = no_noise;\n"
            "    point.flags[vrscan_pkg::FlagNotRunning+:3] = line_q.mirror_flags;\n",
        ),
        ("mirror's flags a clock late", "= line_q.mirror_flags;", "= line_i.mirror_flags;"),
        (
            "noise of a later line",
            ".noise_i(peak.noise),\n    .width_i",
            ".noise_i(noise),\n    .width_i",
        ),
        (
            "flag of a later line",
            "    point.flags[vrscan_pkg::FlagNoNoise] = no_noise;\n",
            "    point.flags[vrscan_pkg::FlagNoNoise] = no_noise;\n"
            "    point.flags[vrscan_pkg::FlagRowStatistics] = row_statistics;\n",
        ),
        ("no flag", "    point.flags[vrscan_pkg::FlagNoNoise] = no_noise;\n", ""),
        ("lost lines untold", "FlagLinesLost] = lost;", "FlagLinesLost] = 1'b0;"),
        ("angle a clock late", "begun.line   = line_q;", "begun.line   = line_i;"),
        (
            "sigma_z of nothing",
            ".sigma_z_o(sigma_z),",
            ".sigma_z_o(),",
        ),
        (
            "does not wait for sigma",
            "positioned) && (have_confidence_q || judged)\n",
            "positioned)\n",
        ),
        (
            "position of nothing",
            "measured ? vrscan_pkg::PositionWidth'(position) : '0",
            "vrscan_pkg::PositionWidth'(position)",
        ),
        ("lines may come too fast", "(LineLength >= LinePeriod ? 0 : LinePeriod)", "(0)"),
        ("two passes too fast", "(LineLength >= TwoPeriod ? 0 : TwoPeriod)", "(0)"),
        ("fits too fast", "(LineLength >= FitPeriod ? 0 : FitPeriod)", "(0)"),
        ("a fit does not wait", "!peak_i.window_fit || aged_q", "1'b1"),
        ("first window for the second", "if (second_q) begin", "if (1'b0) begin"),
        ("drops are not reset", "if (rst_i) dropped_count_q <= '0;", ""),
        (
            "drops wrap",
            "vrscan_pkg::counted(dropped_count_q, CountWidth)",
            "16'((dropped_count_q + 16'd1) % (1 << CountWidth))",
        ),
    ),
    *faults(
        "rtl/geometry/distortion.sv",
        ("k1 and k2 swapped", "FactorWidth'(geometry_i.k2)", "FactorWidth'(geometry_i.k1)"),
        test="chain_lines",
    ),
    *faults(
        "rtl/geometry/free_interval.sv",
        ("from is rounded down", "FreeWidth'(product[FractionWidth-1:0] != '0)", "FreeWidth'(0)"),
        ("an empty neighbour is taken", " || entry_from_q >= entry_to_q;", ";"),
        ("the last entry has a next one", ">= (AngleWidth - FractionWidth)'(LastEntry)", "> '1"),
        ("no light is a level", "none_q <= empty_q || dark_q ||", "none_q <= empty_q ||"),
        ("a result after a new start", "stage_q[5] && !valid_i;", "stage_q[5];"),
        ("no reset of the stages", "      stage_q <= '0;\n      valid_o", "      valid_o"),
    ),
    *faults(
        "rtl/vrscan_chain.sv",
        ("free on a saturated line", "&& !peak.flags[vrscan_pkg::FlagSaturated]\n", "\n"),
        ("free with a flag of the mirror", " && peak.line.mirror_flags == '0;", ";"),
        ("another S/N", ".snr_i(placed.snr)", ".snr_i(placed.background)"),
        ("half of the printed confidence", " && geometry_i.c_obj_gain == '0", ""),
        ("an interval without confidence", "c_sfm != '0 ? free_to : '0;", "free_to;"),
        test="chain_lines",
    ),
    *faults(
        "rtl/timing/line_tag.sv",
        ("a cut pulse keeps its power", "ended && last_centre_q == exposed_line_q", "1'b0"),
        ("another line's power", "ended && last_centre_q == exposed_line_q", "ended"),
    ),
    *faults(
        "rtl/geometry/triangulate.sv",
        ("n0 and n1 swapped", "RoundedWidth'(geometry_i.n0)", "RoundedWidth'(geometry_i.n1)"),
        ("d1 and e1 swapped", "RoundedWidth'(geometry_i.d1)", "RoundedWidth'(geometry_i.e1)"),
        test="vrscan_chain",
    ),
    *faults(
        "rtl/peak/peak_confidence.sv",
        ("gain of another", "1'b0, peak_i.c_sfm_gain", "1'b0, peak_i.k_height"),
        test="chain_lines",
    ),
    *faults(
        "rtl/peak/phase_correlate.sv",
        ("period fixed", "(!(peak_i.period_n || peak", "(!(1'b1 || peak"),
        test="chain_lines",
    ),
    *faults(
        "rtl/vrscan_pkg.sv",
        ("sigma's constant", "SigmaGain = 24873230", "SigmaGain = 24973230"),
        ("stages take too long", "MinPeriodOverhead = 510", "MinPeriodOverhead = 300"),
        ("the triangle is busy", "TwoPassOverhead = 860", "TwoPassOverhead = 849"),
        test="vrscan_chain",
    ),
    # ---- a commit ----
    *faults(
        "rtl/link/commit_control.sv",
        ("an entry is not copied", "IndexWidth'(Entries - 1)", "IndexWidth'(Entries - 2)"),
        ("lines may enter", "          hold_o  <= 1'b1;\n", ""),
        ("lines are inside", "          if (empty_i) begin", "          begin"),
        ("the harmonics are old", "default: if (!renewing_i) begin", "default: begin"),
        ("no other bit", "<= !commit_status_o.configuration;", "<= commit_status_o.configuration;"),
    ),
    *faults(
        "rtl/vrscan_chain.sv",
        ("a line in a hold", "assign skip = hold_i || !fresh_q", "assign skip = !fresh_q"),
        ("a line that a hold began", "    if (hold_i) fresh_q <= 1'b0;\n", ""),
        ("the lines before are known", "forget_q <= take_i || rst_i;", "forget_q <= rst_i;"),
        ("the last line waits", "hold_i && inside_q == 4'd1;", "1'b0;"),
        ("empty with a point inside", "inside_q == '0;\n  always", "inside_q <= 4'd1;\n  always"),
        ("always one configuration", "= configuration_i;", "= 1'b0;"),
    ),
    *faults(
        "rtl/sensor/line_receiver.sv",
        (
            "a skipped line is measured",
            "&& !over && !is_early && !skip_i;",
            "&& !over && !is_early;",
        ),
        ("a skip hides a fault", "!over && !is_early && skip_i;", "skip_i;"),
        (
            "too early for lines that are out",
            "if (forget_i) too_early_q <= 1'b0;\n    else if",
            "if",
        ),
    ),
    *faults(
        "rtl/timing/line_tag.sv",
        ("superseded for ever", "    if (centre_i) superseded_q[centre_index] <= 1'b0;\n", ""),
        ("never superseded", "    if (superseding_i) superseded_q <= '1;\n", ""),
    ),
    *faults(
        "rtl/mirror/mirror_loop.sv",
        ("harmonics of the old motion", ".renew_i(take_q[TakeClks-1])", ".renew_i(1'b0)"),
        ("harmonics a clock too soon", "unsigned TakeClks = 3;", "unsigned TakeClks = 2;"),
        ("light between two facets", "laser && !dark_q;", "laser;"),
        ("an angle between two facets", "overflow || line_outside_q", "overflow"),
        ("a pulse cut by the facet's end", "if (!laser) dark_q <= outside;", "dark_q <= outside;"),
        ("a facet of a whole turn", "centre_phase >> motion_i.scan_facet", "centre_phase"),
        ("the end of the span outside of it", "> motion_i.scan_span", ">= motion_i.scan_span"),
    ),
    *faults(
        "rtl/mirror/motion_map.sv",
        ("a renewal waits for the angle", "&& (!busy_i || renewing_o);", "&& !busy_i;"),
        (
            "a renewal of nothing",
            "(renew_i && known_q);\n    if (start)",
            "renew_i;\n    if (start)",
        ),
    ),
    *faults(
        "rtl/mirror/mirror_phase.sv",
        ("another table is averaged in", "      anew_q     <= 1'b1;\n", ""),
        (
            "a pair of two tables",
            "        step_q      <= IDLE;\n        start_q     <= 1'b0;\n",
            "",
        ),
        (
            "the outward of another table",
            "      pending_q  <= 1'b0;\n      anew_q ",
            "      anew_q ",
        ),
        ("the same table is another one", "renew_i && table_i.table_changed;", "renew_i;"),
        ("the bank in use is written", "{table_i.table_write_bank,", "{table_i.table_bank,"),
        ("always one bank", "{table_i.table_bank, index_q}", "{1'b0, index_q}"),
    ),
    *faults(
        "rtl/geometry/free_interval.sv",
        (
            "the bank in use is written",
            "{free_table_i.free_table_write_bank,",
            "{free_table_i.free_table_bank,",
        ),
        ("always one bank", "{free_table_i.free_table_bank, address_q}", "{1'b0, address_q}"),
    ),
    *faults(
        "rtl/peak/peak_neighbours.sv",
        ("a flush is not heard", "(flush_i || waited_q", "(waited_q"),
    ),
    *faults(
        "tb/devices/odd_registers.sv",
        ("what waits is written meanwhile", "rule_q.commit && waiting_i", "1'b0 && waiting_i"),
        (
            "the bank in use is written",
            "held_table_write_bank <= !bank_i;",
            "held_table_write_bank <= bank_i;",
        ),
        (
            "it takes effect at once",
            "if (held_take) held_o.held <= held_q.held;",
            "held_o.held <= held_q.held;",
        ),
        (
            "the bank in use is written by the host",
            "access_o.access_bank == held_o.held_bank",
            "access_o.access_bank == held_q.held_bank",
        ),
        (
            "a node goes into another bank",
            "elsewhere_o.elsewhere_access_bank <= access_o",
            "elsewhere_o.elsewhere_access_bank <= ~access_o",
        ),
        test="register_file",
        only="odd",
    ),
    # ---- the instrument on a wire ----
    *faults(
        "tb/devices/odd_registers.sv",
        (
            "a read of a table's address keeps",
            "keep_q[0] <= step_q[9] && read",
            "keep_q[0] <= step_q[9]",
        ),
        ("an access in an access", "bus_valid_i && step_q == '0;", "bus_valid_i;"),
        ("the largest value is too large", "value > rule_q.maximum", "value >= rule_q.maximum"),
        ("an address of the upper half", "address_q[15:10] == '0;", "address_q[14:10] == '0;"),
        test="register_file",
        only="odd",
    ),
    *faults(
        "rtl/sensor/test_line.sv",
        ("the place LineLength itself", "moved_q >= Length", "moved_q > Length"),
        (
            "a place rounded down",
            "+ FullWidth'(signed'({1'b0, product[Fraction-1]}))",
            "+ FullWidth'(0)",
        ),
    ),
    *faults(
        "rtl/sensor/pixel_fifo.sv",
        ("as many words as wait for the sensor", "? 64'(PixelHz) - 64'(ClockHz) :", "? 64'd0 :"),
        ("a flush in a flush", "&& !flush_q && !acknowledge_q2;", "&& !flush_q;"),
        ("what had not been read stays", "      read_valid_q     <= 1'b0;\n", ""),
        ("the rest of a line", "      drop_q <= 1'b1;  // what", "      drop_q <= 1'b0;  // what"),
    ),
    *faults(
        "rtl/timing/line_tag.sv",
        (
            "a lens of another time",
            "tag_o.lens         <= centre_q2.lens;",
            "tag_o.lens <= lens_i;",
        ),
        ("an exposure is forgotten", "WaitWidth'(ended_q && !full);", "WaitWidth'(1'b0);"),
        ("what was read out is unread", "if (ended_q && full && unread", "if (ended_q && unread"),
        ("the last exposure whatever the lag", "<= lines[wanted];", "<= lines[!ended_q];"),
        ("any number of exposures", "&& waiting == WaitWidth'(lag_q) + WaitWidth'(1);", ";"),
        ("a wrong first readout is forgiven", "== FIRST) state_q <= LOST;", "== FIRST) ;"),
        ("one good readout mends all", "&& state_q == FIRST) state_q <=", ") state_q <="),
        ("another lag in mid-run", "sensor_i.readout_lag) state_q <= LOST;", "lag_q) ;"),
        ("old lines count", "? sensor_i.readout_lag : '0;", "? '0 : '0;"),
        ("the age goes on", "if (start_q[2]) age_q <=", "age_q <="),
        ("a clock too early", "age_q >= TimeWidth'(", "age_q + TimeWidth'(1) >= TimeWidth'("),
        ("no readout is too late", "&& age_q <= TimeWidth'(sensor_i.readout_max_clks);", ";"),
        (
            "an untimely line keeps its angle",
            "angle_match_q && timely_q && !tag",
            "angle_match_q && !tag",
        ),
        ("an untimely line is not counted", "|| (due_q[Judge] && !timely_q)) begin", ") begin"),
        (
            "what waited waits behind a start",
            "      waiting_q <= '0;\n      stale_q   <=",
            "      stale_q   <=",
        ),
        ("a tag changes in its line", "timely_q && !tagged_q", "timely_q"),
        (
            "the last line's angle at a new start",
            "&& start_q == '0\n                      && !line_start_i;",
            "&& !line_start_i;",
        ),
    ),
    *faults(
        "rtl/points/point_packer.sv",
        ("no room between records of a batch", "open || room_q;", "room_q;"),
        ("the line after the expected one", "line_q - base_q;", "line_q - base_q + 32'd1;"),
        (
            "no room for a header",
            "BufferBytes - HeaderBytes - MostFull",
            "BufferBytes - MostFull",
        ),
        ("a gap of 256 lines", "line_q != expected_q;", "line_q[7:0] != expected_q[7:0];"),
    ),
    *faults(
        "rtl/link/uart_link.sv",
        ("streams at a new rate", ".hold_i (wanted_q || trial_q)", ".hold_i (wanted_q)"),
        ("a rate before the reply is out", "wanted_q && quiet && quiet_q == '1", "wanted_q"),
        ("any frame makes a rate hold", "frame_done && frame_status", "frame_done || frame_status"),
        (
            "no 0x00 after a rate that got no frame",
            "      lead_q      <= 1'b1;\n      fallbacks_q",
            "      fallbacks_q",
        ),
        (
            "a break keeps the rate",
            "if (broken) begin\n      step_now_q <= DefaultStep;\n",
            "if (broken) begin\n",
        ),
        ("a break is a bad byte, too", "if (framing && !broken)", "if (framing)"),
    ),
    *faults(
        "rtl/link/command_queue.sv",
        ("a place more", "used != PlaceWidth'(Places - 1)", "1'b1"),
        ("a halt while one is executed", "if (!executed_q || release_i) oldest_q", "oldest_q"),
        ("bad frames take all places", ": !used[PlaceWidth-1]);", ": used != '1);"),
    ),
    *faults(
        "rtl/link/command_executor.sv",
        ("a write without a check", "check_q   <= 1'b1;", "check_q   <= 1'b0;"),
        ("a halt is forgotten", "waits_i && !halt_i;", "waits_i;"),
        (
            "the address of the next word",
            "{address_q, 8'd0, 8'(status_q)",
            "{base_q, 8'd0, 8'(status_q)",
        ),
    ),
    *faults(
        "rtl/link/command_server.sv",
        (
            "a halt keeps the frames",
            ".done_i, .status_i, .halt_i,",
            ".done_i, .status_i, .halt_i(1'b0),",
        ),
        ("a frame is never released", ".release_i(release_frame)", ".release_i(1'b0)"),
        ("lengths of the last frame", ".length_i(length)", ".length_i('0)"),
    ),
    *faults(
        "rtl/link/line_capture.sv",
        ("a wait without end", "&& ahead != '1;", ";"),
        ("a line that has wrapped", "borrow_q <= above[8];", "borrow_q <= 1'b0;"),
        ("no wait for the next line", "+ vrscan_pkg::NeighbourClks;", "+ 0;"),
    ),
    *faults(
        "rtl/actuators/laser_control.sv",
        ("a cut line keeps its power", "? '0 : power_line_o;", "? power_line_o : power_line_o;"),
        ("an interlock is compared with itself", ".second_i(second)", ".second_i(first)"),
        ("one interlock is enough", "first.pulse && second.pulse;", "first.pulse;"),
        ("the power's pin has the start-up level", ".level_i(power_o)", ".level_i(startup_o)"),
    ),
    *faults(
        "rtl/actuators/power_adaptation.sv",
        ("a new power in a pulse", "(pulse_q && !pulse_i)", "!pulse_i"),
        ("a small power of nothing measured stands", "!saturated_q && !measured_q}", "1'b0}"),
    ),
    *faults(
        "rtl/actuators/sigma_delta.sv",
        ("no reset of what is left over", "      sum_q <= '0;\n", ""),
    ),
    *faults(
        "rtl/safety/laser_interlock.sv",
        ("a pulse that has begun is permitted", "&& (permit_q || !pulse_i);", ";"),
        ("pulses without the safeguard", "index_alive_i && scanning_i;", "index_alive_i;"),
        ("start-up light without it", "awake && startup_ok_i && (settling", "awake && (settling"),
        ("a register that nobody compares", "permit_q, cut_q, full_q, armed_q", "permit_q, cut_q"),
        ("a full bucket opens at once", "over || (full_q && level_q != '0)", "over"),
    ),
    *faults(
        "rtl/safety/scan_safeguard.sv",
        ("an edge at a gate's opening", "known_q <= open_q && (", "known_q <= open_q || ("),
        ("one clock less to settle", "run_q == RunWidth'(SettleClks);", "run_q != '0;"),
        ("no ceiling of the time", "clks_q >= ClksWidth'(LightClks - 2);", "1'b0;"),
        ("no ceiling of the turns", "(&turns_q[TurnsFraction-:2]) ||", "1'b0 ||"),
        ("no floor of the turns", "turns_q < {3'b011, (TurnsFraction - 2)'(0)} ||", "1'b0 ||"),
        ("no floor of the period", "clks_q < ClksWidth'(PeriodFloorClks + EdgeClks - 1)", "1'b0"),
        (
            "no floor of the amplitude",
            "assign narrow = turns_q < OuterTurns;",
            "assign narrow = 1'b0;",
        ),
        ("no ceiling of the width", "!narrow && !wide;", "!narrow;"),
        ("a period without a way back", "begun_q && whole_q && !late", "begun_q && !late"),
        ("start-up light without an end", " && on_q < OnWidth'(DarkClks - 2);", ";"),
        ("start-up light without a pause", "enable_i && pause_q == '0;", "enable_i;"),
    ),
    *faults(
        "rtl/safety/laser_guard.sv",
        ("light begins in a request", " && (ok_o || !(pulse || index_light));", ";"),
        ("a trip ends by itself", "(fresh_q && faults == '0);", "fresh_q;"),
        ("an enable without beats", "(!enable && ready) ||", "!enable ||"),
        (
            "a trip is told but once",
            "(fresh_q || fault_o == '0)) fault_o",
            "fault_o == '0) fault_o",
        ),
        ("pulses have no budget", "burst_q >= budget_t'(DutyCost * BurstClks)", "1'b0"),
        ("index light has no budget", "index_q >= budget_t'(IndexClks)", "1'b0"),
        ("a level may stick", "{startup_q >= budget_t'(DutyCost * StartupClks)", "{1'b0"),
        ("a budget comes back at once", "'0 : level - budget_t'(1);", "'0 : '0;"),
        ("voltage stays on the comb", "!silent && !held;", "!silent;"),
        ("a level past the guard", "level_pin_i && moves_q;", "level_pin_i;"),
        ("no beat of its own", "beat_q  <= beat_q + 3'd1;", "beat_q  <= beat_q;"),
    ),
    *faults(
        "rtl/safety/lit_gate.sv",
        ("a light that ends is forgotten", "else if (!lit && left_q", "else if (left_q"),
        ("a pulse opens it", "index_light_i && !pulse_i;", "index_light_i || pulse_i;"),
        ("a level that changes is forgotten", "rst_i || startup_i != startup_q", "rst_i"),
        (
            "one bit of the level is not looked at",
            "startup_i != startup_q",
            "|(startup_i[15:1] ^ startup_q[15:1])",
        ),
        ("no answer is waited for", "left_q <= LeftWidth'(AnswerClks);", "left_q <= '0;"),
    ),
    *faults(
        "rtl/safety/guard_watch.sv",
        ("a dead guard is well", "ok && silent_q != SilentWidth'(BeatClks);", "ok;"),
        (
            "a trip counts every clock",
            "if (fault != '0 && !tripped_q) trip",
            "if (fault != '0) trip",
        ),
        ("a trip is forgotten", "if (fault != '0) fault_o <= fault;", "fault_o <= fault;"),
    ),
    *faults(
        "rtl/safety/laser_heartbeat.sv",
        ("beats of a difference", "if (same_q && !broken_q) beat_q", "if (!broken_q) beat_q"),
        ("a difference is forgotten", "(broken_q && enable_i);", "1'b0;"),
        ("one that runs by itself", "first_i == second_i;", "1'b1;"),
    ),
    *faults(
        "rtl/actuators/focus_filter.sv",
        ("distances fall as they rise", "signed'({delta_q, 1'b0}) >>>", "{delta_q, 1'b0} >>>"),
        (
            "a lapse one early",
            "others_q > focus_i.focus_lapse;",
            "others_q >= focus_i.focus_lapse;",
        ),
        ("a point while the target is at work", "&& !valid_o && !busy_i;", "&& !valid_o;"),
    ),
    *faults(
        "rtl/actuators/focus_target.sv",
        ("a target at once", "(far_q && held_q)", "far_q"),
        ("a position rounded down", "+ PositionWidth'(product[FractionWidth-1])", ""),
        ("a lapse is counted over", "    if (lapse_i) far_count_q <= '0;\n", ""),
    ),
    *faults(
        "rtl/actuators/focus_motor.sv",
        (
            "the reply of a command that was given up",
            "end_of_command && !abandoned_q",
            "end_of_command",
        ),
        ("a retry too few", "if (failures_q == focus_i.focus_retries)", "if (failures_q >= 8'd1)"),
        ("a new target keeps the misses", "            if (changed_q) misses_q <= '0;\n", ""),
        ("no read while the target moves on", "(changed_q && command_read_o)", "changed_q"),
    ),
    *faults(
        "rtl/actuators/focus_control.sv",
        ("the target is not at work", ".busy_i(target_busy)", ".busy_i(1'b0)"),
        ("a lapse is not told", ".lapse_i(lapse)", ".lapse_i(1'b0)"),
        ("no target in AUTOMATIC", ".known_i(target_known)", ".known_i(focus_i.focus_mode[0])"),
    ),
    *faults(
        "rtl/actuators/i2c_master.sv",
        ("the last clock of a recovery", "bit_q >= LAST_CLOCK", "bit_q > LAST_CLOCK"),
        ("a value keeps old bytes", "value = last;", "value = 1'b0;"),
        ("SDA a clock early", "sample_q <= sda_q2", "sample_q <= sda_q"),
        ("a stream goes on", "stream_q ? last_i", "stream_q ? 1'b0"),
    ),
    *faults(
        "rtl/actuators/m3_motor.sv",
        ("a digit below A", "byte_i[2:0] != 3'd0 && ", ""),
        ("a reply without an end", " || index_q == LastByte;", ";"),
        ("any reply is good", "good_q && fits;", "good_q;"),
        ("a position below zero is large", "word_q[31] ? '0 : '1;", "'1;"),
        ("a limit on the way", "(!status_q[19] && ", "(1'b1 && "),
    ),
    *faults(
        "rtl/link/bus_arbiter.sv",
        ("nobody lingers", "linger_q <= LingerWidth'(LingerClks)", "linger_q <= '0"),
        ("the other one first", "waits[1] && !waits[0] &&", "waits[1] &&"),
    ),
    *faults(
        "rtl/axi/axis_points.sv",
        ("losses are not told", "data = lost_q[7:0];", "data = record_i;"),
        ("a record in a full ring", "(begins ? room : taking_q)", "(begins || taking_q)"),
        ("losses are told again", "if (take && ends) lost_q <= '0;", ""),
    ),
    *faults(
        "rtl/axi/axis_lines.sv",
        ("a line that began without room", "line_start_i ? room : taking_q", "room"),
        ("a short line", "ends && !is_short && !over", "ends && !over"),
        ("a gap is not told", "if (unfinished || (ends", "if (1'b0 || (ends"),
    ),
    *faults(
        "rtl/axi/axil_registers.sv",
        ("reads never come first", "!(read_due && writes_q)", "1'b1"),
        ("nothing written, refused", "&& !whole && strobes_q != '0;", "&& !whole;"),
        ("an unknown address", "? DECERR : SLVERR", "? SLVERR : SLVERR"),
    ),
    # ---- contracts: a broken one fails the test ----
    *(
        fault
        for module, what, old, new in (
            ("packet_arbiter", "another byte", "valid_o && data_o == data_q", "data_o != data_q"),
            (
                "bus_arbiter",
                "the other one's",
                "second ? other_q : first_q",
                "second ? first_q : other_q",
            ),
            (
                "axil_registers",
                "another word",
                "!b_stays_q || (s_axil_bvalid &&",
                "!b_stays_q || (!s_axil_bvalid &&",
            ),
            ("m3_motor", "another byte", "ended_q || byte_o ==", "ended_q || byte_o !="),
            ("axis_ring", "a packet one longer", "== Words - 1))", "== Words))"),
            ("frame_encoder", "another payload", "decoded_byte == entry[7:0]", "1'b0"),
            ("frame_decoder", "a byte too soon", "valid_o == byte_due_q2", "valid_o == byte_due_q"),
            ("uart_tx", "the line upside down", "broken_q ? 1'b0 :", "broken_q ? 1'b1 :"),
            ("command_executor", "two at a time", "!bus_valid_o || !waits_q", "!bus_valid_o"),
            (
                "register_file",
                "an answer too late",
                "age_q[13] && !reset_q",
                "age_q[12] && !reset_q",
            ),
            ("peak_isolate", "a window one wider", "+ 32'd1 &&", "+ 32'd2 &&"),
            ("line_buffer", "another pixel", "pixel_o == replayed_q3", "pixel_o != replayed_q3"),
            (
                "divide",
                "a clock too soon",
                "valid_o == (age_q == Latency)",
                "valid_o == (age_q == Latency - 8'd1)",
            ),
            (
                "square_root",
                "rounded down",
                "(radicand <= square + root",
                "(radicand < square + root",
            ),
            ("multiply", "a sum", "a_q * b_q);", "a_q + b_q);"),
            (
                "multiply_fast",
                "a clock too soon",
                "valid_o == due_q[Latency-1]",
                "valid_o == due_q[Latency-2]",
            ),
            ("cordic_vector", "no angle", "zero_o == (longer == '0)", "zero_o == 1'b1"),
            ("scan_angle", "another end", "angle_o == Most || angle_o == ~Most", "angle_o == Most"),
            (
                "distortion",
                "a clock too soon",
                "valid_o == (age_q == Latency)",
                "valid_o == (age_q == Latency - 8'd1)",
            ),
            (
                "free_interval",
                "never none",
                "from_o < to_o || {from_o, to_o} == '0",
                "from_o < to_o",
            ),
            (
                "peak_position",
                "a clock too soon",
                "valid_o == (age_q == Latency)",
                "valid_o == (age_q == Latency - 8'd1)",
            ),
            ("peak_confidence", "no confidence", "!valid_o || clear_q ||", "!valid_o ||"),
            (
                "peak_fit",
                "never moved",
                "position_o == position_q ||\n              (",
                "position_o == position_q || !(",
            ),
            ("peak_neighbours", "the newest one", "user_o == given_q", "user_o == user_q"),
            ("peak_refine", "a window one wider", "+ 32'd1 &&", "+ 32'd2 &&"),
            ("phase_correlate", "a pass more", "{7'd0, width_q, 1'b0}", "{6'd0, width_q, 2'b0}"),
            ("triangulate", "none is dropped", "dropped_o == drop_q", "!dropped_o"),
            ("point_record", "the order turned round", "Bytes - due_q[1]);", "due_q[1]);"),
            ("line_extent", "one is enough", "number < LineLength));", "number < 32'd1));"),
            ("line_receiver", "none was lost", "== (dropped_q || unfinished_q)", "== 1'b0"),
            ("line_statistics", "another line's", "user_o == user_q", "user_o != user_q"),
            (
                "line_trigger",
                "a pulse a clock shorter",
                "!laser_o || pulse <",
                "!laser_o || pulse + 32'd1 <",
            ),
            ("line_tag", "a tag too late", "age_q == 3'd5 || tag_o == bare", "tag_o == bare"),
            (
                "command_queue",
                "none is lost",
                "kept_q < (good ? 3'd7 : 3'd4)",
                "kept_q < (good ? 3'd6 : 3'd4)",
            ),
            ("uart_rx", "no byte with a low stop bit", "!framing_o || valid_o ||", "!framing_o ||"),
            ("point_packer", "a shorter packet", "Most = 8'd240", "Most = 8'd64"),
            ("commit_control", "a wait for nothing", "held_q > EmptyClks));", "held_q == '1));"),
            ("vrscan_chain", "another bit", "point_o.configuration ==", "point_o.configuration !="),
        )
        for fault in faults(
            f"tb/contracts/{module}_contract.sv",
            (what, old, new),
            test=module,
        )
    ),
    # ---- the models, against mathematics ----
    *faults(
        "model/vrscan/fixed/divide.py",
        ("rounds down", "dividend + (divisor >> 1)", "dividend"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/square_root.py",
        ("rounds down", "    root += radicand - root * root > root\n", ""),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/quarter_wave.py",
        ("table at whole steps", "(k + 0.5) * (math", "k * (math"),
        (
            "cosine's slope",
            "cosine_entry = entries[size - 1 - index]",
            "cosine_entry = entries[size - 2 - index]",
        ),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/cordic_vector.py",
        ("angle rounds down", " + (1 << (ANGLE_GUARD - 1))", ""),
        ("magnitude rounds down", "(doubled + 1) >> 1", "doubled >> 1"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/line_statistics.py",
        ("a guard block less", "distance > guard", "distance >= guard"),
        ("sample variance", "np.int64(length * length)", "np.int64(length * (length - 1))"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/phase_correlate.py",
        ("no pedestal for T = N - 1", "x += pedestal * pkg.SINE_AMPLITUDE", "x += 0"),
        ("T = N always", "(width - (not period_n))", "width"),
        ("second harmonic from the wrong side", "start = -(found", "start = (found"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/peak_isolate.py",
        ("any run is a rival", "(self.parts >= least) & (self", "(self"),
        ("a gap ends a run", "for each in (np.add, np.maximum)", "for each in (np.maximum,) * 2"),
        ("only the spread", "np.maximum(spread_term, height_term)", "spread_term"),
        ("broad ones are clear", "clear = ~broad & (", "clear = ("),
        ("S/N at its limit is low", "+ 3)) < least", "+ 3)) <= least"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/peak_position.py",
        ("rounds down", "(phase * period + (1 << (shift - 1)))", "(phase * period)"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/peak_confidence.py",
        ("no shot noise", "variance + kappa * ((", "variance + 0 * (("),
        ("S/N of no height", "snr = np.where(height == 0, 0, snr)", "snr = snr + 0"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/distortion.py",
        ("slope of 2 k1", "(factor + 2 * (factor", "(2 * (factor"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/triangulate.py",
        ("gradient's sign", "shift - _scaled(z, rate)", "shift + _scaled(z, rate)"),
        ("behind has a range", "(numerator <= 0) | (divisor <= 0)", "(divisor <= 0)"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/motion_map.py",
        ("the offset rounds down", "(offset + (1 << (_OFFSET_DROP - 1)))", "offset"),
        ("products round down", "(product + (1 << (drop - 1)))", "product"),
        ("a whole turn", "(2 * _QUARTER - 1)) -", "(4 * _QUARTER - 1)) -"),
        ("a_k wraps", "_MOTION_END, _MOTION_END - 1)", "2 * _MOTION_END, 2 * _MOTION_END)"),
        ("phi_k does not wrap", "_PHI_DROP)) & (_TURN - 1), d", "_PHI_DROP)), d"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/scan_angle.py",
        ("even harmonics", "(2 * n + 1) * phase", "(n + 1) * phase"),
        ("phi_k from the other side", "* phase - phi[", "* phase + phi["),
        (
            "a cosine of the table is 1",
            "total = _lowered(total, INVERSE_LENGTH)",
            "total = total + 0",
        ),
        ("overflow untold", "return angle, angle != exact", "return angle, angle != angle"),
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/fixed/scan_angle.py",
        ("rounds down", "(total + (1 << (drop - 1))) >> drop", "total >> drop"),
        test="scan_angle_accuracy",
    ),
    *faults(
        "model/vrscan/data/contract.py",
        ("one flag too many", "2**pkg.MIRROR_FLAG_WIDTH - 1", "2**pkg.MIRROR_FLAG_WIDTH"),
    ),
    *faults(
        "model/vrscan/data/line_files.py",
        ("flags are dropped", 'arrays.get("mirror_flags", 0)', "0"),
    ),
    *faults(
        "model/vrscan/engines/engine.py",
        (
            "no flags for the model",
            "run_fixed(*given, mirror_flags=raised, maps",
            "run_fixed(*given, maps",
        ),
        test="scan_command",
    ),
    *faults(
        "model/vrscan/registers/chain_registers.py",
        ("offset's sign", "base * cosine - offset * sine", "base * cosine + offset * sine"),
        ("angles round down", "(half / np.pi) + 0.5)", "(half / np.pi))"),
    ),
    *faults(
        "model/vrscan/data/points.py",
        ("variance's format", "VARIANCE_WIDTH - 2 * points", "VARIANCE_WIDTH - 1 * points"),
    ),
    # ---- the equations ----
    *faults(
        "model/vrscan/ideal/geometry.py",
        ("(5): slope of 2 k1", "3.0 * geometry.k1", "2.0 * geometry.k1"),
        ("(3): offset's sign", "+ geometry.offset_mm * across", "- geometry.offset_mm * across"),
        ("(6): not squared", "np.square(range_mm) * position", "range_mm * position"),
        ("parting rays have a range", "(n <= 0.0) | (d <= 0.0)", "(n <= 0.0)"),
        test="geometry",
    ),
    *faults(
        "model/vrscan/ideal/position.py",
        ("(8): X and Y swapped", "np.arctan2(y, x)", "np.arctan2(x, y)"),
        (
            "T and N - 1 swapped",
            "width if period_n else width - 1",
            "width - 1 if period_n else width",
        ),
        (
            "sigma without shot noise",
            "np.square(noise)[:, None] + kappa * signal",
            "np.square(noise)[:, None] + 0 * signal",
        ),
        test="position",
    ),
    *faults(
        "model/vrscan/ideal/position.py",
        ("(8): negative phases", "np.arctan2(y, x) % (2.0 * np.pi)", "np.arctan2(y, x)"),
        test="phase_correlate",
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/ideal/confidence.py",
        ("a whole deviation for half of one", "/ np.sqrt(2.0)", "/ 2.0"),
        ("(10): where there is an object", "np.where(clear, np", "np.where(~clear, np"),
        test="position",
    ),
    *faults(
        "model/vrscan/ideal/free_space.py",
        ("a blur half as wide", "blurred = 0.5 * lens", "blurred = 0.25 * lens"),
        (
            "the other end",
            "beta[:, *(None,) * angle.ndim] - angle)",
            "beta[:, *(None,) * angle.ndim] + angle)",
        ),
    ),
    *faults(
        "model/vrscan/registers/free_table.py",
        (
            "lines through the exact ends",
            "return np.asarray(1.05 * np",
            "return np.asarray(0.0 * np",
        ),
        ("rounded outwards", "np.ceil(np.minimum(near * one, top)) + 1.0", "np.floor(near * one)"),
    ),
    *faults(
        "model/vrscan/engines/shadows.py",
        (
            "nothing is hidden",
            "behind = (nearest < z[:, 1:])",
            "behind = (nearest > 1e9 + z[:, 1:])",
        ),
        ("only its own block", "if abs(other._number - self._number) == 1:", "if other is self:"),
    ),
    *faults(
        "model/vrscan/ideal/statistics.py",
        ("a guard block less", "kept = distance > guard", "kept = distance >= guard"),
        ("the peak counts", "(where * squares).sum", "squares.sum"),
        test="statistics",
    ),
    *faults(
        "model/vrscan/ideal/peak.py",
        ("the smaller term", "np.maximum(k_noise * noise, k", "np.minimum(k_noise * noise, k"),
        ("any run is a rival", "rival = np.zeros(len(begins)", "rival = np.ones(len(begins)"),
        test="statistics",
    ),
    *faults(
        "model/vrscan/ideal/peak.py",
        ("the threshold itself is above", "lines > level[:, None]", "lines >= level[:, None]"),
        test="peak_isolate",
        only=NO_RTL,
    ),
    *faults(
        "model/vrscan/ideal/chain.py",
        ("edge forgotten", "(left == 0) | (right == last)", "(left == 0)"),
        ("flat lines have a peak", "(height <= 0.0) | (height", "(height"),
        (
            "mirror's flags in another order",
            '"INDEX_FAULT", "UNSETTLED")',
            '"UNSETTLED", "INDEX_FAULT")',
        ),
        test="chain",
    ),
]


def verdict(tree: Path, test: str, only: str) -> str:
    """Run one test file in a tree and return "green", "red" or what is wrong with the fault."""
    environment = dict(os.environ) | {
        "PYTHONPATH": str(tree / "model"),
        # A fault and its removal within a second would leave stale byte code.
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "", test]
    command += ["-k", only] if only else []
    with subprocess.Popen(
        command, cwd=tree, env=environment, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as run:  # fmt: skip
        try:
            words, _ = run.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)  # the simulator too
            return "red"
    contract = "Assertion failed in" in words  # which the simulator calls an error
    if ("%Error" in words or "%Warning" in words) and not contract:
        return "does not build"
    return {0: "green", 1: "red"}.get(run.returncode, "does not run")


def attempt(fault: Fault, trees: "queue.Queue[Path]") -> tuple[str, float]:
    """Put a fault into a free tree, judge it, take it out again; return verdict and seconds."""
    start = time.monotonic()
    tree = trees.get()
    file = tree / fault.file
    text = file.read_text()
    try:
        if text.count(fault.old) != 1:
            return f"text found {text.count(fault.old)} times", 0.0
        file.write_text(text.replace(fault.old, fault.new))
        return verdict(tree, fault.test, fault.only), time.monotonic() - start
    finally:
        file.write_text(text)
        trees.put(tree)


def whole(test: str, only: str, trees: "queue.Queue[Path]") -> str:
    """Return the verdict of a test file in a free tree without a fault."""
    tree = trees.get()
    try:
        return verdict(tree, test, only)
    finally:
        trees.put(tree)


def table(words: list[str], jobs: int) -> int:
    """Return 0 when every fault, or every one of the files named by ``words``, is noticed."""
    console = Console()
    chosen = [f for f in FAULTS if not words or Path(f.file).stem in words]
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="mutate-") as place:
        trees: queue.Queue[Path] = queue.Queue()
        for k in range(jobs):
            trees.put(mutant_score.copied(Path(place) / str(k)))
        results: dict[Fault, tuple[str, float]] = {}
        with ThreadPoolExecutor(jobs) as pool:
            # A test that is red without a fault notices none.
            tests = {pool.submit(whole, *each, trees): each[0]
                     for each in {(f.test, f.only) for f in chosen}}  # fmt: skip
            for done in track(as_completed(tests), "tests", len(tests), transient=True):
                if done.result() != "green":
                    console.print(f"mutate: {tests[done]} is {done.result()} without a fault")
                    pool.shutdown(cancel_futures=True)
                    return 1
            waiting = {pool.submit(attempt, fault, trees): fault for fault in chosen}
            for done in track(as_completed(waiting), "faults", len(waiting), transient=True):
                results[waiting[done]] = done.result()

    shown = Table("file", "fault", "test", "verdict", "s", box=None)
    for fault in chosen:
        answer, seconds = results[fault]
        mark = "[green]killed[/]" if answer == "red" else "[red]survived[/]"
        if answer not in ("red", "green"):
            mark = f"[red]{answer}[/]"
        test = Path(fault.test).stem.removeprefix("test_")
        shown.add_row(Path(fault.file).name, fault.what, test, mark, f"{seconds:.0f}")
    console.print(shown)
    bad = [f for f in chosen if results[f][0] != "red"]
    console.print(
        f"mutate: {len(chosen) - len(bad)} of {len(chosen)} faults noticed "
        f"in {time.monotonic() - start:.0f} s"
    )
    return 1 if bad or not chosen else 0


def main() -> int:
    """Take the table, or what is made from the code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", help="only these; all when none is named")
    parser.add_argument(
        "--systematic", type=int, metavar="N", help="N mutants made from the code, not the table"
    )
    parser.add_argument(
        "--reach",
        choices=mutant_score.REACHES,
        default="joined",
        help="how far a survivor goes: its own test, those of joined modules, the virtual board",
    )
    parser.add_argument(
        "--kept", action="store_true", help="run nothing, and show the verdicts that stand"
    )
    parser.add_argument("--seed", type=int, default=1, help="which ones (default 1)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="at once (default: all processors)"
    )
    parser.add_argument(
        "--write", action="store_true", help="put the score into docs/verification.md"
    )
    given = parser.parse_args()
    if given.jobs < 1:
        parser.error(f"--jobs {given.jobs}: at least 1")
    if given.systematic is None:
        if given.write or given.kept:
            parser.error("--write and --kept go with --systematic")
        return table(given.modules, given.jobs)
    if given.systematic < 1:
        parser.error(f"--systematic {given.systematic}: at least 1")
    if given.write and given.modules:
        parser.error("--write needs every module")
    for number in (signal.SIGINT, signal.SIGTERM):  # in a shell's background, too
        signal.signal(number, signal.default_int_handler)
    return mutant_score.main(
        given.systematic,
        given.modules,
        seed=given.seed,
        jobs=given.jobs,
        reach=given.reach,
        kept=given.kept,
        write=given.write,
    )


if __name__ == "__main__":
    sys.exit(main())
