"""How much laser power is safe to look into: emission limits for the moving and the stuck beam.

Limits and rules are those of IEC 60825-1:2014 (edition 3), 400 to 1050 nm, for a small source (no
credit for an extended one, C6 = 1) and a beam narrower than the pupil, so that all of it can enter
the eye. The pupil is that of the standard's condition 3, 7 mm wide at 100 mm from the pivot.

The model leaves out classes 1M, 2M and 3B, viewing through instruments, the skin, every fault but a
mirror at rest, and the diode's spread of power. It helps to choose a power; a product is classified
by measurement.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from vrscan.data.errors import InputError

LaserClass = Literal["1", "2", "3R"]
CLASSES: tuple[LaserClass, ...] = ("1", "2", "3R")

PUPIL_MM = 7.0
DISTANCE_MM = 100.0
LONG_S = 100.0  # time base above 400 nm without intended viewing
BLINK_S = 0.25  # time base where the eye turns away: classes 2 and 3R, 400 to 700 nm
GROUP_S = 5e-6  # Ti: a shorter pulse, or all pulses within it, act as one
MANY_S = 10.0  # T2 of a small source: pulses are counted for no longer

_SHORTEST_S = 1e-13
_LONGEST_S = 3e4
_VISIBLE_NM = 700.0


def _visible(wavelength_nm: float) -> bool:
    if not 400.0 <= wavelength_nm <= 1050.0:
        raise InputError(f"wavelength_nm = {wavelength_nm:g}: limits are known for 400 to 1050 nm")
    return wavelength_nm < _VISIBLE_NM


def correction(wavelength_nm: float) -> float:
    """Return C4 of IEC 60825-1 (C_A of ANSI Z136.1): 10^(0.002 (lambda - 700)) from 700 nm on.

    Detectability prints 10^(2 (lambda - 700)), which is this with lambda and 700 in thousands.

    Raises:
        InputError: outside 400 to 1050 nm.
    """
    return 1.0 if _visible(wavelength_nm) else math.pow(10.0, 0.002 * (wavelength_nm - 700.0))


def ansi_exposure_j_cm2(wavelength_nm: float, time_s: float) -> float:
    """Return the exposure that ANSI Z136.1 allows the cornea, 1.8 C_A t^0.75 mJ/cm^2.

    It is detectability's MPE, for an eye that looks into the beam: ``emission_limit_j`` of class 1
    is that over the pupil's 0.385 cm^2, to 1 %.

    Args:
        wavelength_nm: Wavelength, 700 to 1050.
        time_s: Duration of the exposure, 18e-6 to 10.

    Raises:
        InputError: outside these wavelengths or times.
    """
    if not 700.0 <= wavelength_nm <= 1050.0:
        raise InputError(f"wavelength_nm = {wavelength_nm:g}: (5) is for 700 to 1050 nm")
    if not 18e-6 <= time_s <= 10.0:
        raise InputError(f"time_s = {time_s:g}: (5) is for 18e-6 to 10 s")
    return 1.8e-3 * correction(wavelength_nm) * math.pow(time_s, 0.75)


def emission_limit_j(laser_class: LaserClass, wavelength_nm: float, time_s: float) -> float:
    """Return the energy that a class allows into the pupil in one exposure, J.

    Class 1 (table 3 of IEC 60825-1:2014): 3.8e-8 to 10 ps, 7.7e-8 C4 to 5 us, 7e-4 C4 t^0.75 to
    10 s, 0.39 C4 mW beyond, where 400 to 600 nm are limited by photochemistry too: 3.9e-3 C3 J to
    100 s, 3.9e-5 C3 W beyond, C3 = 10^(0.02 (lambda - 450)) from 450 nm on. Class 2 is class 1 to
    0.25 s and 1 mW beyond. Class 3R is five times class 1, below 700 nm five times class 2.

    Args:
        laser_class: One of ``CLASSES``.
        wavelength_nm: Wavelength, 400 to 1050; class 2 exists below 700 only.
        time_s: Duration of the exposure, 1e-13 to 3e4.

    Raises:
        InputError: outside these wavelengths.
        ValueError: outside these times.
    """
    if not _SHORTEST_S <= time_s <= _LONGEST_S:
        raise ValueError(f"emission_limit_j: {time_s} s is outside 1e-13 to 3e4 s")
    visible, c4 = _visible(wavelength_nm), correction(wavelength_nm)
    if laser_class == "2" and not visible:
        raise InputError(f"wavelength_nm = {wavelength_nm:g}: class 2 exists for 400 to 700 nm")
    if laser_class == "3R":
        return 5.0 * emission_limit_j("2" if visible else "1", wavelength_nm, time_s)
    if laser_class == "2" and time_s >= BLINK_S:
        return 1e-3 * time_s
    if time_s <= 1e-11:
        return 3.8e-8
    if time_s <= GROUP_S:
        return 7.7e-8 * c4
    if time_s <= 10.0:
        return 7e-4 * c4 * math.pow(time_s, 0.75)
    thermal = 3.9e-4 * c4 * time_s
    if wavelength_nm > 600.0:
        return thermal
    c3 = math.pow(10.0, 0.02 * max(wavelength_nm - 450.0, 0.0))
    return min(thermal, 3.9e-5 * c3 * max(time_s, 100.0))


def time_base_s(laser_class: LaserClass, wavelength_nm: float) -> float:
    """Return the time for which a class assumes that the eye looks into the beam, s."""
    turns_away = laser_class != "1" and _visible(wavelength_nm)
    return BLINK_S if turns_away else LONG_S


def train_factor(pulse_s: float, pulses: float, exposure_s: float) -> float:
    """Return C5, the factor by which a train lowers the limit of each of its pulses.

    Edition 3, small source: 1 for pulses longer than 5 us, for exposures to 0.25 s, and to 600
    pulses; beyond 5 N^(-1/4), not below 0.4. (Edition 2 had N^(-1/4) for every train.)

    Args:
        pulse_s: Duration of each pulse.
        pulses: Number N of pulses in the exposure, or in 10 s if that is shorter; those within 5 us
            are one.
        exposure_s: The time base.
    """
    if pulse_s > GROUP_S or exposure_s <= BLINK_S or pulses <= 600.0:
        return 1.0
    return max(0.4, 5.0 * math.pow(pulses, -0.25))


@dataclass(frozen=True)
class Emission:
    """A beam that a mirror moves, a0 sin(2 pi f t), and that may be pulsed."""

    wavelength_nm: float = 658.0
    mirror_hz: float = 249.0
    amplitude_rad: float = math.radians(20.5)
    opening_rad: float = math.inf  # half opening of the housing, which blocks the beam beyond
    rate_hz: float = 0.0  # rate of the pulses; 0 is a continuous beam
    pulse_s: float = 0.0

    def __post_init__(self) -> None:
        """Check that the values describe a beam.

        Raises:
            ValueError: for a rate, time or angle that is negative, or pulses that overlap.
        """
        if not (self.mirror_hz > 0.0 and self.amplitude_rad > 0.0 and self.opening_rad > 0.0):
            raise ValueError("Emission: frequency, amplitude and opening must be positive")
        if self.rate_hz < 0.0 or (
            self.rate_hz > 0.0 and not 0.0 < self.pulse_s <= 1 / self.rate_hz
        ):
            raise ValueError("Emission: pulses must have a duration and not overlap")

    @property
    def duty(self) -> float:
        """Return the share of the time for which the laser is on."""
        return self.rate_hz * self.pulse_s if self.rate_hz > 0.0 else 1.0


def passes(emission: Emission, centre_rad: float) -> tuple[tuple[float, float], ...]:
    """Return when, within a period of the mirror, the beam is in a pupil.

    The pupil is ``PUPIL_MM`` wide at ``DISTANCE_MM``; a beam of its own width would enter it partly
    for longer, with the same energy.

    Args:
        emission: The moving beam; time 0 is where it passes the middle, rising.
        centre_rad: Angle of the pupil's centre, on either side.

    Returns:
        Start and end of each pass, s, in order: two passes, one at the turning point, or none.
    """
    half = math.atan(0.5 * PUPIL_MM / DISTANCE_MM)
    centre = abs(centre_rad)
    reach = min(emission.amplitude_rad, emission.opening_rad)
    low, high = max(centre - half, -reach), min(centre + half, reach)
    if low >= high:
        return ()
    turn = 2.0 * math.pi * emission.mirror_hz
    first = math.asin(low / emission.amplitude_rad) / turn
    last = math.asin(high / emission.amplitude_rad) / turn
    half_period = 0.5 / emission.mirror_hz
    if high >= emission.amplitude_rad:  # it turns round inside the pupil
        return ((first, half_period - first),)
    return (first, last), (half_period - last, half_period - first)


@dataclass(frozen=True)
class SafePower:
    """The largest power of a class, and the rule that limits it."""

    laser_class: LaserClass
    place: str  # place of the pupil: "middle", "end" or "stalled"
    power_w: float  # while the laser is on; the mean is duty times this
    rule: str  # "single pulse", "pulse train", "pass", "passes" or "average"
    time_s: float  # time over which the rule adds up energy


def _windows(
    emission: Emission, within: tuple[tuple[float, float], ...], base_s: float
) -> Iterator[tuple[str, float, float]]:
    """Yield rule, duration and the time in the pupil for stretches of the exposure.

    The limit's power falls as t^(-1/4), so only stretches from the start of one pass to the end of
    one can be the limiting ones. All of up to two periods are tried, then twice as many again and
    again.
    """
    period = 1.0 / emission.mirror_hz
    for start, end in within:
        yield "pass", end - start, end - start
    train = [(s + k * period, e + k * period) for k in range(3) for s, e in within]
    for k in range(len(within)):
        inside = train[k][1] - train[k][0]
        for start, end in train[k + 1 : k + 2 * len(within)]:
            inside += end - start
            yield "passes", end - train[k][0], inside
    share = sum(e - s for s, e in within) / period
    periods = 2.0
    longest = max(e - s for s, e in within)
    while periods * period < min(base_s, MANY_S):  # for longer times the limit is a power
        yield "passes", periods * period, share * periods * period + longest
        periods *= 2.0
    yield "average", base_s, share * base_s


def _largest(
    emission: Emission,
    laser_class: LaserClass,
    place: str,
    within: tuple[tuple[float, float], ...] | None,
) -> SafePower:
    """Return the limiting rule; ``within`` is None for a beam at rest in the pupil."""
    wavelength = emission.wavelength_nm
    base = time_base_s(laser_class, wavelength)
    pulsed = emission.rate_hz > 0.0
    found: list[tuple[float, str, float]] = []

    def bind(rule: str, time_s: float, on_s: float) -> None:
        limit = emission_limit_j(laser_class, wavelength, max(time_s, _SHORTEST_S))
        found.append((limit / on_s, rule, time_s))

    if within is None:
        share, stretches = 1.0, [("average", base, base)]
        # A burst of 2, 4, 8 ... pulses is a pulse as long as itself.
        burst = 2.0
        while pulsed and burst / emission.rate_hz < min(base, MANY_S):
            time_s = (burst - 1.0) / emission.rate_hz + emission.pulse_s
            stretches.append(("passes", time_s, burst / emission.rate_hz))
            burst *= 2.0
    else:
        share = sum(e - s for s, e in within) * emission.mirror_hz
        stretches = list(_windows(emission, within, base))

    for rule, time_s, inside in stretches:
        if not pulsed:
            bind(rule, time_s, inside)
            continue
        # The lines are not locked to the mirror: a stretch may hold one pulse more.
        extra = 0.0 if rule == "average" or within is None else 1.0
        pulses = inside * emission.rate_hz
        pulses = math.floor(pulses) + extra if rule == "pass" else pulses + extra
        bind(rule, time_s, max(pulses, 1.0) * emission.pulse_s)

    # The single pulse and, with C5, the train of it; what comes within 5 us is one pulse.
    if pulsed:
        grouped = max(1.0, math.floor((GROUP_S - emission.pulse_s) * emission.rate_hz) + 1.0)
        length = emission.pulse_s if grouped == 1.0 else max(emission.pulse_s, GROUP_S)
        on_s, each = grouped * emission.pulse_s, emission.rate_hz / grouped
        number = share * each * min(base, MANY_S)
    elif within is not None:
        length = on_s = max(e - s for s, e in within)
        number = len(within) * emission.mirror_hz * min(base, MANY_S)
    else:
        length, on_s, number = base, base, 1.0
    factor = train_factor(length, number, base)
    if pulsed or factor < 1.0:
        limit = emission_limit_j(laser_class, wavelength, length)
        found.append(
            (factor * limit / on_s, "pulse train" if factor < 1.0 else "single pulse", length)
        )
    power, rule, time_s = min(found)
    return SafePower(laser_class, place, power, rule, time_s)


def largest_safe_power(emission: Emission) -> tuple[SafePower, ...]:
    """Return the largest power of each class, for the moving and for the stuck beam.

    The pupil has three places: in the middle of the scan, where the beam is fastest; where the beam
    stays longest, at the end of the scan or of the opening; and in a beam that rests. The class of
    a product is that of the second place, and the third is the reason for its interlock.

    Rules (IEC 60825-1:2014, 4.3 f): each pulse is below its limit; each stretch of the exposure,
    taken as one pulse, is below the limit of its length, up to the mean over the time base; and
    each pulse of a train is below C5 times its limit. Class 2 is given from 400 to 700 nm only.

    Args:
        emission: The beam and its motion.

    Returns:
        Every class at every place, class by class.

    Raises:
        InputError: for a wavelength outside 400 to 1050 nm.
    """
    half = math.atan(0.5 * PUPIL_MM / DISTANCE_MM)
    reach = min(emission.amplitude_rad, emission.opening_rad)
    middle = passes(emission, 0.0)
    end = passes(emission, max(reach - half, 0.0))
    rows = []
    for laser_class in CLASSES:
        if laser_class == "2" and not _visible(emission.wavelength_nm):
            continue
        for place, within in (("middle", middle), ("end", end), ("stalled", None)):
            rows.append(_largest(emission, laser_class, place, within))
    return tuple(rows)
