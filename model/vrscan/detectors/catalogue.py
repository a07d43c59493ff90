"""The catalogue of detectors, each with the one parameter for which it was tuned.

``detectors`` are compared on every kind of line. ``rivals`` are other ways to a small error on
speckled spots, which are compared with the instrument's own on those. ``usual`` are more that users
know, as they would write them.

The values were chosen by ``vrscan bench tune``, which prints the whole search: the value of each
grid with the least geometric mean of rms over bound on the training cells of ``study.bench.tune``,
with other random numbers than any test. The instrument's own thresholds are those of
``vrscan efficiency``, see ``vrscan.data.config.Peak``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config
from vrscan.detectors import fits, flanks, simple
from vrscan.detectors.plain import plain_lines
from vrscan.engines.engine import Engine, run

_CHUNK = 512  # lines computed at a time: they fit in a cache

# Takes lines [n, length], background and noise [n] in counts, and counts per electron; returns
# positions [n].
Locate = Callable[[Pixels, Floats, Floats, float], Floats]
Make = Callable[[float, Config], Locate]


@dataclass(frozen=True)
class Detector:
    """One detector.

    Attributes:
        key: Short name of the detector.
        title: Name of the detector on the page.
        make: Function that makes the detector for a value of its parameter.
        parameter: Name of the parameter that was tuned, or the reason why there is none.
        grid: Values that were tried; empty where there is no parameter.
        value: The value that was chosen.
        modules: RTL modules that implement it, if there are any.
        source: Publication that describes it.
    """

    key: str
    title: str
    make: Make
    parameter: str
    source: str
    grid: tuple[float, ...] = ()
    value: float = 0.0
    modules: tuple[str, ...] = ()

    @property
    def engine(self) -> bool:
        """Return whether it is the whole chain, which computes its own background."""
        return self.source.startswith(_VR_SCAN)

    def locate(
        self,
        lines: Pixels,
        background: Floats,
        noise: Floats,
        config: Config,
        value: float | None = None,
    ) -> Floats:
        """Return the position of the peak of each line, px, NaN where there is none [n].

        Args:
            lines: Counts [n, length].
            background: Mean of each line's background, counts [n]; the instrument and (8) as
                printed use their own.
            noise: Standard deviation of each line's background, counts [n].
            config: Configuration, with the pixel width, the conversion factor and the instrument's
                thresholds.
            value: Value of the parameter; the tuned one if None.
        """
        find = self.make(self.value if value is None else value, config)
        kappa = config.peak.kappa
        parts = [np.empty(0)]
        for start in range(0, len(lines), _CHUNK):
            some = slice(start, start + _CHUNK)
            parts.append(find(lines[some], background[some], noise[some], kappa))
        return np.concatenate(parts)


def _chain(engine: Engine, config: Config) -> Locate:
    """Return the instrument's chain as a detector."""

    def find(lines: Pixels, background: Floats, noise: Floats, kappa: float) -> Floats:
        length = lines.shape[1]
        sensor = config.sensor.model_copy(update={"line_length": length})
        peak = config.peak.model_copy(update={"kappa": kappa})
        centre = config.geometry.model_copy(update={"centre_px": 0.5 * (length - 1)})
        own = config.model_copy(update={"sensor": sensor, "peak": peak, "geometry": centre})
        found = run(engine, plain_lines(lines, config), own)
        return np.where(found.measured, found.position_px, np.nan)

    return find


def _own(engine: Engine, window: str) -> Make:
    def make(value: float, config: Config) -> Locate:
        peak = config.peak.model_copy(update={"window": window, "period": "n"})
        return _chain(engine, config.model_copy(update={"peak": peak}))

    return make


def _printed(value: float, config: Config) -> Locate:
    changed = {"period": "n-1", "window": "threshold", "noise": "row", "k_height": 0.0}
    peak = config.peak.model_copy(update={**changed, "k_noise": value, "snr_min": 2.0})
    return _chain(Engine.IDEAL, config.model_copy(update={"peak": peak}))


def _full(config: Config) -> int:
    return (1 << config.sensor.pixel_width) - 1


def _noise_cut(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: simple.centroid(p, b, n, k_noise=value, k_height=0.0)


def _height_cut(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: simple.centroid(p, b, n, k_noise=0.0, k_height=value)


def _parabola(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: simple.parabola(p, b, n, width=int(value))


def _gaussian3(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: simple.gaussian3(p, b, n, width=int(value))


def _blais_rioux(order: int) -> Make:
    return lambda value, config: lambda p, b, n, _: simple.blais_rioux(p, b, n, order=order)


def _matched(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: simple.matched(p, b, n, ratio=value)


def _steger(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: simple.steger(p, b, n, ratio=value)


def _scipy(value: float, config: Config) -> Locate:
    return lambda p, b, n, k: fits.scipy_fit(p, b, n, k, reach=value, full=_full(config))[0]


def _least_squares(value: float, config: Config) -> Locate:
    return lambda p, b, n, _: fits.least_squares(p, b, n, reach=value, full=_full(config))


def _likelihood(value: float, config: Config) -> Locate:
    return lambda p, b, n, k: fits.likelihood(p, b, n, k, reach=value, full=_full(config))


def _transformed(transform: flanks.Transform) -> Make:
    return lambda value, config: (
        lambda p, b, n, _: flanks.harmonic(p, b, n, widths=value, transform=transform)
    )


def _flanks(value: float, config: Config) -> Locate:
    given: Any = {"steps": 4, "contrast": 1.0, "dark": False, "full": _full(config)}
    return lambda p, b, n, k: flanks.weighted(p, b, n, k, **given)


def _one_step(value: float, config: Config) -> Locate:
    first = _own(Engine.FIXED, "two_pass")(0.0, config)

    def find(lines: Pixels, background: Floats, noise: Floats, kappa: float) -> Floats:
        start = first(lines, background, noise, kappa)
        given: Any = {"steps": 1, "contrast": value, "full": _full(config)}
        return flanks.weighted(lines, background, noise, kappa, start=start, **given)

    return find


_CHAIN = ("peak_isolate", "phase_correlate", "peak_position")
_VR_SCAN = "VR-SCAN (8), section IV-G"
_FISHER = "Fisher and Naidu 1996"
_WIDTHS = (1.0, 3.0, 5.0, 7.0, 9.0, 13.0)
_REACHES = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0)

_EVERY = (
    Detector(
        "printed",
        "(8) as printed",
        _printed,
        "threshold, deviations of the row above its mean",
        _VR_SCAN,
        (0.0, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0),
        0.2,
        _CHAIN,
    ),
    Detector(
        "one-pass",
        "T = N, one pass",
        _own(Engine.FIXED, "threshold"),
        "as configured",
        f"{_VR_SCAN}, T = N",
        modules=_CHAIN,
    ),
    Detector(
        "float",
        "T = N, float64",
        _own(Engine.IDEAL, "threshold"),
        "as configured",
        f"{_VR_SCAN}, T = N",
    ),
    Detector(
        "two-pass",
        "T = N, two passes",
        _own(Engine.FIXED, "two_pass"),
        "as configured",
        f"{_VR_SCAN}, T = N, window from a first pass",
        modules=(*_CHAIN, "peak_refine"),
    ),
    Detector(
        "fit",
        "weighted fit",
        _own(Engine.FIXED, "fit"),
        "as configured",
        f"{_VR_SCAN}, T = N, then a Gaussian fitted by Fisher scoring",
        modules=(*_CHAIN, "peak_refine", "peak_fit"),
    ),
    Detector(
        "centroid-noise",
        "centroid, cut by noise",
        _noise_cut,
        "cut, deviations above background",
        _FISHER,
        (1.0, 2.0, 3.0, 5.0, 8.0, 12.0),
        2.0,
    ),
    Detector(
        "centroid-height",
        "centroid, cut by height",
        _height_cut,
        "cut, share of the height",
        _FISHER,
        (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2),
        0.01,
    ),
    Detector(
        "parabola",
        "parabola through 3",
        _parabola,
        "mean before it, px",
        _FISHER,
        _WIDTHS,
        5.0,
    ),
    Detector(
        "gaussian-3",
        "Gaussian through 3",
        _gaussian3,
        "mean before it, px",
        _FISHER,
        _WIDTHS,
        5.0,
    ),
    Detector("blais-rioux-4", "Blais-Rioux 4", _blais_rioux(4), "none", "Blais and Rioux 1986"),
    Detector("blais-rioux-8", "Blais-Rioux 8", _blais_rioux(8), "none", "Blais and Rioux 1986"),
    Detector(
        "matched",
        "matched filter",
        _matched,
        "width of the filter over that of the peak",
        "Turin 1960",
        (0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0),
        1.4,
    ),
    Detector(
        "least-squares",
        "Gaussian, least squares",
        _least_squares,
        "reach, widths of the peak",
        "Levenberg 1944, Marquardt 1963",
        _REACHES,
        5.0,
    ),
    Detector(
        "likelihood",
        "maximum likelihood",
        _likelihood,
        "reach, widths of the peak",
        "Fisher scoring; Winick 1986",
        _REACHES,
        3.5,
    ),
)


_WINDOW = "window of 9 widths"
_DORSCH = "Dorsch, Haeusler, Herrmann 1994"

_RIVALS = (
    Detector("root", "root, then (8)", _transformed(flanks.power(1 / 2)), _WINDOW, _DORSCH,
             value=9.0),
    Detector("third-root", "third root, then (8)", _transformed(flanks.power(1 / 3)), _WINDOW,
             _DORSCH, value=9.0),
    Detector("logarithm", "logarithm, then (8)", _transformed(flanks.logarithm), _WINDOW, _DORSCH,
             value=9.0),
    Detector("flanks", "slope of p over the Gaussian", _flanks, "none", _DORSCH),
    Detector("one-step", "two passes, one step of the fit", _one_step, "contrast in the weights",
             _DORSCH, value=0.25),
)  # fmt: skip

_USUAL = (
    Detector("steger", "Steger", _steger, "width of the filter over that of the peak",
             "Steger 1998", value=1.5),
    Detector("scipy", "scipy's curve_fit, weighted", _scipy, "reach, widths of the peak",
             "scipy.optimize.curve_fit", value=4.0),
)  # fmt: skip


def detectors() -> tuple[Detector, ...]:
    """Return the detectors that are compared on every kind of line."""
    return _EVERY


def rivals() -> tuple[Detector, ...]:
    """Return the detectors that are compared on speckled lines only."""
    return _RIVALS


def usual() -> tuple[Detector, ...]:
    """Return the others in common use, with which ``vrscan bench attack`` compares."""
    return _USUAL


def detector(key: str) -> Detector:
    """Return a detector by its short name.

    Raises:
        KeyError: if there is no such detector.
    """
    return {each.key: each for each in (*_EVERY, *_RIVALS, *_USUAL)}[key]
