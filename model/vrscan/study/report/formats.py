"""The generated tables of docs/numbers.md that need no measurement: formats and latencies."""

from vrscan.clocked import amplitude_control, index_capture, mirror_loop, mirror_phase
from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.fixed import (
    cordic_vector,
    distortion,
    line_receiver,
    line_statistics,
    motion_map,
    peak_confidence,
    peak_isolate,
    peak_position,
    peak_refine,
    phase_correlate,
    scan_angle,
    triangulate,
)
from vrscan.fixed import vrscan_chain as chain
from vrscan.show.sheet import listed


def words() -> str:
    """Return the table of the formats of ports, records and registers."""
    count = f"{pkg.COUNT_WIDTH} - P"
    geometry = f"s{pkg.GEOMETRY_WIDTH}"
    rows: list[tuple[str | int, ...]] = [
        ("pixel, maximum", "uP", 0, "counts", "P = PixelWidth, 8 to 16; full scale is 2^P"),
        ("row_mean, background, noise, spread", f"u{pkg.COUNT_WIDTH}", count, "counts", ""),
        ("row_variance", f"u{pkg.VARIANCE_WIDTH}", f"{pkg.VARIANCE_WIDTH} - 2 P", "counts^2", ""),
        ("snr, snr_min", f"u{pkg.SNR_WIDTH}", pkg.SNR_FRACTION, "1", "saturates"),
        ("position", f"s(b + {pkg.POSITION_FRACTION + 1})", pkg.POSITION_FRACTION, "px",
         "b = clog2(LineLength); pixel i is centred at i"),
        ("sigma", f"u{pkg.SIGMA_WIDTH}", pkg.SIGMA_FRACTION, "px", "saturates"),
        ("angle", f"s{pkg.ANGLE_WIDTH}", pkg.ANGLE_WIDTH, "turns", "wraps"),
        ("x, z", f"s{pkg.LENGTH_WIDTH}", pkg.LENGTH_FRACTION, "mm", "beyond: OUT_OF_RANGE"),
        ("sigma_z", f"u{pkg.SIGMA_WIDTH}", pkg.SIGMA_FRACTION, "mm", "saturates"),
        ("c_obj, c_sfm", f"u{pkg.CONFIDENCE_WIDTH}", "-", "1", "255 is 1.0; saturate"),
        ("free_from, free_to", f"u{pkg.FREE_WIDTH}", pkg.FREE_FRACTION, "mm",
         "rounded inwards; both 0: nothing is free"),
        ("laser power", f"u{pkg.POWER_WIDTH}", 0, "-", ""),
        ("mirror_flags", f"u{pkg.MIRROR_FLAG_WIDTH}", "-", "-",
         "NOT_RUNNING, INDEX_FAULT, UNSETTLED from bit 0"),
        ("line number", f"u{pkg.LINE_NUMBER_WIDTH}", 0, "lines", "wraps"),
        ("k_noise", "u16", pkg.K_NOISE_FRACTION, "spreads, noises", "register"),
        ("k_height", "u16", pkg.K_HEIGHT_FRACTION, "heights", "register"),
        ("kappa", f"u{pkg.KAPPA_WIDTH}", "28 - P", "counts per electron", "register"),
        ("c_sfm_gain", f"u{pkg.GAIN_WIDTH}", pkg.GAIN_FRACTION, "-", "255 / power_max; register"),
        ("tolerance", f"u{pkg.TOLERANCE_WIDTH}", pkg.TOLERANCE_FRACTION, "z", "register"),
        ("c_obj_gain", f"u{pkg.OBJECT_GAIN_WIDTH}", pkg.OBJECT_GAIN_FRACTION, "-",
         "255 / 256 / snr_max; register; 0: by tolerance"),
        ("centre", f"s(b + {pkg.OFFSET_FRACTION + 1})", pkg.OFFSET_FRACTION, "px", "register"),
        ("k1 R^2, k2 R^4", f"s{pkg.DISTORTION_WIDTH}", pkg.DISTORTION_FRACTION, "1",
         "R = 2^b px; registers"),
        ("n0, n1", geometry, pkg.BASE_FRACTION, "mm", "registers"),
        ("d0, d1, e0, e1", geometry, pkg.RAY_FRACTION, "focal lengths", "registers"),
        ("table phase", f"u{pkg.PHASE_WIDTH}", pkg.PHASE_WIDTH, "turns",
         f"top of a {phase_correlate.STEP_WIDTH}-bit accumulator"),
        ("sine, cosine of the window", f"s{pkg.SINE_WIDTH}", "-", "1",
         f"{pkg.SINE_AMPLITUDE} is 1.0"),
        ("X, Y", f"s{pkg.HARMONIC_WIDTH}", "-", "aligned counts", "pixels aligned to 16 bits"),
        ("magnitude", f"u{pkg.MAGNITUDE_WIDTH}", "-", "aligned counts",
         f"{cordic_vector.GAIN:.9f} x {pkg.SINE_AMPLITUDE} x first harmonic"),
        ("phase", f"u{pkg.ANGLE_WIDTH}", pkg.ANGLE_WIDTH, "turns", ""),
        ("baseline, at the first pixel", f"s{pkg.RAMP_WIDTH}", pkg.RAMP_FRACTION, "aligned counts",
         "of the second window"),
        ("baseline, from pixel to pixel", f"s{pkg.SLOPE_LEVEL_WIDTH}", pkg.RAMP_FRACTION,
         "aligned counts", ""),
        ("offset from the axis", f"s(b + {pkg.OFFSET_FRACTION + 2})", pkg.OFFSET_FRACTION, "px",
         "saturates: OUT_OF_RANGE"),
        ("slope", f"s{pkg.SLOPE_WIDTH}", pkg.SLOPE_FRACTION, "1", "saturates: OUT_OF_RANGE"),
        ("phase of the mirror", f"u{pkg.TURN_WIDTH}", pkg.TURN_WIDTH, "turns", "wraps"),
        ("frequency words", f"u{pkg.WORD_WIDTH}", pkg.TURN_WIDTH, "turns a clock",
         "registers; saturate"),
        ("trim of the frequency", f"s{pkg.TRIM_WIDTH}", pkg.TURN_WIDTH, "turns a clock",
         "limits are registers"),
        ("trim_step", f"u{pkg.TRIM_STEP_WIDTH}", pkg.TURN_WIDTH, "turns a clock", "register"),
        ("time of a crossing", f"u{pkg.TIME_WIDTH + pkg.SUB_WIDTH}", pkg.SUB_WIDTH, "clocks",
         "wraps"),
        ("age of a crossing", f"u{pkg.AGE_WIDTH}", pkg.SUB_WIDTH, "clocks", "saturates"),
        ("time-outs and widths of the index", f"u{pkg.TIME_WIDTH}", 0, "clocks", "registers"),
        ("level of the drive", f"u{pkg.LEVEL_WIDTH}", pkg.LEVEL_WIDTH, "full scale", "saturates"),
        ("amplitude A", f"u{pkg.AMPLITUDE_WIDTH}", pkg.AMPLITUDE_FRACTION, "turns", ""),
        ("midpoint of the crossings", f"s{pkg.MIDPOINT_WIDTH}", pkg.MIDPOINT_WIDTH, "turns",
         f"table of {1 << pkg.AMPLITUDE_TABLE_BITS} entries, a half distance of "
         f"1/{4 << pkg.AMPLITUDE_TABLE_BITS} turns apart; so is A's"),
        ("phase error", f"s{pkg.ERROR_WIDTH}", pkg.ERROR_WIDTH, "turns", "saturates"),
        ("k_p", f"u{pkg.CONTROL_GAIN_WIDTH}", pkg.PROPORTIONAL_FRACTION,
         "level over amplitude", "register"),
        ("k_i", f"u{pkg.CONTROL_GAIN_WIDTH}", pkg.INTEGRAL_FRACTION, "level over amplitude",
         "register; a period"),
        ("a_k", f"s{pkg.MOTION_WIDTH}", pkg.MOTION_FRACTION, "1",
         f"k = 1, 3 .. {2 * pkg.HARMONIC_COUNT - 1}; registers"),
        ("phi_k, phase of the scan angle", f"u{pkg.PHASE_WIDTH}", pkg.PHASE_WIDTH, "turns",
         "phi_k are registers"),
        ("offset and phase of the drive", f"u{pkg.PHASE_WIDTH}", pkg.PHASE_WIDTH, "turns",
         "drive_phase is a register; the difference is signed, modulo half a turn"),
        ("da_k", f"s{pkg.SLOPE_MOTION_WIDTH}", pkg.MOTION_SLOPE_FRACTION, "per turn",
         "of a_k with the drive's phase; registers"),
        ("dphi_k", f"s{pkg.SLOPE_MOTION_WIDTH}", pkg.PHI_SLOPE_FRACTION, "turns per turn",
         "of phi_k with the drive's phase; registers"),
        ("line rate over mirror frequency", f"u{pkg.RATIO_WIDTH}", pkg.RATIO_FRACTION, "1",
         "register"),
        ("delays and lengths in a line", f"u{pkg.LINE_CLKS_WIDTH}", 0, "clocks", "registers"),
    ]  # fmt: skip
    return listed(("quantity", "word", "fraction bits", "unit", "note"), rows, left=5).markdown()


def stages() -> str:
    """Return the table of the clocks that each stage takes at the shipped parameters."""
    sensor = Config().sensor
    length, width = sensor.line_length, sensor.pixel_width
    narrow = pkg.MIN_WINDOW
    correlate = phase_correlate.latency(narrow) - 2 * narrow
    total = chain.latency(narrow, measured=True, line_length=length, pixel_width=width) - 2 * narrow
    unmeasured = chain.latency(0, measured=False, line_length=length, pixel_width=width)
    fitted, unfitted = (
        chain.latency(0, measured=measured, line_length=length, pixel_width=width, fit=True)
        for measured in (True, False)
    )
    first = phase_correlate.first_latency(narrow) - narrow
    second = first + peak_refine.latency()
    statistics = line_statistics.latency(length, width, chain.MAX_WINDOW)
    rows: list[tuple[str | int, ...]] = [
        ("line_receiver", line_receiver.LATENCY),
        ("line_statistics", statistics),
        ("peak_isolate, with the replay of the line", peak_isolate.latency(length)),
        (
            "phase_correlate",
            f"{correlate} + 2 N; {phase_correlate.UNMEASURED_LATENCY} without a window to measure",
        ),
        (
            "the slower of peak_position and peak_confidence",
            f"{max(peak_position.LATENCY, peak_confidence.latency())} "
            f"(the slower of {peak_position.LATENCY} and {peak_confidence.latency()})",
        ),
        ("hand-over", 1),
        ("distortion", distortion.latency(length)),
        ("triangulate", triangulate.LATENCY),
        ("**from the last pixel to the point**", f"**{total} + 2 N; {unmeasured} unmeasured**"),
        (
            "with two passes more, N1 pixels in the first window",
            f"{second} + N1: the first harmonic {first} + N1, peak_refine {peak_refine.latency()}",
        ),
        (
            "**with a fit, from the next line's last pixel**",
            f"**{fitted}; {unfitted} where that is unmeasured**",
        ),
    ]
    return listed(("stage", "clocks"), rows, left=2).markdown()


def mirror_stages() -> str:
    """Return the latencies of the mirror's loop as a table."""
    rows = [
        ("index_capture, from the clock that settles a level", index_capture.LATENCY),
        ("mirror_phase, from the inward crossing", mirror_phase.LATENCY),
        ("amplitude_control, from there to level and flags", amplitude_control.LATENCY),
        ("motion_map, from there to the harmonics, between two angles", motion_map.LATENCY),
        ("scan_angle", scan_angle.LATENCY),
        ("**from the centre of the laser pulse to the line's angle**", mirror_loop.ANGLE_LATENCY),
    ]
    return listed(("stage", "clocks"), rows, left=2).markdown()


def blocks() -> dict[str, str]:
    """Return the generated tables by the names of their markers."""
    return {"formats": words(), "latencies": stages(), "mirror latencies": mirror_stages()}
