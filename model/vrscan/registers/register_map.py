"""Every register by name, written from rtl/link/registers.toml by scripts/generate.py."""

from dataclasses import dataclass
from typing import Literal

Access = Literal["rw", "strobe", "ro", "counter", "constant"]

_WORD = 32  # bits


@dataclass(frozen=True)
class Register:
    """A register, several of one kind, or a field of a table.

    Attributes:
        name: Of the field in its struct.
        struct: That it is a field of, in register_pkg and as a port; empty of a constant.
        address: Of its first word; of a field, its place in an entry.
        words: All of them; a value of more than 32 bits has two, the lower first.
        count: How many values.
        width: Bits of a value.
        signed: Two's complement; a word is sign-extended.
        access: "rw" and "strobe" can be written; "constant" never changes.
        lock: The register that keeps it as it is, or None.
        reset: Values after a reset; of a constant its value.
        fraction: value = integer / 2**fraction.
        unit: Of the value; empty where it has none.
        minimum: Least integer that it takes.
        maximum: Largest integer that it takes.
        doc: What it means.
    """

    name: str
    struct: str
    address: int
    words: int
    count: int
    width: int
    signed: bool
    access: Access
    lock: str | None
    reset: tuple[int, ...]
    fraction: int
    unit: str
    minimum: int
    maximum: int
    doc: str


@dataclass(frozen=True)
class Window:
    """A table. Field k of entry i is at address + i * stride + k, the last one writes the entry."""

    name: str
    address: int
    entries: int
    stride: int  # words
    fields: tuple[Register, ...]
    lock: str | None
    doc: str


def _one(
    struct: str,
    address: int,
    name: str,
    width: int,
    access: Access,
    doc: str,
    *,
    lock: str | None = None,
    count: int = 1,
    signed: bool = False,
    reset: int = 0,
    fraction: int = 0,
    unit: str = "",
    low: int | None = None,
    high: int | None = None,
) -> Register:
    """Return a register; it takes what its width takes where low and high do not say otherwise."""
    words = count * (2 if width > _WORD else 1)
    least = -(1 << (width - 1)) if signed else 0
    most = least + (1 << width) - 1
    return Register(
        name, struct, address, words, count, width, signed, access, lock, (reset,) * count,
        fraction, unit, least if low is None else low, most if high is None else high, doc,
    )  # fmt: skip


MAP_HASH = 0xE6A86393

# fmt: off
_REGISTERS = (
    _one("", 0x000, "identity", 32, "constant", '"VRSC"', reset=0x56525343),
    _one("", 0x001, "map_hash", 32, "constant", "of this map: what a host has to know to use it",
         reset=0xE6A86393),
    _one("", 0x002, "version", 32, "constant", "major, minor, patch in bits 31..16, 15..8, 7..0",
         reset=0x00000100),
    _one("identity_status", 0x003, "board_id", 16, "ro", "the board"),
    _one("identity_status", 0x004, "clock_hz", 32, "ro", "the clock", unit="Hz"),
    _one("identity_status", 0x005, "line_length", 16, "ro", "LineLength", unit="px"),
    _one("identity_status", 0x006, "pixel_width", 8, "ro", "PixelWidth", unit="bit"),
    _one("identity_status", 0x007, "max_window", 8, "ro", "MaxWindow", unit="px"),
    _one("identity_status", 0x008, "lanes", 8, "ro", "pixels a clock: 1"),
    _one("identity_status", 0x009, "index_oversample", 8, "ro",
         "IndexOversample: samples of the index a clock"),
    _one("identity", 0x00A, "scratch", 32, "rw", "for the host; does nothing"),
    _one("identity_status", 0x00B, "uptime", 48, "ro", "since reset", unit="clk"),
    _one("peak", 0x010, "period_n", 1, "rw", "1: T = N, 0: T = N - 1", lock="lock_calibration",
         reset=1),
    _one("peak", 0x011, "noise_row", 1, "rw", "1: statistics of the row, 0: of the background",
         lock="lock_calibration"),
    _one("peak", 0x012, "k_noise", 16, "rw", "threshold above background, in noise",
         lock="lock_calibration", reset=640, fraction=8),
    _one("peak", 0x013, "k_height", 16, "rw", "the same in heights of the peak",
         lock="lock_calibration", reset=1311, fraction=16),
    _one("peak", 0x014, "snr_min", 16, "rw", "below: LOW_SNR", lock="lock_calibration", reset=2048,
         fraction=8),
    _one("peak", 0x015, "min_width", 8, "rw", "below: TOO_NARROW", lock="lock_calibration",
         reset=3, unit="px", low=3),
    _one("peak", 0x016, "max_width", 8, "rw", "above: TOO_WIDE", lock="lock_calibration",
         reset=255, unit="px", low=3),
    _one("peak", 0x017, "kappa", 18, "rw", "counts an electron, 28 - pixel_width fraction bits",
         lock="lock_calibration", reset=13107),
    _one("peak", 0x018, "c_obj_gain", 24, "rw", "c_obj = snr * gain / 2**16",
         lock="lock_calibration", reset=653),
    _one("peak", 0x019, "c_sfm_gain", 24, "rw", "c_sfm = power * gain / 2**16",
         lock="lock_calibration", reset=255),
    _one("peak", 0x01A, "window_two_pass", 1, "rw", "1: a second window follows the first, T = N",
         lock="lock_calibration"),
    _one("geometry", 0x020, "centre", 32, "rw", "the optical axis", lock="lock_calibration",
         signed=True, reset=1073217536, fraction=20, unit="px"),
    _one("geometry", 0x021, "k1", 26, "rw", "k1 R**2", lock="lock_calibration", signed=True,
         fraction=24),
    _one("geometry", 0x022, "k2", 26, "rw", "k2 R**4", lock="lock_calibration", signed=True,
         fraction=24),
    _one("geometry", 0x023, "even", 1, "rw", "(5) as printed", lock="lock_calibration"),
    _one("geometry", 0x024, "n0", 32, "rw", "n = n0 + n1 s, s = offset / R",
         lock="lock_calibration", signed=True, reset=62302280, fraction=20, unit="mm"),
    _one("geometry", 0x025, "n1", 32, "rw", "of n", lock="lock_calibration", signed=True,
         reset=5021049, fraction=20, unit="mm"),
    _one("geometry", 0x026, "d0", 32, "rw", "d = (d0 + d1 s) cos a + (e0 + e1 s) sin a",
         lock="lock_calibration", signed=True, reset=149435979, fraction=30),
    _one("geometry", 0x027, "d1", 32, "rw", "of d", lock="lock_calibration", signed=True,
         reset=-609734303, fraction=30),
    _one("geometry", 0x028, "e0", 32, "rw", "of d", lock="lock_calibration", signed=True,
         reset=1063292242, fraction=30),
    _one("geometry", 0x029, "e1", 32, "rw", "of d", lock="lock_calibration", signed=True,
         reset=85692568, fraction=30),
    _one("chain", 0x030, "short_count", 16, "counter", "lines with too few pixels"),
    _one("chain", 0x031, "long_count", 16, "counter", "lines with too many pixels"),
    _one("chain", 0x032, "unfinished_count", 16, "counter",
         "lines that another one's start cut off"),
    _one("chain", 0x033, "early_count", 16, "counter",
         "lines that came before the one before could be measured"),
    _one("chain", 0x034, "dropped_count", 16, "counter", "points that nobody took"),
    _one("mirror", 0x040, "mirror_enable", 1, "rw", "1 starts the mirror, 0 stops it"),
    _one("mirror", 0x041, "line_enable", 1, "rw", "1: there are lines"),
    _one("mirror", 0x042, "sweep_word", 40, "rw", "frequency at which the sweep begins",
         fraction=48, unit="turn/clk"),
    _one("mirror", 0x044, "work_word", 40, "rw", "frequency at which it ends", fraction=48,
         unit="turn/clk"),
    _one("mirror", 0x046, "sweep_rate", 32, "rw", "the word falls by rate / 2**16 a clock"),
    _one("mirror", 0x047, "glitch_clks", 8, "rw", "a level of the index is settled after",
         unit="clk"),
    _one("mirror", 0x048, "width_min_clks", 32, "rw", "from outward to inward, at least",
         unit="clk"),
    _one("mirror", 0x049, "width_max_clks", 32, "rw", "from outward to inward, at most",
         unit="clk"),
    _one("mirror", 0x04A, "period_max_clks", 32, "rw", "from outward to outward, at most",
         unit="clk"),
    _one("mirror", 0x04B, "phase_shift", 4, "rw", "the phase follows by error / 2**shift"),
    _one("mirror", 0x04C, "rate_shift", 6, "rw", "the rate follows by error / 2**shift"),
    _one("mirror", 0x04D, "amplitude_shift", 4, "rw",
         "the amplitude follows by difference / 2**shift"),
    _one("mirror", 0x04E, "error_limit", 28, "rw", "a phase error above is acquired anew",
         fraction=28, unit="turn"),
    _one("mirror", 0x04F, "amplitude_set", 26, "rw", "the amplitude to hold", fraction=28,
         unit="turn"),
    _one("mirror", 0x050, "k_p", 18, "rw", "level steps an amplitude step", fraction=16),
    _one("mirror", 0x051, "k_i", 18, "rw", "level steps an amplitude step and period",
         fraction=20),
    _one("mirror", 0x052, "level_low", 20, "rw", "below: the frequency steps", fraction=20),
    _one("mirror", 0x053, "level_high", 20, "rw", "above: the frequency steps", fraction=20),
    _one("mirror", 0x054, "level_nominal", 20, "rw", "to begin with and to return to",
         fraction=20),
    _one("mirror", 0x055, "trim_step", 24, "rw", "of the frequency, word steps a period at most"),
    _one("mirror", 0x056, "trim_gain", 18, "rw", "word steps a level step", fraction=16),
    _one("mirror", 0x057, "trim_up", 1, "rw", "1: the amplitude rises with the frequency"),
    _one("mirror", 0x058, "settle_limit", 26, "rw", "of the amplitude: closer is settled",
         fraction=28, unit="turn"),
    _one("mirror", 0x059, "shock_limit", 26, "rw", "of the amplitude: farther is a shock",
         fraction=28, unit="turn"),
    _one("mirror", 0x05A, "phase_limit", 28, "rw", "of the phase: farther is unsettled",
         fraction=28, unit="turn"),
    _one("mirror", 0x05B, "settle_count", 8, "rw", "good periods until it is settled"),
    _one("mirror", 0x05C, "hold_count", 8, "rw", "good periods that end an index fault"),
    _one("mirror", 0x05D, "confidence_gain", 24, "rw",
         "what an amplitude step takes off the confidence of 255", fraction=20),
    _one("mirror_limits", 0x060, "duty", 16, "rw", "of the drive's square wave",
         lock="lock_mirror", fraction=16),
    _one("mirror_limits", 0x061, "sweep_level", 20, "rw", "of the drive in SWEEP",
         lock="lock_mirror", fraction=20),
    _one("mirror_limits", 0x062, "level_min", 20, "rw",
         "least level of the drive in SETTLE and RUN", lock="lock_mirror", fraction=20),
    _one("mirror_limits", 0x063, "level_max", 20, "rw",
         "largest level of the drive in SETTLE and RUN", lock="lock_mirror", fraction=20),
    _one("mirror_limits", 0x064, "trim_min", 32, "rw",
         "the frequency steps down to work_word + trim_min", lock="lock_mirror", signed=True,
         fraction=48, unit="turn/clk"),
    _one("mirror_limits", 0x065, "trim_max", 32, "rw",
         "the frequency steps up to work_word + trim_max", lock="lock_mirror", signed=True,
         fraction=48, unit="turn/clk"),
    _one("mirror_limits", 0x066, "sweep_timeout", 32, "rw", "longest SWEEP", lock="lock_mirror",
         unit="clk"),
    _one("mirror_limits", 0x067, "settle_timeout", 32, "rw", "longest SETTLE", lock="lock_mirror",
         unit="clk"),
    _one("mirror_limits", 0x068, "lost_timeout", 32, "rw", "the index may be away in RUN",
         lock="lock_mirror", unit="clk"),
    _one("motion", 0x080, "drive_phase", 28, "rw", "where motion_a and motion_phi hold",
         lock="lock_calibration", fraction=28, unit="turn"),
    _one("motion", 0x081, "motion_a", 24, "rw", "a_k", lock="lock_calibration", count=9,
         signed=True, fraction=22),
    _one("motion", 0x08A, "motion_phi", 28, "rw", "phi_k", lock="lock_calibration", count=9,
         fraction=28, unit="turn"),
    _one("motion", 0x093, "motion_da", 24, "rw", "a_k's change with the drive's phase",
         lock="lock_calibration", count=9, signed=True, fraction=22, unit="1/turn"),
    _one("motion", 0x09C, "motion_dphi", 24, "rw", "phi_k's change with the drive's phase",
         lock="lock_calibration", count=9, signed=True, fraction=16, unit="turn/turn"),
    _one("line", 0x0B0, "ratio", 44, "rw", "lines a period of the mirror", fraction=32),
    _one("line", 0x0B2, "exposure_delay_clks", 20, "rw", "start of the exposure", unit="clk"),
    _one("line", 0x0B3, "exposure_clks", 20, "rw", "length of the exposure", unit="clk"),
    _one("line", 0x0B4, "pulse_delay_clks", 20, "rw", "start of the laser's pulse", unit="clk"),
    _one("line", 0x0B5, "pulse_clks", 20, "rw", "length of the laser's pulse", unit="clk"),
    _one("mirror_status", 0x0C0, "mirror_state", 3, "ro",
         "0 OFF, 1 SWEEP, 2 SETTLE, 3 RUN, 4 FAULT"),
    _one("mirror_status", 0x0C1, "mirror_fault", 2, "ro",
         "of the last FAULT: 0 none, 1 sweep, 2 settle, 3 index"),
    _one("mirror_status", 0x0C2, "mirror_word", 40, "ro", "frequency of the drive", fraction=48,
         unit="turn/clk"),
    _one("mirror_status", 0x0C4, "mirror_drive_phase", 48, "ro", "phase of the drive", fraction=48,
         unit="turn"),
    _one("mirror_status", 0x0C6, "mirror_phase", 48, "ro", "phase of the mirror", fraction=48,
         unit="turn"),
    _one("mirror_status", 0x0C8, "mirror_level", 20, "ro", "of the drive", fraction=20),
    _one("mirror_status", 0x0C9, "index_alive", 1, "ro", "the index marks come in time"),
    _one("mirror_status", 0x0CA, "mirror_settled", 1, "ro",
         "amplitude and phase are within their limits"),
    _one("mirror_status", 0x0CB, "mirror_measured", 26, "ro", "the last amplitude", fraction=28,
         unit="turn"),
    _one("mirror_status", 0x0CC, "mirror_error", 28, "ro", "the last error of the phase",
         signed=True, fraction=28, unit="turn"),
    _one("mirror_status", 0x0CD, "missing_count", 16, "counter", "crossings that did not come"),
    _one("mirror_status", 0x0CE, "doubled_count", 16, "counter", "crossings that came twice"),
    _one("mirror_status", 0x0CF, "impossible_count", 16, "counter",
         "crossings at a time that cannot be"),
    _one("mirror_status", 0x0D0, "glitch_count", 16, "counter",
         "pulses of the comparator that were too short"),
    _one("mirror_status", 0x0D1, "overrun_count", 16, "counter",
         "lines that the next one cut off"),
    _one("link", 0x0E0, "uart_step", 24, "strobe",
         "the rate to change to: after the reply to the write, for good with the first good "
         "frame. At reset 3 Mbaud of 100 MHz; uart_step_now says what holds", reset=503316,
         fraction=24, unit="bit/clk", low=1024, high=2097152),
    _one("link_status", 0x0E1, "uart_step_now", 24, "ro", "the rate that holds", fraction=24,
         unit="bit/clk"),
    _one("link_status", 0x0E2, "uart_framing", 16, "counter", "bytes without their stop bit"),
    _one("link_status", 0x0E3, "uart_breaks", 16, "counter",
         "breaks: the line was low for a byte"),
    _one("link_status", 0x0E4, "uart_glitches", 16, "counter", "start bits that were none"),
    _one("link_status", 0x0E5, "uart_fallbacks", 16, "counter",
         "rates at which no good frame came in time"),
    _one("link_status", 0x0E6, "frames_good", 16, "counter", "good ones"),
    _one("link_status", 0x0E7, "frames_crc", 16, "counter", "CRC wrong"),
    _one("link_status", 0x0E8, "frames_malformed", 16, "counter", "cut within a block"),
    _one("link_status", 0x0E9, "frames_too_long", 16, "counter", "more than MaxPayload bytes"),
    _one("link_status", 0x0EA, "frames_too_short", 16, "counter", "no payload"),
    _one("link_status", 0x0EB, "frames_framing", 16, "counter",
         "a byte without its stop bit, or a break, in them"),
    _one("link_status", 0x0EC, "commands_bad", 16, "counter",
         "unknown commands, and those of a wrong length"),
    _one("link_status", 0x0ED, "commands_lost", 16, "counter",
         "commands that came while too many waited"),
    _one("laser", 0x100, "laser_enable", 1, "rw", "light at all; low ends a trip of the watchdog"),
    _one("laser", 0x101, "laser_adapt", 1, "rw", "1: the power follows the peaks, 0: laser_power"),
    _one("laser", 0x102, "laser_shared", 1, "rw", "1: both directions of the scan have one power"),
    _one("laser", 0x103, "laser_power", 16, "rw", "where it does not adapt"),
    _one("laser", 0x104, "laser_power_min", 16, "rw", "of what adapts, at least 1"),
    _one("laser", 0x105, "laser_power_max", 16, "rw", "of what adapts"),
    _one("laser", 0x106, "laser_startup", 16, "rw", "of the start-up channel, for the index"),
    _one("laser", 0x107, "laser_target", 16, "rw",
         "height of a peak over its background; 1 is full scale", fraction=16),
    _one("laser", 0x108, "laser_cut", 14, "rw", "factor after a saturated peak", fraction=14),
    _one("laser", 0x109, "laser_down", 16, "rw", "share of what a peak is too high", fraction=13),
    _one("laser", 0x10A, "laser_up", 16, "rw", "share of what a peak is too low", fraction=13),
    _one("laser", 0x10B, "laser_search", 14, "rw", "a line without a peak: power times 1 + search",
         fraction=14),
    _one("laser", 0x10C, "laser_index_begin", 16, "rw",
         "the index is lit in RUN from this phase of the mirror", fraction=16, unit="turn"),
    _one("laser", 0x10D, "laser_index_end", 16, "rw", "to below this one", fraction=16,
         unit="turn"),
    _one("laser_limits", 0x120, "laser_limit_power", 16, "rw", "of a pulse", lock="lock_laser"),
    _one("laser_limits", 0x121, "laser_limit_startup", 16, "rw", "of the start-up channel",
         lock="lock_laser"),
    _one("laser_limits", 0x122, "laser_limit_pulse_clks", 20, "rw", "length of a pulse",
         lock="lock_laser", unit="clk"),
    _one("laser_limits", 0x123, "laser_limit_drain", 16, "rw", "power on average",
         lock="lock_laser"),
    _one("laser_limits", 0x124, "laser_limit_bucket", 32, "rw",
         "energy at once, power times clocks", lock="lock_laser"),
    _one("laser_limits", 0x125, "laser_watchdog_clks", 32, "rw",
         "dark when the host is silent for so long; 0 is the longest there is", lock="lock_laser",
         unit="clk"),
    _one("laser_status", 0x130, "laser_status", 5, "ro",
         "bits from 0: host heard, guard well, pulses permitted, bucket full, watchdog tripped"),
    _one("laser_status", 0x131, "laser_power_inward", 16, "ro",
         "of the next pulse in the first half turn"),
    _one("laser_status", 0x132, "laser_power_outward", 16, "ro", "in the second"),
    _one("laser_status", 0x133, "laser_cut_count", 16, "counter", "pulses that were too long"),
    _one("laser_status", 0x134, "laser_duty_count", 16, "counter",
         "times that the bucket was full"),
    _one("laser_status", 0x135, "laser_watchdog_count", 16, "counter",
         "times that the host was silent"),
    _one("points", 0x160, "points_batch", 8, "rw", "records a packet, at most what fits",
         reset=24),
    _one("points", 0x161, "points_timeout_clks", 24, "rw",
         "a packet goes out after so long; 0: when it is full", reset=2000000, unit="clk"),
    _one("points_status", 0x162, "points_dropped", 16, "counter", "points that found no room"),
    _one("points_status", 0x163, "capture_busy", 1, "ro", "a raw line is awaited, taken or sent"),
    _one("focus", 0x180, "focus_mode", 2, "rw", "0 OFF, 1 MANUAL, 2 AUTOMATIC", high=2),
    _one("focus", 0x181, "focus_manual", 16, "rw", "the target in MANUAL"),
    _one("focus", 0x182, "focus_average_shift", 4, "rw",
         "the distance is that of 2**shift good points"),
    _one("focus", 0x183, "focus_lapse", 16, "rw",
         "good points after more others on end begin a new average"),
    _one("focus", 0x184, "focus_z_begin", 24, "rw", "distance of the table's entry 0", signed=True,
         fraction=12, unit="mm"),
    _one("focus", 0x185, "focus_z_shift", 4, "rw",
         "from entry to entry 2**(shift + 10) steps of a distance"),
    _one("focus", 0x186, "focus_hysteresis", 16, "rw", "a new target is farther from the old one"),
    _one("focus", 0x187, "focus_hold", 16, "rw", "for so many good points on end"),
    _one("focus", 0x188, "focus_address", 7, "rw", "of the motor on its I2C bus"),
    _one("focus", 0x189, "focus_quarter_clks", 16, "rw", "a quarter of a bit", reset=250,
         unit="clk", low=4),
    _one("focus", 0x18A, "focus_stretch_clks", 24, "rw", "the bus is waited for", reset=2500000,
         unit="clk", low=7),
    _one("focus", 0x18B, "focus_poll_clks", 24, "rw", "between two commands", reset=200000,
         unit="clk"),
    _one("focus", 0x18C, "focus_tolerance", 16, "rw", "in position: not farther from the target"),
    _one("focus", 0x18D, "focus_timeout_clks", 32, "rw", "to reach a target", unit="clk"),
    _one("focus", 0x18E, "focus_retries", 8, "rw",
         "of a command that failed, of a target that was not reached"),
    _one("focus_status", 0x1A0, "focus_state", 3, "ro",
         "0 OFF, 1 WAIT for a target, 2 MOVE, 3 HOLD, 4 FAULT until OFF"),
    _one("focus_status", 0x1A1, "focus_fault", 3, "ro",
         "of the last FAULT: 0 none; 1 address, 2 data not acknowledged; 3 clock stretched too "
         "long; 4 bus stuck; 5 arbitration lost; 6 target not reached"),
    _one("focus_status", 0x1A2, "focus_in_position", 1, "ro", "the lens is where it should be"),
    _one("focus_status", 0x1A3, "focus_distance", 24, "ro", "the average z of good points",
         signed=True, fraction=12, unit="mm"),
    _one("focus_status", 0x1A4, "focus_target", 16, "ro", "where the lens should be"),
    _one("focus_status", 0x1A5, "focus_position", 16, "ro", "where it was last"),
    _one("focus_status", 0x1A6, "focus_nack_count", 16, "counter",
         "commands that were not acknowledged"),
    _one("focus_status", 0x1A7, "focus_stretch_count", 16, "counter",
         "commands that were stretched too long"),
    _one("focus_status", 0x1A8, "focus_stuck_count", 16, "counter",
         "commands that found the bus stuck"),
    _one("focus_status", 0x1A9, "focus_arbitration_count", 16, "counter",
         "commands that lost the bus to another master"),
    _one("focus_status", 0x1AA, "focus_timeout_count", 16, "counter",
         "times that a target was not reached"),
    _one("focus_status", 0x1AB, "focus_recovery_count", 16, "counter",
         "times that a device was clocked free"),
    _one("test", 0x1C0, "test_position", 24, "rw", "of the first line's pulse", reset=4194304,
         fraction=12, unit="px"),
    _one("test", 0x1C1, "test_move", 24, "rw",
         "added to it from line to line; what leaves the sensor comes back at its other end",
         signed=True, reset=4096, fraction=12, unit="px"),
    _one("test", 0x1C2, "test_step", 29, "rw",
         "1 / width of the pulse at its foot, of 1 to 255 px; 0: all of the line is as high",
         reset=13421773, fraction=28, unit="turn/px"),
    _one("test", 0x1C3, "test_height", 16, "rw", "of the pulse; 1 is full scale", reset=40000,
         fraction=16),
    _one("test", 0x1C4, "test_pedestal", 16, "rw", "below it", reset=2000, fraction=16),
    _one("test", 0x1C5, "test_noise", 16, "rw",
         "peak of the noise; its deviation is 1 / sqrt 12 of it", reset=1000, fraction=16),
    _one("test", 0x1C6, "test_seed", 32, "rw", "of the noise"),
    _one("test", 0x1C7, "test_lines", 32, "rw", "of a run; 0: until test_stop"),
    _one("test", 0x1C8, "test_period_clks", 24, "rw",
         "from line start to line start; at least line_length + 16", unit="clk"),
    _one("test", 0x1C9, "test_angle", 24, "rw", "of the test lines; it counts at once",
         signed=True, fraction=24, unit="turn"),
    _one("test", 0x1CA, "test_power", 16, "rw", "of the test lines; it counts at once"),
    _one("test", 0x1CB, "test_start", 1, "strobe",
         "writing it begins a run, whatever is written; one that is on its way is cut off"),
    _one("test", 0x1CC, "test_stop", 1, "strobe",
         "writing it ends the run with the line that is on its way"),
    _one("test_status", 0x1CD, "test_running", 1, "ro", "a run is on its way"),
    _one("sensor", 0x1D0, "untagged_count", 16, "counter",
         "lines that were read out without an exposure or an angle of their own"),
    _one("sensor", 0x1D1, "pixel_overflow_count", 16, "counter",
         "lines that the FIFO of the sensor's clock lost"),
    _one("locks", 0x3F0, "lock_calibration", 1, "rw",
         "1 keeps until reset: peak, geometry, motion and the amplitude table", low=1),
    _one("locks", 0x3F1, "lock_mirror", 1, "rw",
         "1 keeps until reset: the limits of the mirror's drive", low=1),
    _one("locks", 0x3F2, "lock_laser", 1, "rw", "1 keeps until reset: the limits of the laser",
         low=1),
)

_WINDOWS = (
    Window("table", 0x4000, 1024, 2, (
        _one("table", 0x000, "table_amplitude", 26, "rw", "the amplitude", lock="lock_calibration",
             fraction=28, unit="turn"),
        _one("table", 0x001, "table_midpoint", 28, "rw", "the phase halfway between the crossings",
             lock="lock_calibration", signed=True, fraction=28, unit="turn"),
    ), "lock_calibration",
       "Of the mirror: entry i is for a half distance of the crossings of i / 4096 turns"),
    Window("focus_table", 0x5000, 64, 1, (
        _one("focus_table", 0x000, "focus_table_position", 16, "rw", "where the lens should be"),
    ), None,
       "Of the autofocus: entry i is for a distance of focus_z_begin + i 2**(focus_z_shift + 10)"
       " steps"),
)
# fmt: on

REGISTERS: dict[str, Register] = {one.name: one for one in _REGISTERS}
WINDOWS: dict[str, Window] = {one.name: one for one in _WINDOWS}
LOCKS: tuple[str, ...] = ("lock_calibration", "lock_mirror", "lock_laser")
