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
        commit: What is written waits for a commit.
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
    commit: bool


@dataclass(frozen=True)
class Window:
    """A table. Field k of entry i is at address + i * stride + k, the last one writes the entry.

    Attributes:
        bank: The register that says which of two banks is accessed, or None.
        in_use: The register of the bank that is in use; it is not written.
    """

    name: str
    address: int
    entries: int
    stride: int  # words
    fields: tuple[Register, ...]
    lock: str | None
    commit: bool
    bank: str | None
    in_use: str | None
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
    commit: bool = False,
) -> Register:
    """Return a register; it takes what its width takes where low and high do not say otherwise."""
    words = count * (2 if width > _WORD else 1)
    least = -(1 << (width - 1)) if signed else 0
    most = least + (1 << width) - 1
    return Register(
        name, struct, address, words, count, width, signed, access, lock, (reset,) * count,
        fraction, unit, least if low is None else low, most if high is None else high, doc, commit,
    )  # fmt: skip


MAP_HASH = 0x0B1A6568

# fmt: off
_REGISTERS = (
    _one("", 0x000, "identity", 32, "constant",
         "the letters VRSC, by which a host knows the instrument", reset=0x56525343),
    _one("", 0x001, "map_hash", 32, "constant",
         "hash of the parts of this map that a host must know", reset=0x0B1A6568),
    _one("", 0x002, "version", 32, "constant",
         "version of the map: major, minor, patch in bits 31..16, 15..8, 7..0", reset=0x00000100),
    _one("identity_status", 0x003, "board_id", 16, "ro", "number of the kind of board"),
    _one("identity_status", 0x004, "clock_hz", 32, "ro", "frequency of the clock", unit="Hz"),
    _one("identity_status", 0x005, "line_length", 16, "ro", "pixels of a line", unit="px"),
    _one("identity_status", 0x006, "pixel_width", 8, "ro", "bits of a pixel", unit="bit"),
    _one("identity_status", 0x007, "max_window", 8, "ro",
         "largest width of a window around a peak", unit="px"),
    _one("identity_status", 0x008, "lanes", 8, "ro", "pixels that arrive in one clock; always 1"),
    _one("identity_status", 0x009, "index_oversample", 8, "ro",
         "samples of the index mark's signal in one clock"),
    _one("identity", 0x00A, "scratch", 32, "rw", "free for the host; has no effect"),
    _one("identity_status", 0x00B, "uptime", 48, "ro", "time since the reset", unit="clk"),
    _one("peak", 0x010, "period_n", 1, "rw",
         "period T of the correlation (8): 1 for T = N, 0 for T = N - 1", lock="lock_calibration",
         reset=1, commit=True),
    _one("peak", 0x011, "noise_row", 1, "rw",
         "source of the noise: 1 for the whole row, 0 for the background", lock="lock_calibration",
         commit=True),
    _one("peak", 0x012, "k_noise", 16, "rw",
         "threshold above the background, in multiples of the spread", lock="lock_calibration",
         reset=640, fraction=8, commit=True),
    _one("peak", 0x013, "k_height", 16, "rw",
         "threshold above the background, as a share of the peak's height",
         lock="lock_calibration", reset=9830, fraction=16, commit=True),
    _one("peak", 0x014, "snr_min", 16, "rw",
         "S/N below which LOW_SNR is raised on an even row; 13/8 of it elsewhere",
         lock="lock_calibration", reset=1280, fraction=8, commit=True),
    _one("peak", 0x015, "min_width", 8, "rw", "window width below which TOO_NARROW is raised",
         lock="lock_calibration", reset=3, unit="px", low=3, commit=True),
    _one("peak", 0x016, "max_width", 8, "rw", "window width above which TOO_WIDE is raised",
         lock="lock_calibration", reset=255, unit="px", low=3, commit=True),
    _one("peak", 0x017, "kappa", 18, "rw",
         "counts for each electron; 28 - pixel_width fraction bits", lock="lock_calibration",
         reset=13107, commit=True),
    _one("peak", 0x018, "c_sfm_gain", 24, "rw",
         "gain of the confidence in free space: c_sfm = power * gain / 2**16",
         lock="lock_calibration", reset=255, commit=True),
    _one("peak", 0x019, "window_two_pass", 1, "rw",
         "1: a second window with T = N is placed around the first position",
         lock="lock_calibration", reset=1, commit=True),
    _one("peak", 0x01A, "window_fit", 1, "rw",
         "1: a Gaussian is fitted to the spot, from the second window on; needs window_two_pass",
         lock="lock_calibration", reset=1, commit=True),
    _one("peak", 0x01B, "max_core", 8, "rw",
         "width at a quarter of the height above which TOO_WIDE is raised, if the peak is not "
         "saturated", lock="lock_calibration", reset=64, unit="px", low=3, commit=True),
    _one("peak", 0x01C, "saturation_level", 16, "rw",
         "pixel value from which on SATURATED is raised", lock="lock_calibration", reset=4095,
         commit=True),
    _one("geometry", 0x020, "centre", 34, "rw", "pixel of the optical axis",
         lock="lock_calibration", signed=True, reset=1073217536, fraction=20, unit="px",
         commit=True),
    _one("geometry", 0x022, "k1", 26, "rw", "k1 R**2", lock="lock_calibration", signed=True,
         fraction=24, commit=True),
    _one("geometry", 0x023, "k2", 26, "rw", "k2 R**4", lock="lock_calibration", signed=True,
         fraction=24, commit=True),
    _one("geometry", 0x024, "even", 1, "rw", "1: distortion by even powers, (5) as printed",
         lock="lock_calibration", commit=True),
    _one("geometry", 0x025, "n0", 32, "rw", "n = n0 + n1 s, s = offset / R",
         lock="lock_calibration", signed=True, reset=62302280, fraction=20, unit="length_unit",
         commit=True),
    _one("geometry", 0x026, "n1", 32, "rw", "of n", lock="lock_calibration", signed=True,
         reset=5021049, fraction=20, unit="length_unit", commit=True),
    _one("geometry", 0x027, "d0", 32, "rw", "d = (d0 + d1 s) cos a + (e0 + e1 s) sin a",
         lock="lock_calibration", signed=True, reset=149435979, fraction=30, commit=True),
    _one("geometry", 0x028, "d1", 32, "rw", "of d", lock="lock_calibration", signed=True,
         reset=-609734303, fraction=30, commit=True),
    _one("geometry", 0x029, "e0", 32, "rw", "of d", lock="lock_calibration", signed=True,
         reset=1063292242, fraction=30, commit=True),
    _one("geometry", 0x02A, "e1", 32, "rw", "of d", lock="lock_calibration", signed=True,
         reset=85692568, fraction=30, commit=True),
    _one("geometry", 0x02B, "tolerance", 16, "rw",
         "share of z; c_obj is the probability that a point errs by less", lock="lock_calibration",
         reset=16777, fraction=24, commit=True),
    _one("geometry", 0x02C, "length_unit", 4, "rw",
         "what x, z, their deviation, free space and every length of a register are counted in; "
         "for the host", lock="lock_calibration", reset=1, unit="mm", low=1, commit=True),
    _one("geometry", 0x02D, "c_obj_gain", 21, "rw",
         "gain of the confidence in an object: c_obj = snr * gain / 2**20; 0: c_obj is by "
         "tolerance", lock="lock_calibration", commit=True),
    _one("chain", 0x030, "short_count", 16, "counter", "number of lines with too few pixels"),
    _one("chain", 0x031, "long_count", 16, "counter", "number of lines with too many pixels"),
    _one("chain", 0x032, "unfinished_count", 16, "counter",
         "number of lines that the start of another line cut off"),
    _one("chain", 0x033, "early_count", 16, "counter",
         "number of lines that came before the line ahead of them was measured"),
    _one("chain", 0x034, "dropped_count", 16, "counter", "number of points that no receiver took"),
    _one("chain", 0x035, "skipped_count", 16, "counter",
         "number of lines that were not measured because a commit took effect between their "
         "pulse and their end"),
    _one("free", 0x038, "free_begin", 24, "rw", "scan angle of entry 0 of the table",
         lock="lock_calibration", signed=True, reset=-1003138, fraction=24, unit="turn",
         commit=True),
    _one("free", 0x039, "free_shift", 4, "rw",
         "spacing of the table's entries: 2**(shift + 10) steps of an angle",
         lock="lock_calibration", reset=4, commit=True),
    _one("mirror", 0x040, "mirror_enable", 1, "rw", "1 starts the mirror, 0 stops it"),
    _one("mirror", 0x041, "line_enable", 1, "rw", "1 switches the lines on"),
    _one("mirror", 0x042, "sweep_word", 40, "rw", "drive frequency at which the sweep begins",
         fraction=48, unit="turn/clk"),
    _one("mirror", 0x044, "work_word", 40, "rw", "drive frequency at which the sweep ends",
         fraction=48, unit="turn/clk"),
    _one("mirror", 0x046, "sweep_rate", 32, "rw",
         "fall of the frequency word in each clock, times 2**16"),
    _one("mirror", 0x047, "glitch_clks", 8, "rw",
         "time after which a level of the index signal counts as settled", lock="lock_mirror",
         unit="clk"),
    _one("mirror", 0x048, "width_min_clks", 32, "rw",
         "shortest time from the outward crossing to the inward crossing", lock="lock_mirror",
         unit="clk"),
    _one("mirror", 0x049, "width_max_clks", 32, "rw",
         "longest time from the outward crossing to the inward crossing; acts as 10 ms at most",
         lock="lock_mirror", unit="clk"),
    _one("mirror", 0x04A, "period_max_clks", 32, "rw",
         "longest time from one outward crossing to the next; acts as 10 ms at most",
         lock="lock_mirror", unit="clk"),
    _one("mirror", 0x04B, "phase_shift", 4, "rw",
         "share of a phase error that corrects the phase: 1 / 2**shift"),
    _one("mirror", 0x04C, "rate_shift", 6, "rw",
         "share of a phase error that corrects the frequency: 1 / 2**shift"),
    _one("mirror", 0x04D, "amplitude_shift", 4, "rw",
         "share of a new amplitude that enters the average: 1 / 2**shift"),
    _one("mirror", 0x04E, "error_limit", 28, "rw",
         "phase error above which the phase is acquired anew", fraction=28, unit="turn"),
    _one("mirror", 0x04F, "amplitude_set", 26, "rw", "amplitude that the loop holds", fraction=28,
         unit="turn"),
    _one("mirror", 0x050, "k_p", 18, "rw", "proportional gain: level steps for an amplitude step",
         fraction=16),
    _one("mirror", 0x051, "k_i", 18, "rw",
         "integral gain: level steps for an amplitude step in each period", fraction=20),
    _one("mirror", 0x052, "level_low", 20, "rw", "level below which the frequency begins to step",
         fraction=20),
    _one("mirror", 0x053, "level_high", 20, "rw", "level above which the frequency begins to step",
         fraction=20),
    _one("mirror", 0x054, "level_nominal", 20, "rw",
         "level of the start, at which the frequency also stops stepping", fraction=20),
    _one("mirror", 0x055, "trim_step", 24, "rw", "largest step of the frequency word in a period"),
    _one("mirror", 0x056, "trim_gain", 18, "rw", "steps of the frequency word for a level step",
         fraction=16),
    _one("mirror", 0x057, "trim_up", 1, "rw", "1: the amplitude rises with the frequency"),
    _one("mirror", 0x058, "settle_limit", 26, "rw",
         "amplitude error below which the loop counts as settled", lock="lock_mirror", fraction=28,
         unit="turn"),
    _one("mirror", 0x059, "shock_limit", 26, "rw",
         "amplitude error above which it counts as a shock", fraction=28, unit="turn"),
    _one("mirror", 0x05A, "phase_limit", 28, "rw",
         "phase error above which the loop counts as unsettled", fraction=28, unit="turn"),
    _one("mirror", 0x05B, "settle_count", 8, "rw",
         "number of good periods after which the loop is settled", lock="lock_mirror"),
    _one("mirror", 0x05C, "hold_count", 8, "rw", "number of good periods that end an index fault"),
    _one("mirror", 0x05D, "confidence_gain", 24, "rw",
         "confidence, of 255, that each step of amplitude error costs", fraction=20),
    _one("mirror_limits", 0x060, "duty", 16, "rw",
         "share of its period for which the drive is high", lock="lock_mirror", fraction=16),
    _one("mirror_limits", 0x061, "sweep_level", 20, "rw", "level of the drive in SWEEP",
         lock="lock_mirror", fraction=20),
    _one("mirror_limits", 0x062, "level_min", 20, "rw",
         "least level of the drive in SETTLE and RUN", lock="lock_mirror", fraction=20),
    _one("mirror_limits", 0x063, "level_max", 20, "rw",
         "largest level of the drive in SETTLE and RUN", lock="lock_mirror", fraction=20),
    _one("mirror_limits", 0x064, "trim_min", 32, "rw",
         "lowest frequency, as a step from work_word", lock="lock_mirror", signed=True,
         fraction=48, unit="turn/clk"),
    _one("mirror_limits", 0x065, "trim_max", 32, "rw",
         "highest frequency, as a step from work_word", lock="lock_mirror", signed=True,
         fraction=48, unit="turn/clk"),
    _one("mirror_limits", 0x066, "sweep_timeout", 32, "rw", "longest time in SWEEP",
         lock="lock_mirror", unit="clk"),
    _one("mirror_limits", 0x067, "settle_timeout", 32, "rw",
         "longest time in SETTLE; acts as 10 s at most", lock="lock_mirror", unit="clk"),
    _one("mirror_limits", 0x068, "lost_timeout", 32, "rw",
         "longest time without the index in RUN; acts as 25 ms at most", lock="lock_mirror",
         unit="clk"),
    _one("motion", 0x080, "drive_phase", 28, "rw",
         "phase of the drive for which motion_a and motion_phi hold", lock="lock_calibration",
         fraction=28, unit="turn", commit=True),
    _one("motion", 0x081, "motion_a", 24, "rw", "amplitudes a_k of the harmonics",
         lock="lock_calibration", count=9, signed=True, fraction=22, commit=True),
    _one("motion", 0x08A, "motion_phi", 28, "rw", "phases phi_k of the harmonics",
         lock="lock_calibration", count=9, fraction=28, unit="turn", commit=True),
    _one("motion", 0x093, "motion_da", 24, "rw", "change of a_k with the phase of the drive",
         lock="lock_calibration", count=9, signed=True, fraction=22, unit="1/turn", commit=True),
    _one("motion", 0x09C, "motion_dphi", 24, "rw", "change of phi_k with the phase of the drive",
         lock="lock_calibration", count=9, signed=True, fraction=16, unit="turn/turn",
         commit=True),
    _one("motion", 0x0A5, "scan_facet", 1, "rw",
         "1: a turn of the phase is a facet of a polygon, and the motion that of half the phase",
         lock="lock_calibration", commit=True),
    _one("motion", 0x0A6, "scan_begin", 16, "rw",
         "phase of the mirror from which on lines have light and an angle",
         lock="lock_calibration", fraction=16, unit="turn", commit=True),
    _one("motion", 0x0A7, "scan_span", 16, "rw",
         "length of that part of a turn; other lines are dark and UNSETTLED. 65535 is the whole "
         "turn", lock="lock_calibration", reset=65535, fraction=16, unit="turn", commit=True),
    _one("line", 0x0B0, "ratio", 44, "rw", "number of lines in a period of the mirror",
         fraction=32),
    _one("line", 0x0B2, "exposure_delay_clks", 20, "rw",
         "time from the line's start to the exposure", unit="clk"),
    _one("line", 0x0B3, "exposure_clks", 20, "rw", "length of the exposure", unit="clk"),
    _one("line", 0x0B4, "pulse_delay_clks", 20, "rw",
         "time from the line's start to the laser pulse", unit="clk"),
    _one("line", 0x0B5, "pulse_clks", 20, "rw", "length of the laser pulse", unit="clk"),
    _one("mirror_status", 0x0C0, "mirror_state", 3, "ro",
         "state: 0 OFF, 1 SWEEP, 2 SETTLE, 3 RUN, 4 FAULT"),
    _one("mirror_status", 0x0C1, "mirror_fault", 2, "ro",
         "cause of the last FAULT: 0 none, 1 sweep, 2 settle, 3 index"),
    _one("mirror_status", 0x0C2, "mirror_word", 40, "ro", "frequency of the drive", fraction=48,
         unit="turn/clk"),
    _one("mirror_status", 0x0C4, "mirror_drive_phase", 48, "ro", "phase of the drive", fraction=48,
         unit="turn"),
    _one("mirror_status", 0x0C6, "mirror_phase", 48, "ro", "phase of the mirror", fraction=48,
         unit="turn"),
    _one("mirror_status", 0x0C8, "mirror_level", 20, "ro", "level of the drive", fraction=20),
    _one("mirror_status", 0x0C9, "index_alive", 1, "ro", "1 while the index marks come in time"),
    _one("mirror_status", 0x0CA, "mirror_settled", 1, "ro",
         "1 while amplitude and phase are within their limits"),
    _one("mirror_status", 0x0CB, "mirror_measured", 26, "ro", "last measured amplitude",
         fraction=28, unit="turn"),
    _one("mirror_status", 0x0CC, "mirror_error", 28, "ro", "last error of the phase", signed=True,
         fraction=28, unit="turn"),
    _one("mirror_status", 0x0CD, "missing_count", 16, "counter",
         "number of crossings that did not come"),
    _one("mirror_status", 0x0CE, "doubled_count", 16, "counter",
         "number of crossings that came twice"),
    _one("mirror_status", 0x0CF, "impossible_count", 16, "counter",
         "number of crossings at impossible times"),
    _one("mirror_status", 0x0D0, "glitch_count", 16, "counter",
         "number of comparator pulses that were too short"),
    _one("mirror_status", 0x0D1, "overrun_count", 16, "counter",
         "number of lines that the next line cut off"),
    _one("link", 0x0E0, "uart_step", 24, "strobe",
         "baud rate to change to after the reply to this write; the first good frame confirms "
         "it. At reset 3 Mbaud of 100 MHz; uart_step_now is the rate in force", reset=503316,
         fraction=24, unit="bit/clk", low=1024, high=2097152),
    _one("link_status", 0x0E1, "uart_step_now", 24, "ro", "baud rate in force", fraction=24,
         unit="bit/clk"),
    _one("link_status", 0x0E2, "uart_framing", 16, "counter",
         "number of bytes without a stop bit"),
    _one("link_status", 0x0E3, "uart_breaks", 16, "counter",
         "number of breaks, in which the line was low for a whole byte"),
    _one("link_status", 0x0E4, "uart_glitches", 16, "counter",
         "number of start bits that were too short"),
    _one("link_status", 0x0E5, "uart_fallbacks", 16, "counter",
         "number of new rates given up, because no good frame came in time"),
    _one("link_status", 0x0E6, "frames_good", 16, "counter", "number of good frames"),
    _one("link_status", 0x0E7, "frames_crc", 16, "counter", "number of frames with a wrong CRC"),
    _one("link_status", 0x0E8, "frames_malformed", 16, "counter",
         "number of frames cut off within a block"),
    _one("link_status", 0x0E9, "frames_too_long", 16, "counter",
         "number of frames with more than MaxPayload bytes"),
    _one("link_status", 0x0EA, "frames_too_short", 16, "counter",
         "number of frames without a payload"),
    _one("link_status", 0x0EB, "frames_framing", 16, "counter",
         "number of frames with a byte without a stop bit, or with a break"),
    _one("link_status", 0x0EC, "commands_bad", 16, "counter",
         "number of unknown commands and of commands of a wrong length"),
    _one("link_status", 0x0ED, "commands_lost", 16, "counter",
         "number of commands that came while too many waited"),
    _one("laser", 0x100, "laser_enable", 1, "rw",
         "1 permits light; 0 ends a trip of the watchdog and of the guard"),
    _one("laser", 0x101, "laser_adapt", 1, "rw",
         "1: the power follows the peaks, 0: it is laser_power"),
    _one("laser", 0x102, "laser_shared", 1, "rw",
         "1: both directions of the scan share one power"),
    _one("laser", 0x103, "laser_power", 16, "rw",
         "power without adaptation, and where adaptation begins"),
    _one("laser", 0x104, "laser_power_min", 16, "rw", "least adapted power, at least 1"),
    _one("laser", 0x105, "laser_power_max", 16, "rw", "largest adapted power"),
    _one("laser", 0x106, "laser_startup", 16, "rw",
         "level of the start-up channel, which lights the index mark"),
    _one("laser", 0x107, "laser_target", 16, "rw",
         "wanted height of a peak above its background; 1 is full scale", fraction=16),
    _one("laser", 0x108, "laser_cut", 14, "rw", "factor of the power after a saturated peak",
         fraction=14),
    _one("laser", 0x109, "laser_down", 16, "rw", "gain of the adaptation where a peak is too high",
         fraction=13),
    _one("laser", 0x10A, "laser_up", 16, "rw", "gain of the adaptation where a peak is too low",
         fraction=13),
    _one("laser", 0x10B, "laser_search", 14, "rw",
         "relative growth of the power after a line without a peak", fraction=14),
    _one("laser", 0x10C, "laser_index_begin", 16, "rw",
         "phase of the mirror from which the index is lit in RUN", fraction=16, unit="turn"),
    _one("laser", 0x10D, "laser_index_end", 16, "rw",
         "phase of the mirror at which that light ends", fraction=16, unit="turn"),
    _one("laser_limits", 0x120, "laser_limit_power", 16, "rw", "largest power of a pulse",
         lock="lock_laser"),
    _one("laser_limits", 0x121, "laser_limit_startup", 16, "rw",
         "largest level of the start-up channel", lock="lock_laser"),
    _one("laser_limits", 0x122, "laser_limit_pulse_clks", 20, "rw", "longest pulse",
         lock="lock_laser", unit="clk"),
    _one("laser_limits", 0x123, "laser_limit_drain", 16, "rw", "largest average power",
         lock="lock_laser"),
    _one("laser_limits", 0x124, "laser_limit_bucket", 32, "rw",
         "largest energy of a burst, in power times clocks", lock="lock_laser"),
    _one("laser_limits", 0x125, "laser_watchdog_clks", 32, "rw",
         "time without a word from the host after which the light goes off; 0 is the ceiling",
         lock="lock_laser", unit="clk"),
    _one("laser_status", 0x130, "laser_status", 7, "ro",
         "bits from 0: host heard, guard permits, pulses permitted, bucket full, watchdog "
         "tripped, mirror scans, start-up light permitted"),
    _one("laser_status", 0x131, "laser_power_inward", 16, "ro",
         "power of the next pulse in the first half turn"),
    _one("laser_status", 0x132, "laser_power_outward", 16, "ro",
         "power of the next pulse in the second half turn"),
    _one("laser_status", 0x133, "laser_cut_count", 16, "counter",
         "number of pulses that were too long"),
    _one("laser_status", 0x134, "laser_duty_count", 16, "counter",
         "number of times that the bucket was full"),
    _one("laser_status", 0x135, "laser_watchdog_count", 16, "counter",
         "number of times that the host was silent for too long"),
    _one("laser_status", 0x136, "laser_guard_fault", 5, "ro",
         "what the guard last tripped at, bits from 0: no heartbeat, a pulse too long, too many "
         "pulses, index light too long, start-up level stuck"),
    _one("laser_status", 0x137, "laser_guard_count", 16, "counter",
         "number of trips of the guard"),
    _one("points", 0x160, "points_batch", 8, "rw",
         "number of records in a packet, at most as many as fit", reset=24),
    _one("points", 0x161, "points_timeout_clks", 24, "rw",
         "time after which a packet that is not full goes out; 0 is never", reset=2000000,
         unit="clk"),
    _one("points_status", 0x162, "points_dropped", 16, "counter",
         "number of points that found no room in the buffer"),
    _one("points_status", 0x163, "capture_busy", 1, "ro",
         "1 while a raw line is awaited, received or sent"),
    _one("axi", 0x170, "axi_points_dropped", 16, "counter",
         "number of points that found no room before the stream of points"),
    _one("axi", 0x171, "axi_lines_dropped", 16, "counter",
         "number of good lines that found no room before the stream of raw lines"),
    _one("axi", 0x172, "axi_refused", 4, "ro",
         "status of the last access over AXI4-Lite that was refused, 0 before there is one; "
         "BAD_LENGTH is a write of a part of a word"),
    _one("axi", 0x173, "axi_refused_address", 16, "ro", "address of its register"),
    _one("focus", 0x180, "focus_mode", 2, "rw",
         "source of the target: 0 OFF, 1 MANUAL, 2 AUTOMATIC", high=2),
    _one("focus", 0x181, "focus_manual", 16, "rw", "target in MANUAL"),
    _one("focus", 0x182, "focus_average_shift", 4, "rw",
         "number of good points in the averaged distance: 2**shift"),
    _one("focus", 0x183, "focus_lapse", 16, "rw",
         "number of points without a good one after which a new average begins"),
    _one("focus", 0x184, "focus_z_begin", 24, "rw", "distance of entry 0 of the table",
         signed=True, fraction=12, unit="length_unit"),
    _one("focus", 0x185, "focus_z_shift", 4, "rw",
         "spacing of the table's entries: 2**(shift + 10) steps of a distance"),
    _one("focus", 0x186, "focus_hysteresis", 16, "rw", "least change of the target"),
    _one("focus", 0x187, "focus_hold_points", 16, "rw",
         "number of good points in a row that ask for a new target"),
    _one("focus", 0x188, "focus_address", 7, "rw", "address of the motor on its I2C bus"),
    _one("focus", 0x189, "focus_quarter_clks", 16, "rw", "quarter of a bit on the bus", reset=250,
         unit="clk", low=4),
    _one("focus", 0x18A, "focus_stretch_clks", 24, "rw",
         "longest time for which a device may stretch the clock", reset=2500000, unit="clk",
         low=7),
    _one("focus", 0x18B, "focus_poll_clks", 24, "rw", "pause between two commands", reset=200000,
         unit="clk"),
    _one("focus", 0x18C, "focus_tolerance", 16, "rw",
         "largest distance from the target that counts as in position"),
    _one("focus", 0x18D, "focus_timeout_clks", 32, "rw", "longest time to reach a target",
         unit="clk"),
    _one("focus", 0x18E, "focus_retries", 8, "rw",
         "number of retries of a failed command or of a missed target"),
    _one("focus", 0x18F, "focus_protocol", 1, "rw",
         "what the motor speaks: 0 registers of two bytes, 1 the commands of an M3 smart stage"),
    _one("focus_status", 0x1A0, "focus_state", 3, "ro",
         "state: 0 OFF, 1 WAIT for a target, 2 MOVE, 3 HOLD, 4 FAULT until OFF"),
    _one("focus_status", 0x1A1, "focus_fault", 4, "ro",
         "cause of the last FAULT: 0 none; 1 address, 2 data not acknowledged; 3 clock stretched"
         " too long; 4 bus stuck; 5 arbitration lost; 6 target not reached; of an M3: 7 bad "
         "reply, 8 driver, encoder or stall, 9 at a limit or out of range"),
    _one("focus_status", 0x1A2, "focus_in_position", 1, "ro", "1 while the lens is at its target"),
    _one("focus_status", 0x1A3, "focus_distance", 24, "ro", "average z of the good points",
         signed=True, fraction=12, unit="length_unit"),
    _one("focus_status", 0x1A4, "focus_target", 16, "ro", "position that the lens should have"),
    _one("focus_status", 0x1A5, "focus_position", 16, "ro",
         "position of the lens when it was last read"),
    _one("focus_status", 0x1A6, "focus_nack_count", 16, "counter",
         "number of commands that were not acknowledged"),
    _one("focus_status", 0x1A7, "focus_stretch_count", 16, "counter",
         "number of commands in which the clock was stretched too long"),
    _one("focus_status", 0x1A8, "focus_stuck_count", 16, "counter",
         "number of commands that found the bus stuck"),
    _one("focus_status", 0x1A9, "focus_arbitration_count", 16, "counter",
         "number of commands that lost the bus to another master"),
    _one("focus_status", 0x1AA, "focus_timeout_count", 16, "counter",
         "number of targets that were not reached in time"),
    _one("focus_status", 0x1AB, "focus_recovery_count", 16, "counter",
         "number of times that extra clocks freed a device"),
    _one("focus_status", 0x1AC, "focus_reply_count", 16, "counter",
         "number of replies of an M3 that were none, or told of a fault"),
    _one("focus_status", 0x1AD, "focus_motor_status", 25, "ro",
         "status of an M3 when it was last read, bits as in its guide; bit 24: its position was "
         "below 0 or above 65535, and focus_position is 0 or 65535"),
    _one("test", 0x1C0, "test_position", 25, "rw", "position of the first line's pulse",
         reset=4194304, fraction=12, unit="px"),
    _one("test", 0x1C1, "test_move", 24, "rw",
         "movement of the pulse from line to line; it leaves at one end and returns at the other",
         signed=True, reset=4096, fraction=12, unit="px"),
    _one("test", 0x1C2, "test_step", 29, "rw",
         "1 / width of the pulse at its foot, for 1 to 255 px; 0 makes the whole line as high",
         reset=13421773, fraction=28, unit="turn/px"),
    _one("test", 0x1C3, "test_height", 16, "rw", "height of the pulse; 1 is full scale",
         reset=40000, fraction=16),
    _one("test", 0x1C4, "test_pedestal", 16, "rw", "level below the pulse", reset=2000,
         fraction=16),
    _one("test", 0x1C5, "test_noise", 16, "rw", "peak of the noise, sqrt 12 times its deviation",
         reset=1000, fraction=16),
    _one("test", 0x1C6, "test_seed", 32, "rw", "seed of the noise"),
    _one("test", 0x1C7, "test_lines", 32, "rw",
         "number of lines of a run; 0 lasts until test_stop"),
    _one("test", 0x1C8, "test_period_clks", 24, "rw",
         "time from one line start to the next; at least line_length + 16", unit="clk"),
    _one("test", 0x1C9, "test_angle", 24, "rw",
         "scan angle of the test lines; a change takes effect at once", signed=True, fraction=24,
         unit="turn"),
    _one("test", 0x1CA, "test_power", 16, "rw",
         "laser power of the test lines; a change takes effect at once"),
    _one("test", 0x1CB, "test_start", 1, "strobe",
         "any write begins a run and cuts off one that is under way"),
    _one("test", 0x1CC, "test_stop", 1, "strobe",
         "any write ends the run with the line that is under way"),
    _one("test_status", 0x1CD, "test_running", 1, "ro", "1 while a run is under way"),
    _one("sensor_status", 0x1D0, "untagged_count", 16, "counter",
         "number of lines that were read out without an exposure or angle of their own, or "
         "mistimed"),
    _one("sensor_status", 0x1D1, "pixel_overflow_count", 16, "counter",
         "number of lines that the FIFO between the clocks lost"),
    _one("sensor_status", 0x1D2, "unread_count", 16, "counter",
         "number of exposures whose readout never came"),
    _one("sensor_status", 0x1D3, "mistimed_count", 16, "counter",
         "number of readouts that were not of the exposure that readout_lag says, or not in its "
         "window of time; their points are UNSETTLED"),
    _one("sensor", 0x1D4, "readout_lag", 2, "rw",
         "number of exposures that end between an exposure's end and its readout; after a change"
         " points are UNSETTLED until line_enable has risen"),
    _one("sensor", 0x1D5, "readout_stale", 1, "rw",
         "1: after line_enable has risen the sensor first sends readout_lag old lines, which are"
         " of no exposure"),
    _one("sensor", 0x1D6, "readout_min_clks", 24, "rw",
         "shortest time from an exposure's end to its readout", unit="clk"),
    _one("sensor", 0x1D7, "readout_max_clks", 24, "rw",
         "longest time from an exposure's end to its readout", reset=16777215, unit="clk"),
    _one("commit", 0x1E0, "commit", 1, "strobe",
         "a write of 1 lets all that was written take effect", lock="lock_calibration", low=1),
    _one("commit_status", 0x1E1, "commit_waiting", 1, "ro",
         "1 until it has; meanwhile writes of what waits for a commit, and any access to its "
         "tables, are answered with BUSY"),
    _one("commit_status", 0x1E2, "configuration", 1, "ro",
         "changes with each commit: bit 4 of the bits of a full record whose line is measured "
         "now"),
    _one("map", 0x1F0, "map_enable", 1, "rw", "1: positions are corrected",
         lock="lock_calibration", commit=True),
    _one("map", 0x1F1, "map_bank", 1, "rw", "bank of map_table by which they are",
         lock="lock_calibration", commit=True),
    _one("map", 0x1F2, "map_count", 4, "rw", "number of maps in the bank", lock="lock_calibration",
         reset=2, low=2, high=9, commit=True),
    _one("map", 0x1F3, "map_begin", 16, "rw",
         "position of the lens, in steps of its motor, of map 0", lock="lock_calibration",
         commit=True),
    _one("map", 0x1F4, "map_shift", 4, "rw", "distance of the maps: 2**shift steps",
         lock="lock_calibration", commit=True),
    _one("map", 0x1F5, "map_follow", 1, "rw",
         "1: the lens stands where focus_position was in the middle of a line's pulse, 0: at "
         "map_lens", lock="lock_calibration", commit=True),
    _one("map", 0x1F6, "map_lens", 16, "rw", "position of the lens where it does not follow",
         lock="lock_calibration", commit=True),
    _one("map_access", 0x1F8, "map_access_bank", 1, "rw",
         "bank of map_table that is read and written"),
    _one("locks", 0x3F0, "lock_calibration", 1, "rw",
         "1 keeps until reset: peak, geometry, free space, motion, maps, their tables, and the "
         "commit", low=1),
    _one("locks", 0x3F1, "lock_mirror", 1, "rw",
         "1 keeps until reset: the limits of the mirror's drive and of its index", low=1),
    _one("locks", 0x3F2, "lock_laser", 1, "rw", "1 keeps until reset: the limits of the laser",
         low=1),
)

_WINDOWS = (
    Window("table", 0x4000, 1024, 2, (
        _one("table", 0x000, "table_amplitude", 26, "rw", "amplitude", lock="lock_calibration",
             fraction=28, unit="turn", commit=True),
        _one("table", 0x001, "table_midpoint", 28, "rw", "phase halfway between the crossings",
             lock="lock_calibration", signed=True, fraction=28, unit="turn", commit=True),
    ), "lock_calibration", True, None, None,
       "Amplitude table of the mirror: entry i belongs to crossings that are i / 2048 turns "
       "apart"),
    Window("focus_table", 0x5000, 64, 1, (
        _one("focus_table", 0x000, "focus_table_position", 16, "rw",
             "position that the lens should have"),
    ), None, False, None, None,
       "Table of the autofocus: entry i belongs to a distance of focus_z_begin + i "
       "2**(focus_z_shift + 10) steps"),
    Window("free_table", 0x6000, 256, 2, (
        _one("free_table", 0x000, "free_table_from", 16, "rw", "least z", lock="lock_calibration",
             fraction=4, unit="length_unit", commit=True),
        _one("free_table", 0x001, "free_table_to", 16, "rw", "largest z", lock="lock_calibration",
             fraction=4, unit="length_unit", commit=True),
    ), "lock_calibration", True, None, None,
       "Intervals of z in which a line without a peak is free, empty where from is not below to."
       " Entry i < 128: what the camera sees at the angle free_begin + i 2**(free_shift + 10) "
       "steps. Entry 128 + 8 e + k: where the darkest surface gives a peak, for 2**8 power / "
       "noise of (8 + k) 2**(e - 3) and more"),
    Window("map_table", 0x8000, 19305, 1, (
        _one("map_table", 0x000, "map_table_node", 18, "rw",
             "bits 16..0: what the position lacks, px, two's complement, 10 fraction bits; bit "
             "17: calibration had no points here", lock="lock_calibration", commit=True),
    ), "lock_calibration", True, "map_access_bank", "map_bank",
       "Nodes of the correction maps: entry 2145 k + 65 i + j of map k belongs to the angle (i -"
       " 16) / 256 turns and the position j R / 64"),
)
# fmt: on

REGISTERS: dict[str, Register] = {one.name: one for one in _REGISTERS}
WINDOWS: dict[str, Window] = {one.name: one for one in _WINDOWS}
LOCKS: tuple[str, ...] = ("lock_calibration", "lock_mirror", "lock_laser")
