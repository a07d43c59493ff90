"""Accuracy of the mirror's loop, RTL against the simulated mirror, and its detection of faults."""

import math

from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.study.report.figure import Figure
from vrscan.study.report.mirror_report import Events, Run, Summary, simulate, summarise

LIMIT_ANGLE_URAD = 5.0
LIMIT_AMPLITUDE_PPM = 20.0
LIMIT_FLAG_PERIODS = 1.0
SHOCK_RAD_PER_S = 5.0  # a hundredth of the peak speed
DARK_S = 0.01
DROP_EVERY = 7
# Each drift would change the amplitude by a fifth without the loop; and the seconds in which the
# loop is back, and a few more.
DRIFTS = ((0.2, 2.2), (-0.8, 5.0))


def _one(config: Config, seconds: float, events: Events) -> tuple[Run, Summary]:
    run = simulate(config, seconds, events)
    return run, summarise(run)


def group(config: Config) -> str:
    """Return the heading of the figures."""
    clock, times = config.clock.frequency_hz / 1e6, config.mirror.oversample
    return f"mirror loop, {clock:g} MHz x {times}, jitter {config.mems.jitter_ns:g} ns"


def steady(config: Config, seconds: float) -> list[Figure]:
    """Return the figures of a start and some time of RUN."""
    name = group(config)
    _, found = _one(config, seconds, Events())
    step_ns = 1e9 / (config.clock.frequency_hz * config.mirror.oversample)
    jitter_ns = config.mems.jitter_ns
    return [
        Figure(
            name, "RUN after power-on", "s", found.start_s, headline="mirror in RUN after power-on"
        ),
        Figure(
            name,
            "angle against the mirror's truth in RUN, rms",
            "urad",
            found.angle_rms_urad,
            limit=LIMIT_ANGLE_URAD,
            headline="angle against the mirror's truth in RUN, rms",
        ),
        Figure(name, "the same, largest", "urad", found.angle_max_urad),
        Figure(
            name,
            "amplitude held, rms",
            "ppm",
            found.amplitude_rms_ppm,
            limit=LIMIT_AMPLITUDE_PPM,
            headline="mirror's amplitude held, rms",
        ),
        Figure(name, "index step", "ns", step_ns),
        # A step is uniform: its variance is a twelfth of its square.
        Figure(
            name,
            "index crossing, rms",
            "ns",
            found.crossing_rms_ns,
            floor=math.hypot(jitter_ns, step_ns / math.sqrt(12.0)),
            headline="index crossing, rms",
        ),
    ]


def faults(config: Config, seconds: float) -> list[Figure]:
    """Return how soon a shock, lost passes and a dark diode are flagged, and for how long."""
    name = group(config)
    figures = []
    # The first pass is lost some periods after the losses begin; this delay is not a reaction time.
    for text, events, judged in (
        (f"shock of {SHOCK_RAD_PER_S:g} rad/s", Events(shock_rad_per_s=SHOCK_RAD_PER_S), True),
        (f"one pass of {DROP_EVERY} lost", Events(drop_every=DROP_EVERY), False),
        (f"laser off the diode for {1e3 * DARK_S:g} ms", Events(laser_off_s=DARK_S), True),
    ):
        _, found = _one(config, seconds, events)
        figures += [
            Figure(
                name,
                f"{text}: flagged after",
                "periods",
                found.flag_delay_periods,
                limit=LIMIT_FLAG_PERIODS if judged else math.nan,
                headline="shock or lost index flagged after" if judged else "",
            ),
            Figure(name, f"{text}: last flag after", "s", found.flagged_s),
            Figure(
                name,
                f"{text}: largest angle error until then",
                "urad",
                found.unnoticed_urad,
            ),
            Figure(
                name,
                f"{text}: angle where not flagged, but for those, rms",
                "urad",
                found.angle_rms_urad,
                limit=LIMIT_ANGLE_URAD,
            ),
        ]
    return figures


def drift(config: Config, drift_hz: float, seconds: float) -> list[Figure]:
    """Return the figures of the loop after a sudden change of the natural frequency."""
    name = group(config)
    run, found = _one(config, seconds, Events(drift_hz=drift_hz))
    text = f"natural frequency {drift_hz:+g} Hz at once"
    late = run.running & (run.flags == 0) & (run.time_s > run.event_s + found.back_s)
    error = 1e6 * run.error_rad[late]
    return [
        Figure(name, f"{text}: amplitude off by, at most", "ppm", found.largest_ppm),
        Figure(
            name,
            f"{text}: back within 100 ppm after",
            "s",
            found.back_s,
            # The time is stated, not limited; but the loop has to come back.
            limit=0.0 if math.isnan(found.back_s) else math.nan,
            headline="amplitude back within 100 ppm, after a drift worth 20 % of it",
        ),
        Figure(
            name,
            f"{text}: angle from then on, rms",
            "urad",
            rms(error),
            limit=LIMIT_ANGLE_URAD,
        ),
    ]
