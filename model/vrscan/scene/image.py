"""The spot's image on a sensor of one row: how wide, how high, how much of it falls on the row.

A spot on the row is a slice through its image, not a projection of it. For a Gaussian image, 1/e2
half height 2 s_y, blurred by a defocused lens's disc of radius a, the slice is the Gaussian along
the row convolved with

    k(x) = erf(sqrt(a^2 - x^2) / (sqrt(2) s_y)) / (pi a^2)    for |x| < a,

the disc's chord seen through the Gaussian's height: a box for a spot much lower than the disc, the
semicircle for one much higher. A cut beam is no product along and across the row; its profile and
its light are those of ``row_profile``. Everything else that blurs is a factor in the spatial
frequency: pixel, diffraction, motion during the pulse, coma. So a line is one short inverse Fourier
transform, at the same price whatever blurs it.

It leaves out: field curvature and astigmatism (the instrument's triplet has little), the change of
the focal distance with focus, which calibration takes up, and a row that is not straight.
"""

import functools
import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.special import erf, erfcx

from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import Config
from vrscan.data.kept import Array, kept
from vrscan.ideal.geometry import ThinLens
from vrscan.scene.legendre import legendre
from vrscan.scene.radiometry import mtf
from vrscan.scene.row_profile import CutBeam

Singles = npt.NDArray[np.float32]
Clock = Callable[[str], AbstractContextManager[None]]

WIDTHS = (32, 64, 128, 256, 512, 1024, 2048)  # px: the windows that a profile may have
REACH = 5.5  # sigmas of the Gaussian; 5e-7 of the peak is left there
_TAIL = 9.0  # lengths of the coma; 1e-4 of its peak is left there
_MARGIN = 4.0  # px
_LEAST = 1e-7  # least value of a Gaussian's transform that counts,
_BAND = 0.91  # and the frequency at which it has it, over 1 / sigma
_ROW_VARIANCE = 1.0 / 12.0  # px^2: variance of the row's own height

# Cycles a pulse at which its transform is wanted: the middles of the table's steps, as each stands
# for all of its step; but 0 for 0, where no light is lost.
_TURN = 0.001
PULSE_TURNS = _TURN * np.concatenate([[0.0], np.arange(1.5, 64000.0)])

_STEP = 0.01  # step of the table's frequency, in cycles per disc radius
_END = 64.0  # frequency above which the slice's transform counts as zero
_HEIGHTS = np.geomspace(0.02, 50.0, 64)  # s_y / a
_NODES = 800  # nodes of the quadrature over a quarter turn: the last frequency has 64 periods


@functools.cache
def _slices() -> tuple[npt.NDArray[np.float32], Floats]:
    found = kept(_sliced, names=("table", "share"))
    return np.asarray(found["table"], np.float32), np.asarray(found["share"], np.float64)


def _sliced() -> dict[str, Array]:
    """Return the normalised transform of k [heights, frequencies], and the row's share [heights].

    The share is the integral of k for a = 1: of all light in the image, the part in a row of height
    1 where the disc's radius is 1.
    """
    node, weight = legendre(_NODES)
    angle, weight = 0.25 * np.pi * (node + 1.0), 0.25 * np.pi * weight
    # x = sin(angle): 2/pi integral cos(angle) erf(cos(angle) / (sqrt2 r)) cos(2 pi q sin(angle)).
    chord = np.cos(angle) * erf(np.cos(angle) / (np.sqrt(2.0) * _HEIGHTS[:, None])) * weight
    frequency = np.arange(0.0, _END + 1.5 * _STEP, _STEP)
    wave = np.cos(2.0 * np.pi * np.sin(angle)[:, None] * frequency)
    table = 2.0 / np.pi * chord @ wave
    share = table[:, 0].copy()
    return {"table": (table / share[:, None]).astype(np.float32), "share": share}


def defocus_radius_px(depth_mm: Floats, focus_mm: float, f_number: float, config: Config) -> Floats:
    """Return the radius of the disc into which a point out of focus is blurred, geometric optics.

    It is pupil / 2 times the sensor's distance times |1 / depth - 1 / focus|.

    Args:
        depth_mm: Distance from the lens along its axis [n].
        focus_mm: Depth that is in focus.
        f_number: f-number of the lens, focal length over pupil.
        config: The configuration, whose focal length and pitch are used.

    Raises:
        InputError: if the focus is not farther away than the focal length.
    """
    lens = ThinLens.of(f_number, focus_mm, config.geometry)
    per_mm = 0.5 * lens.pupil_mm * lens.image_mm / config.geometry.pitch_mm
    return np.asarray(per_mm * np.abs(1.0 / np.maximum(depth_mm, 1e-3) - 1.0 / focus_mm))


def band(sigma_y_px: Floats, radius_px: Floats) -> Floats:
    """Return the height of the band of the spot that the row sees, as ``CutBeam`` counts it [n].

    The row's height and the disc's chord, which changes along the row, count as one band of the
    same mean square.

    Args:
        sigma_y_px: Sigma of the nearest Gaussian across the row, half of its 1/e2 radius [n].
        radius_px: Radius of the defocused disc [n].
    """
    disc = np.sqrt(np.square(radius_px) + 4.0 * _ROW_VARIANCE)
    return np.asarray(disc / (disc + 2.0 * sigma_y_px))


def row_share(
    sigma_y_px: Floats,
    radius_px: Floats,
    offset_px: Floats | float = 0.0,
    *,
    cut: CutBeam | None = None,
    zone: Floats | None = None,
) -> Floats:
    """Return the share of the spot's light that falls on the row: iria's eta_B for one row.

    The row is thinner than the image: its height enters as 1/12 px^2 of variance, with an error of
    0.2 % at s_y = 1 px. An offset of the row enters as if disc and spot were one Gaussian.

    Args:
        sigma_y_px: Sigma of the Gaussian across the row, or of the one nearest to a cut beam [n].
        radius_px: Radius of the defocused disc [n].
        offset_px: Offset of the row from the image's middle, [n] or one for all.
        cut: Tables of a cut beam; None for a Gaussian.
        zone: Zones of a cut beam [n]; given with ``cut``.
    """
    if cut is not None and zone is not None:
        beam = np.maximum(2.0 * sigma_y_px, 1e-6)
        share = cut.row_share(1.0 / beam, radius_px / beam, zone)
        spread = np.square(sigma_y_px) + 0.25 * np.square(radius_px) + _ROW_VARIANCE
        return np.asarray(share * np.exp(-0.5 * np.square(offset_px) / spread))
    sigma = np.sqrt(np.square(sigma_y_px) + _ROW_VARIANCE)
    disc = np.maximum(radius_px, 1e-6)
    _, shares = _slices()
    ratio = sigma / disc
    inside = np.interp(np.log(np.minimum(ratio, _HEIGHTS[-1])), np.log(_HEIGHTS), shares) / disc
    high = 1.0 / (np.sqrt(2.0 * np.pi) * np.sqrt(np.square(sigma) + 0.25 * np.square(disc)))
    share = np.where(ratio < _HEIGHTS[-1], inside, high)
    width = np.square(sigma) + 0.25 * np.square(radius_px)
    return np.asarray(np.minimum(share * np.exp(-0.5 * offset_px**2 / width), 1.0))


def beneath_height(sigma_y_px: Floats, radius_px: Floats, across_px: Floats) -> Floats:
    """Return the height of the spot over that of its light from beneath the surface, x [n].

    That light is spread as a diffusion with attenuation spreads it in two dimensions: by
    K_0(r / b), whose transform is 1 / (1 + (2 pi b f)^2). What the row sees of it is, for a
    Gaussian spot of sigma s across the row, the integral of both transforms over the frequency
    across the row: erfcx(x A) / (2 b A), with x = s / (sqrt2 b) and A^2 = 1 + (2 pi b f)^2 of the
    frequency along it. Scales along and across the row may differ. The disc counts as a Gaussian
    of the same variance.

    Args:
        sigma_y_px: Sigma of the spot across the row [n].
        radius_px: Radius of the defocused disc [n].
        across_px: Scale b of the spread across the row [n].
    """
    variance = np.square(sigma_y_px) + 0.25 * np.square(radius_px) + _ROW_VARIANCE
    return np.asarray(np.sqrt(0.5 * variance) / np.maximum(across_px, 1e-6))


def beneath_share(height: Floats) -> Floats:
    """Return the row's share of light from beneath the surface over that of the spot itself [n].

    Args:
        height: Heights from ``beneath_height`` [n].
    """
    return np.asarray(math.sqrt(math.pi) * height * erfcx(height))


def window_width(sigma_px: Floats, radius_px: Floats, smear_px: Floats, coma_px: Floats) -> Ints:
    """Return the width of the window that each profile needs, one of ``WIDTHS`` [n]."""
    tail = _TAIL * np.abs(coma_px)
    reach = REACH * sigma_px + radius_px + 0.5 * smear_px + tail + _MARGIN
    place = np.searchsorted(np.array(WIDTHS), 2.0 * reach)
    return np.asarray(np.array(WIDTHS)[np.minimum(place, len(WIDTHS) - 1)], np.int64)


def diffraction(
    frequency: Floats, wavelength_nm: float, f_number: float, pitch_mm: float
) -> Floats:
    """Return the transfer of a circular pupil, iria (1-37), at frequencies in cycles/px.

    Args:
        frequency: Cycles per pixel, any shape.
        wavelength_nm: Wavelength.
        f_number: Working f-number, ``ThinLens.working``.
        pitch_mm: Pitch of the pixels.
    """
    cutoff = pitch_mm / (1e-6 * wavelength_nm * f_number)
    return mtf(np.minimum(frequency / cutoff, 1.0))


def frequencies(width: int) -> Floats:
    """Return the frequencies of a profile's spectrum, cycles/px, 0 to 1 [width + 1]."""
    return np.arange(width + 1) / width


def profiles(
    fraction_px: Floats,
    width: int,
    sigma_px: Floats,
    *,
    radius_px: Floats | None = None,
    height_ratio: Floats | None = None,
    speed_px: Floats | None = None,
    pulse: "Singles | None" = None,
    coma_px: Floats | None = None,
    beneath: Floats | None = None,
    transfer: Singles | None = None,
    shape: Singles | None = None,
    spectrum: npt.NDArray[np.complex64] | None = None,
    clock: Clock = lambda _: nullcontext(),
) -> Singles:
    """Return the share of each spot's light in the row that each pixel of its window holds.

    Args:
        fraction_px: Position of the spot, from the window's pixel width / 2 [n].
        width: Width of the windows, px, even.
        sigma_px: Sigma of the Gaussian along the row [n].
        radius_px: Radius of the defocused disc [n], or None.
        height_ratio: s_y over that radius [n]; given with it.
        speed_px: Distance that the spot moves in the pulse [n], or None.
        pulse: Transform of the pulse at ``PULSE_TURNS`` cycles per pulse; given with ``speed_px``.
        coma_px: Length of the one-sided exponential tail [n], towards rising pixels where it is
            positive, or None; the centroid stays.
        beneath: Of light from beneath a surface the length of its tail, as ``coma_px``, the scale
            of its spread along the row, px, and its ``beneath_height`` [n, 3], or None.
        transfer: Any other factor [width + 1], at ``frequencies(width)``; the pixel is included.
        shape: Replaces the Gaussian: the transform of another shape [n, width + 1].
        spectrum: Replaces a point: the spectrum of the light along the row, about the same pixel,
            [n, width + 1], which then also holds the position.
        clock: Function that is called with the name of an effect and returns a context that
            measures its time.

    Returns:
        float32 [n, width]; the rows sum to 1, except for what is beyond the window.
    """
    frequency = frequencies(width).astype(np.float32)
    if shape is None:
        least = float(sigma_px.min(initial=1.0))
        end = math.ceil(_BAND / least * width) + 1 if least > _BAND else width + 1
        sigma = sigma_px.astype(np.float32)[:, None]
        shape = np.exp(-np.square(np.float32(np.sqrt(2.0) * np.pi) * sigma * frequency[:end]))
        # Of each line the same frequencies, whichever others are with it.
        shape *= shape > np.float32(_LEAST)
    used = np.flatnonzero(shape.any(axis=0))
    end = int(used[-1]) + 1 if len(used) else 1
    frequency = frequency[:end]
    pixel = np.sinc(frequency)
    if transfer is not None:
        pixel = pixel * transfer[:end]
    kernel = shape[:, :end] * pixel
    if radius_px is not None and height_ratio is not None:
        with clock("defocus"):
            kernel *= _disc(frequency, radius_px, height_ratio)
    if speed_px is not None and pulse is not None:
        with clock("smear"):
            turn = np.abs(speed_px).astype(np.float32)[:, None] * frequency
            turn *= np.float32(1.0 / _TURN)
            kernel *= np.take(pulse, turn.astype(np.int32), mode="clip")
    if spectrum is None:
        turn = np.float32(-2.0 * np.pi) * fraction_px.astype(np.float32)[:, None] * frequency
        light = np.empty(turn.shape, np.complex64)
        light.real = kernel * np.cos(turn)
        light.imag = kernel * np.sin(turn)
    else:
        light = kernel * spectrum[:, :end]
    if coma_px is not None:
        with clock("coma"):
            light *= _tail(frequency, coma_px)
    if beneath is not None:
        with clock("subsurface"):
            light *= _tail(frequency, beneath[:, 0])
            light *= _spread(frequency, beneath[:, 1], beneath[:, 2])
    half = width // 2
    folded = np.zeros((len(light), half + 1), np.complex64)
    folded[:, :end] = light[:, : half + 1]
    if end > half:
        folded[:, width + 1 - end :] += np.conj(light[:, : half - 1 : -1])
    folded[:, 1::2] *= -1.0  # the window's pixel width / 2 is the origin
    return np.asarray(fft.irfft(folded, width, axis=1), np.float32)


def _tail(frequency: Singles, coma_px: Floats) -> npt.NDArray[np.complex64]:
    """Return the transform of an exponential tail, its mean at 0."""
    turn = np.float32(2.0 * np.pi) * coma_px.astype(np.float32)[:, None] * frequency
    # exp(i t) / (1 + i t), with real numbers: numpy's complex division is slow.
    cosine, sine, scale = np.cos(turn), np.sin(turn), 1.0 / (1.0 + np.square(turn))
    found = np.empty(turn.shape, np.complex64)
    found.real = (cosine + turn * sine) * scale
    found.imag = (sine - turn * cosine) * scale
    return found


def _spread(frequency: Singles, along_px: Floats, height: Floats) -> Singles:
    """Return the transform of the spread beneath a surface, as the row sees it."""
    wide = np.hypot(1.0, 2.0 * np.pi * along_px[:, None] * frequency)
    high = height[:, None]
    return np.asarray(erfcx(high * wide) / (wide * erfcx(high)), np.float32)


def _disc(frequency: Singles, radius_px: Floats, height_ratio: Floats) -> Singles:
    table, _ = _slices()
    ratio = np.clip(height_ratio, _HEIGHTS[0], _HEIGHTS[-1])
    place = np.log(ratio / _HEIGHTS[0]) / np.log(_HEIGHTS[1] / _HEIGHTS[0])
    row = np.minimum(place.astype(np.int64), len(_HEIGHTS) - 2)
    share = (place - row).astype(np.float32)[:, None]
    turn = radius_px.astype(np.float32)[:, None] * frequency * np.float32(1.0 / _STEP)
    np.minimum(turn, np.float32(_END / _STEP), out=turn)
    column = turn.astype(np.int32)
    turn -= column
    first = row[:, None] * table.shape[1] + column
    flat = table.ravel()
    stride = table.shape[1]
    low = flat[first] * (1.0 - share) + flat[first + stride] * share
    high = flat[first + 1] * (1.0 - share) + flat[first + stride + 1] * share
    return np.asarray(low + turn * (high - low), np.float32)
