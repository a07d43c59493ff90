"""Calibration scans without light: the true equations and Gaussian noise, for the calibration."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vrscan.calibrate.recording import Recording, Setup
from vrscan.data.config import Config, load
from vrscan.ideal.geometry import project, triangle, undistorted
from vrscan.scene.timeline import Scan, timeline
from vrscan.scene.tolerances import Instrument

CONFIG = Config()
POLYGON = load(Path("polygon"))
NOISE_PX = 0.1
FREQUENCY_HZ = CONFIG.mirror.frequency_hz


def plane(z_mm: float, focus_mm: float = 360.0, **other: float) -> Setup:
    own = {"frequency_hz": FREQUENCY_HZ} | other
    return Setup(kind="plane", z_mm=z_mm, focus_mm=focus_mm, **own)


def relief(z_mm: float, focus_mm: float = 360.0, **other: float) -> Setup:
    own = {"amplitude_mm": 5.0, "period_mm": 40.0, "frequency_hz": FREQUENCY_HZ} | other
    return Setup(kind="relief", z_mm=z_mm, focus_mm=focus_mm, **own)


def scanned(
    setup: Setup,
    instrument: Instrument,
    seed: int,
    *,
    frames: int = 4503,
    noise_px: float = NOISE_PX,
    off_mm: float = 0.0,
    lens: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
    config: Config = CONFIG,
) -> Recording:
    """Return a scan of a surface: where beam and surface meet, and where the camera sees it.

    Args:
        setup: What is said to stand there.
        instrument: The true instrument.
        seed: Seed of the noise.
        frames: Number of lines.
        noise_px: Standard deviation of the positions.
        off_mm: Error of the stated distance.
        lens: What is added to positions, px, from angle and position.
        config: What the instrument believes; of a polygon the setup has the facets.
    """
    own = instrument.model_copy(update={"drive_phase": setup.drive_phase})
    when = timeline(0, frames, frames, config, Scan(), seed, own)
    true = own.true(config, setup.focus_mm)
    angle = when.angle_rad
    z = np.full(frames, setup.z_mm + off_mm)
    for _ in range(60):  # the beam meets the surface: z = surface(z tan a), which hardly bends
        z = 0.5 * z + 0.5 * (setup.z(z * np.tan(angle)) + off_mm)
    position = project(z * np.tan(angle), z, true.geometry)
    if lens is not None:
        position = position + lens(angle, position)
    rng = np.random.default_rng(seed)
    position = position + noise_px * rng.standard_normal(frames)
    good = np.isfinite(position) & (position > 5.0) & (position < 2042.0)
    believed, _ = undistorted(position[good], config.geometry)
    found = triangle(believed, when.reported_rad[good], config.geometry)
    if setup.facets:  # a pulse lasts as long as the beam is on the diode
        width = 2.0 * config.mems.diode_deg * setup.facets / 720.0 / setup.frequency_hz
        index_s = np.add.outer(when.index_s, [-0.5 * width, 0.5 * width])
    else:
        out = np.flatnonzero(when.index_outward[:-1] & ~when.index_outward[1:])
        index_s = np.stack([when.index_s[out], when.index_s[out + 1]], axis=1)
    return Recording(
        name=f"{setup.kind}-{setup.z_mm:g}",
        setup=setup,
        line=when.line[good].astype(np.float64),
        time_s=when.time_s[good],
        position_px=position[good],
        sigma_px=np.full(int(good.sum()), max(noise_px, 1e-3)),
        angle_rad=when.reported_rad[good],
        x_mm=found.x,
        z_mm=found.z,
        out_s=index_s[:, 0],
        in_s=index_s[:, 1],
    )


def angle_error_urad(config: Config, instrument: Instrument) -> float:
    """Return the rms error of the angle that a configuration reports, in the camera's view."""
    when = timeline(0, 3002, 3002, config, Scan(jitter_ns=0.0), 1, instrument)
    error = 1e6 * (when.reported_rad - when.angle_rad)
    view = np.abs(when.angle_rad) < math.radians(13.0)
    return float(np.sqrt(np.mean(np.square(error[view]))))
