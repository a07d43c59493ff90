"""What the instrument is, where it differs from what its configuration believes.

The light sees the instrument of a scene's ``[instrument]``; the chain computes with the
configuration. What the table does not name is as the configuration has it. The tolerances from
which ``drawn`` takes an instrument are those of VR-SCAN's set-up: a base within 0.2 mm, an index
mark within 1 mrad, and the 0.9 um by which it may move (IV-E).

The model leaves out bending of the frame, an index mark or a mirror that is tilted about other axes
than the scan's, a lens whose axis moves as it focuses, and changes of temperature within a scan.
"""

import math
from collections.abc import Sequence

import numpy as np
from pydantic import Field, field_validator

from vrscan.data.config import HARMONICS, Config, Geometry, Mirror, Positive, Section
from vrscan.data.errors import InputError
from vrscan.ideal.geometry import ThinLens

# Largest difference, either way, of a drawn instrument from the shipped configuration.
BASE_MM = 0.2
BIAS_DEG = 0.3
OFFSET_MM = 0.2
FOCAL_SHARE = 0.01
CENTRE_PX = 10.0
DISTORTION_SHARE = 0.002  # of each term of (5), of the image's height at the sensor's end
HARMONIC_SHARE = 0.1  # of a_k, and of phi_k in rad
INDEX_MRAD = 1.0
INDEX_DRIFT_MRAD = 0.06  # 0.9 um of the diode, over DRIFT_K
STAGE_UM = 5.0
DRIFT_K = 10.0  # rise of temperature from switching on to the stationary state
NATURAL_DRIFT_HZ = 0.2  # over DRIFT_K: it changes the amplitude of a free mirror by 20 %
_STREAM = 0x1257


class Instrument(Section):
    """A scene's table ``[instrument]``; what is left out is as the configuration has it."""

    seed: int | None = Field(default=None, ge=0)  # that it was drawn from
    base_mm: Positive | None = None
    bias_deg: float | None = Field(default=None, gt=0, lt=180)
    offset_mm: float | None = None
    focal_mm: Positive | None = None  # f of (4), with the focus at reference_focus_mm
    centre_px: float | None = None
    k1: float | None = None
    k2: float | None = None
    # Depth in focus at which the image has the scale of focal_mm. Without it the scale is that of
    # focal_mm at every focus.
    reference_focus_mm: Positive | None = None

    harmonics: list[list[float]] | None = None
    amplitude_deg: float | None = Field(default=None, gt=0, lt=90)
    index_deg: float | None = Field(default=None, gt=-90, lt=90)
    # Operating point: phase of the drive, turns, which the instrument measures.
    drive_phase: float | None = Field(default=None, ge=0, lt=1)

    # Drifts: the temperature rises to temperature_k above that of the calibration, with a time
    # constant from switching on; a scan begins at scan.start_s and keeps its temperature.
    temperature_k: float = Field(default=0.0, ge=-200, le=200)
    warm_s: float = Field(default=0.0, ge=0)
    index_urad_per_k: float = 0.0
    amplitude_ppm_per_k: float = 0.0
    # Of the mirror. It has no effect on what is simulated: the mirror's loop makes up for it.
    natural_hz_per_k: float = 0.0

    stage_um: float = Field(default=0.0, ge=0)  # largest error of the stage's positions

    @field_validator("harmonics")
    @classmethod
    def _as_mirror(cls, value: list[list[float]] | None) -> list[list[float]] | None:
        return None if value is None else Mirror(harmonics=value).harmonics

    def warmth_k(self, start_s: float) -> float:
        """Return the rise of temperature at a time after switching on, K."""
        if self.warm_s == 0.0:
            return self.temperature_k
        return self.temperature_k * -math.expm1(-start_s / self.warm_s)

    def true(self, config: Config, focus_mm: float, start_s: float = 0.0) -> Config:
        """Return a configuration that is right about this instrument.

        Args:
            config: What the instrument believes.
            focus_mm: Depth that the lens is focused at.
            start_s: Time after switching on.

        Raises:
            InputError: if the focus or its reference is not farther away than the focal length,
                values do not go together, or the axis is that of another sensor.
        """
        pixels, axis = config.sensor.line_length, config.geometry.centre_px
        if self.centre_px is not None and abs(self.centre_px - axis) > pixels / 4:
            raise InputError(
                f"instrument.centre_px = {self.centre_px:g}: the configuration has a sensor of "
                f"{pixels} px with its axis at {axis:g}"
            )
        own = self.model_dump(include=set(Geometry.model_fields), exclude_none=True)
        geometry = config.geometry.model_copy(update=own)
        if self.reference_focus_mm is not None:
            at, reference = (
                ThinLens.of(1.0, focus, geometry).image_mm
                for focus in (focus_mm, self.reference_focus_mm)
            )
            focal = geometry.focal_mm * at / reference
            geometry = geometry.model_copy(update={"focal_mm": focal})
        mirror = self.moving(config.mirror, start_s)
        return config.model_copy(update={"geometry": geometry, "mirror": mirror})

    def moving(self, mirror: Mirror, start_s: float = 0.0) -> Mirror:
        """Return the mirror and its index mark as they are.

        Args:
            mirror: What the configuration believes.
            start_s: Time after switching on.
        """
        warmth = self.warmth_k(start_s)
        mirror = believed(mirror, self.drive_phase)
        index = mirror.index_deg if self.index_deg is None else self.index_deg
        size = mirror.amplitude_deg if self.amplitude_deg is None else self.amplitude_deg
        return mirror.model_copy(
            update={
                "index_deg": index + math.degrees(1e-6 * self.index_urad_per_k * warmth),
                "amplitude_deg": size * (1.0 + 1e-6 * self.amplitude_ppm_per_k * warmth),
                "harmonics": mirror.harmonics if self.harmonics is None else self.harmonics,
            }
        )


def believed(mirror: Mirror, drive_phase: float | None) -> Mirror:
    """Return the mirror that the instrument computes with at an operating point.

    Args:
        mirror: The configuration's mirror, whose harmonics are straight lines over the phase of the
            drive.
        drive_phase: That phase, turns, or None for the configuration's.
    """
    if drive_phase is None:
        return mirror
    away = (drive_phase - mirror.drive_phase + 0.5) % 1.0 - 0.5
    harmonics = np.array(mirror.harmonics) + away * np.array(mirror.slopes)
    return mirror.model_copy(update={"harmonics": harmonics.tolist()})


def drawn(seed: int, config: Config | None = None) -> Instrument:
    """Return an instrument whose parameters differ from a configuration's by its tolerances.

    Each difference is uniform between the two limits of this module. The first harmonic is 1 by
    definition, and so is its phase 0. A polygon has no harmonics and no natural frequency; its
    facets and its speed are those of ``[polygon]``.

    Args:
        seed: Seed of the random numbers, not negative.
        config: What the differences are added to; the shipped configuration if None.

    Raises:
        InputError: if the seed is negative.
    """
    if seed < 0:
        raise InputError(f"--seed: must not be negative ({seed})")
    config = config or Config()
    rng = np.random.default_rng((seed, _STREAM))

    def within(limit: float) -> float:
        return float(rng.uniform(-limit, limit))

    geometry, mirror = config.geometry, config.mirror
    edge_mm = 0.5 * config.sensor.line_length * geometry.pitch_mm
    harmonics = [list(pair) for pair in mirror.harmonics]
    drift_hz = 0.0 if mirror.polygon else NATURAL_DRIFT_HZ
    for row in range(1, 1 if mirror.polygon else len(HARMONICS)):
        harmonics[row][0] *= 1.0 + within(HARMONIC_SHARE)
        harmonics[row][1] += within(HARMONIC_SHARE)
    return Instrument(
        seed=seed,
        base_mm=geometry.base_mm + within(BASE_MM),
        bias_deg=geometry.bias_deg + within(BIAS_DEG),
        offset_mm=geometry.offset_mm + within(OFFSET_MM),
        focal_mm=geometry.focal_mm * (1.0 + within(FOCAL_SHARE)),
        centre_px=geometry.centre_px + within(CENTRE_PX),
        k1=geometry.k1 + within(DISTORTION_SHARE) / edge_mm**2,
        k2=geometry.k2 + within(DISTORTION_SHARE) / edge_mm**4,
        reference_focus_mm=config.free.focus_mm,
        harmonics=None if mirror.polygon else harmonics,
        index_deg=mirror.index_deg + math.degrees(1e-3 * within(INDEX_MRAD)),
        index_urad_per_k=1e3 * within(INDEX_DRIFT_MRAD) / DRIFT_K,
        natural_hz_per_k=math.copysign(drift_hz, within(1.0)) / DRIFT_K,
        stage_um=STAGE_UM,
    )


def written(instrument: Instrument) -> str:
    """Return the instrument as a TOML file, ``[instrument]``; what it leaves out is left out."""
    lines = ["# The simulated instrument as it is; the configuration says what it believes."]
    lines.append("[instrument]")
    for name, value in instrument.model_dump(exclude_none=True, exclude_defaults=True).items():
        lines.append(f"{name} = {_toml(value)}")
    return "\n".join(lines) + "\n"


def _toml(value: float | Sequence[Sequence[float]]) -> str:
    """Return a number, or rows of numbers, as TOML."""
    if isinstance(value, int | float):
        return repr(value)
    rows = "".join(f"    [{', '.join(map(repr, row))}],\n" for row in value)
    return f"[\n{rows}]"
