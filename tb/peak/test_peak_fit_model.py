"""peak_fit: the model against the float fit, within what its widths allow; its rules by cases."""

import math
from dataclasses import dataclass, fields

import numpy as np
import pytest
from harness import generator
from sensor_gain import KAPPA

from vrscan.data import pkg
from vrscan.fixed import peak_fit as fixed
from vrscan.ideal import peak_fit as ideal
from vrscan.scene.sensor import cramer_rao_variance

LENGTH = 2048
SNR_MIN = 8.0
DEPTH = pkg.SPECKLE_DEPTH
SPECKLE_ONE = 2.0**fixed.SPECKLE_FRACTION
PIXEL_WIDTHS = [8, 12, 16]


@dataclass(frozen=True)
class Cases:
    """Lines of one spot each, and what the second window tells of them; arrays [n]."""

    lines: np.ndarray
    pixel_width: int
    measured: np.ndarray
    left: np.ndarray
    width: np.ndarray
    slope: np.ndarray  # these four as the integers of the twin
    position: np.ndarray
    sigma: np.ndarray
    background: np.ndarray
    noise: np.ndarray

    def __getitem__(self, part: slice | np.ndarray) -> "Cases":
        """Return some of the lines."""
        arrays = {k: v[part] for k, v in vars(self).items() if k != "pixel_width"}
        return Cases(**arrays, pixel_width=self.pixel_width)

    @property
    def maximum(self) -> np.ndarray:
        """The largest pixel of each line."""
        return self.lines.max(axis=1).astype(np.int64)

    @property
    def kappa(self) -> int:
        """Counts an electron as its register has it."""
        return round(KAPPA * 2**16)

    def physical(self) -> dict[str, np.ndarray | float]:
        """Return slope, position, sigma, background, noise and kappa in counts and px."""
        count = 2.0 ** (pkg.COUNT_WIDTH - self.pixel_width)
        return {
            "slope": self.slope / 2.0 ** (pkg.ALIGNED_WIDTH - self.pixel_width + pkg.RAMP_FRACTION),
            "position": self.position / 2.0**pkg.POSITION_FRACTION,
            "sigma": self.sigma / 2.0**9,
            "background": self.background / count,
            "noise": self.noise / count,
            "kappa": self.kappa / 2.0 ** (28 - self.pixel_width),
        }

    def _common(self) -> dict[str, object]:
        names = ("lines", "measured", "left", "width", "maximum")
        given: dict[str, object] = {name: getattr(self, name) for name in names}
        return given | {"saturation_level": (1 << self.pixel_width) - 1}

    def fixed(self, history: fixed.History | None = None) -> fixed.Fitted:
        """Return the twin's answer."""
        names = ("slope", "position", "sigma", "background", "noise", "kappa")
        return fixed.peak_fit(
            **self._common(),
            spread=np.zeros(len(self.lines), np.int64),
            pixel_width=self.pixel_width,
            **{name: getattr(self, name) for name in names},
            history=history or fixed.History.empty(),
        )

    def ideal(self) -> ideal.Fitted:
        """Return the float fit's answer."""
        return ideal.peak_fit(
            **self._common(),
            **self.physical(),
            spread=np.zeros(len(self.lines)),
            history=ideal.History.empty(),
        )


def spots(
    pixel_width: int,
    centre: np.ndarray,
    sigma: np.ndarray,
    height: np.ndarray,
    contrast: np.ndarray,
    *,
    slope: np.ndarray | float = 0.0,
    noise: np.ndarray | float = 3.0,
    background: np.ndarray | float = 60.0,
    salt: int,
) -> Cases:
    """Return lines of Gaussian spots, gamma distributed gains of speckle on each pixel.

    Heights, slopes, noise and background are in counts of 12 bits. The second window is around a
    position that is a little off, and the first window's sigma is up to a quarter off.
    """
    draw = generator(salt)
    count = len(centre)
    top, unit = (1 << pixel_width) - 1, 2.0 ** (pixel_width - 12)
    slope, noise, background = (
        np.broadcast_to(np.asarray(each, float), count) for each in (slope, noise, background)
    )
    away = np.arange(LENGTH) - centre[:, None]
    light = height[:, None] * np.exp(-0.5 * np.square(away / sigma[:, None]))
    cells = 1.0 / np.square(np.maximum(contrast, 1e-3))[:, None]
    gains = draw.gamma(np.broadcast_to(cells, light.shape)) / cells
    light *= np.where(contrast[:, None] > 0, gains, 1.0)
    light += background[:, None] + slope[:, None] * np.clip(away, -150, 150)
    light = np.maximum(light, 0.0)
    spread = np.sqrt(np.square(noise)[:, None] + KAPPA * light)
    counts = unit * (light + spread * draw.standard_normal(light.shape))
    lines = np.clip(np.floor(counts + 0.5), 0, top).astype(np.uint16)

    position = np.clip(centre + 0.1 * np.sqrt(sigma) * draw.standard_normal(count), 0, LENGTH - 1)
    width = np.clip(np.round(6.75 * sigma), 3, 255).astype(np.int64)
    left = np.round(position - (width - 1) / 2).astype(np.int64)
    right = np.minimum(left + width - 1, LENGTH - 1)
    left = np.maximum(left, 0)
    dark = unit * np.sqrt(np.square(noise) + KAPPA * background)
    scale = 2.0 ** (pkg.COUNT_WIDTH - pixel_width)
    found = Cases(
        lines=lines,
        pixel_width=pixel_width,
        measured=np.ones(count, np.bool_),
        left=left,
        width=right - left + 1,
        slope=np.round(slope * 2.0 ** (pkg.ALIGNED_WIDTH - 12 + pkg.RAMP_FRACTION)).astype(int),
        position=np.round(position * 2.0**pkg.POSITION_FRACTION).astype(np.int64),
        sigma=np.round(sigma * draw.uniform(0.8, 1.25, count) * 2.0**9).astype(np.int64),
        background=np.floor(unit * background * scale).astype(np.int64),
        noise=np.floor(dark * scale).astype(np.int64),
    )
    return found[found.maximum - unit * background > SNR_MIN * dark]


def all_sorts(pixel_width: int, count: int, salt: int) -> Cases:
    """Return spots of every width, height and place, with slopes, speckle and saturated pixels."""
    draw = generator(salt)
    sigma = 10 ** draw.uniform(math.log10(0.8), math.log10(20), count)
    height = 10 ** draw.uniform(math.log10(30), math.log10(3800), count)
    height = np.where(draw.random(count) < 0.1, 4095 * draw.uniform(0.95, 3, count), height)
    centre = draw.uniform(0, LENGTH - 1, count)
    end = draw.choice([-1, 0, LENGTH - 1], count, p=[0.05, 0.9, 0.05])
    centre = np.where(end == 0, centre, np.abs(end - draw.uniform(0, 3, count) * sigma))
    contrast = np.repeat(draw.choice([0.0, 0.1, 0.2, 0.3], count // 40 + 1), 40)[:count]
    noise = draw.choice([0.5, 1.5, 3.0], count)
    slope = np.where(draw.random(count) < 0.5, draw.uniform(-1, 1, count), 0.0)
    background = draw.uniform(20, 150, count)
    made = spots(
        pixel_width, centre, sigma, height, contrast,
        slope=slope, noise=noise, background=background, salt=salt + 1,
    )  # fmt: skip
    made.measured[:] = draw.random(len(made.lines)) < 0.97
    return made


@dataclass(frozen=True)
class Room:
    """What the widths allow the twin to differ by, [n] each.

    Attributes:
        position: px, all errors at their largest and of the worst sign.
        rms: px, as if they were independent and evenly distributed.
        doubt: px, in addition where a pixel at an end of the window is in for one and out for the
            other, in the last pass and in one before.
        sigma: Share of sigma.
        sigma_doubt: Share of sigma, in addition.
    """

    position: np.ndarray
    rms: np.ndarray
    doubt: np.ndarray
    sigma: np.ndarray
    sigma_doubt: np.ndarray


def room(cases: Cases, fit: ideal.Fitted, speckle: np.ndarray, grains: np.ndarray) -> Room:
    """Return the difference that the twin's widths allow at the float fit's solution.

    The twin's squared contrast and grains are given: these have their own tests.

    The last pass adds w S(y u dq) / (S(y u**2) A ln 4) to the position, dq a quotient's error: half
    a step of the table of mantissas as a share of the quotient, half a step of its 14 fraction
    bits, and a step of the height's 17 fraction bits times h. A weight y is off by half an entry of
    the reciprocals, by the steps of the variance's 17 fraction bits, by h's own error and by that
    of the dark noise's 17 fraction bits, which adds y u q times that share; products are rounded to
    14 fraction bits, and y to 16. The place has 12 fraction bits at the end, and u has 15.
    """
    given = cases.physical()
    count, full = len(cases.lines), (1 << cases.pixel_width) - 1
    index = (cases.left + cases.width // 2 - 100)[:, None] + np.arange(200)
    pixel = cases.lines[np.arange(count)[:, None], np.clip(index, 0, LENGTH - 1)].astype(float)
    usable = (index >= 0) & (index < LENGTH) & (pixel < full)
    height = cases.maximum - given["background"]
    unit = 2.0 ** np.ceil(np.log2(height))
    middle = cases.left + (cases.width - 1) / 2
    level = given["background"][:, None] + given["slope"][:, None] * (index - middle[:, None])
    share = (pixel - level) / unit[:, None]
    dark = np.maximum(given["noise"], 5 / 16) / unit
    u = (index - fit.position[:, None]) / fit.scale[:, None]
    near = usable & (np.abs(np.abs(u) - math.sqrt(8)) < 1 / fit.scale[:, None])
    inside = usable & (u * u < 8)
    h = np.exp2(np.minimum(u * u, 8))
    top = np.full(count, 0.75)
    for _ in range(4):
        shot = given["kappa"] / unit * top
        total = (dark**2 + shot + fit.speckle * top**2)[:, None]
        read = (dark**2)[:, None] * h * h
        own = read + shot[:, None] * h + (fit.speckle * top**2)[:, None]
        weight = total / own
        y = np.where(inside, weight, 0)
        top = (y * h * share).sum(axis=1) / np.maximum(y.sum(axis=1), 1e-30)
    q = np.clip(h * share - top[:, None], -8, 8)
    turn = np.abs((y * u * q * (u * u < 2)).sum(axis=1))
    beside = usable & (np.abs(np.abs(u) - math.sqrt(2)) < 1 / fit.scale[:, None])
    q = np.abs(q)
    table = math.log(2) / 2**11
    y_error = 2.0**-9 + read / own * (2 * 2.0**-17 / dark[:, None] + 2 * table)
    y_error += shot[:, None] * h / own * table + 2.0**-17 * weight * (h * h + h + 1)
    u = np.abs(u)
    per_pixel = (
        y * u * table * np.abs(h * share),
        y * u * 2.0**-15,
        y * u * h * 2.0**-17,
        y * u * q * y_error,
        inside * u * (q * 2.0**-16 + 2.0**-15),
    )
    moment = (y * u * u).sum(axis=1)
    factor = fit.scale / (moment * top * math.log(4))
    end = 2.0**-13 + fit.scale * 2.0**-15
    squares = sum((part**2).sum(axis=1) for part in per_pixel)
    edge = np.where(near, weight * u * q, 0).max(axis=1)
    position = factor * sum(part.sum(axis=1) for part in per_pixel) + end
    # Half of the weights' errors, and the amplitude's and width's, which are like the position's.
    of_sigma = 0.5 * (y * u * u * y_error).sum(axis=1) / moment + 2 * position / fit.scale
    # The variance has 11/8 times the speckle's part, and 11/8 grains of that or, if coarse, of all.
    part, least = fit.speckle * top**2, np.minimum(grains, fit.grains)
    coarse, too = (each >= ideal.COARSE_GRAINS for each in (grains, fit.grains))
    grained = np.where(coarse, total[:, 0], part)
    whole = total[:, 0] + 3 / 8 * part + 11 / 8 * least * grained
    of_sigma += 0.5 * 11 / 8 * np.abs(grains - fit.grains) * grained / whole
    of_sigma += np.abs(speckle - fit.speckle) * 11 / 8 * (1 + least) * top**2 / total[:, 0]
    of_sigma += 2.0**-13 / np.maximum(fit.sigma, 2.0**-pkg.SIGMA_FRACTION)
    edge_moment = np.where(near, weight * u * u, 0).max(axis=1) / moment
    # A line's own lean is the square of what turns the middle, with a pixel in doubt at each end.
    turned = np.where(beside, weight * u * q, 0).max(axis=1) / np.maximum(turn, 1e-30)
    own_doubt = np.where(fit.own_lean, turned * (2 + turned), 0)
    return Room(
        position=position,
        rms=factor * np.sqrt(squares / 3) + end,
        doubt=4 * factor * edge,
        sigma=of_sigma,
        # Where grains are coarse for one of both, the other's sigma is another.
        sigma_doubt=own_doubt
        + np.where(coarse == too, edge_moment + 8 * factor * edge / fit.scale, np.inf),
    )


@pytest.mark.parametrize("pixel_width", PIXEL_WIDTHS)
def test_peak_fit_model_is_the_float_fit(pixel_width: int) -> None:
    cases = all_sorts(pixel_width, 1200, 10 * pixel_width)
    got, want = cases.fixed(), cases.ideal()
    both = got.fitted & want.fitted
    other = float((got.fitted != want.fitted).mean())
    assert both.mean() > 0.7 and (~both).mean() > 0.05 and other < 0.005
    assert np.array_equal(got.position[~got.fitted], cases.position[~got.fitted])
    allowed = room(cases, want, got.speckle / SPECKLE_ONE, got.grains / 2.0**8)
    off = np.abs(got.position / 2.0**pkg.POSITION_FRACTION - want.position)[both]
    wrong = np.abs(got.sigma[both] / 2.0**pkg.SIGMA_FRACTION / want.sigma[both] - 1)
    most, rms, doubt, sigma, sigma_doubt = (value[both] for value in vars(allowed).values())
    # A line on the limit of a jump has its own speckle, or its own lean, in one of both.
    found = got.speckle[both] / SPECKLE_ONE
    jump = np.abs(found - want.speckle[both]) > 0.4 * np.maximum(found, want.speckle[both]) + 1e-3
    jump |= ((got.own_lean != want.own_lean) | (got.end != want.end))[both]
    assert jump.mean() < 0.003
    shares = (off / (most + doubt), wrong / (sigma + sigma_doubt))
    worst = [float(each[~jump].max()) for each in shares]
    print(
        f"\n{pixel_width} bits, measured / predicted / floor: place, 1e-3 px, of 90 % "
        f"{1e3 * np.quantile(off, 0.9):.2f} / {1e3 * np.quantile(1.645 * rms, 0.9):.2f} / "
        f"{1e3 / 2**13:.2f}; {100 * (off > most).mean():.2f} % of the lines over the worst case, "
        f"none over {worst[0]:.2f} of it with a pixel in doubt; sigma, of "
        f"90 % {100 * np.quantile(wrong, 0.9):.2f} / {100 * np.quantile(sigma, 0.9):.2f} %, over "
        f"it {100 * (wrong > sigma).mean():.2f} %, none over "
        f"{worst[1]:.2f} with a pixel in doubt; {100 * other:.2f} % "
        "fitted by one of both only"
    )
    assert np.quantile(off / rms, 0.9) < 1.645
    assert (off > most).mean() < 0.02 and worst[0] <= 1
    assert (wrong > sigma).mean() < 0.02 and worst[1] <= 1


def cell(
    sigma: float, height: float, contrast: float, *, count: int = 400, noise: float = 3.0, salt: int
) -> tuple[Cases, np.ndarray]:
    """Return lines of one kind of spot in 12 bits, and their true positions."""
    centre = generator(salt).uniform(300, LENGTH - 300, count)
    sigmas, heights, contrasts = (np.full(count, each) for each in (sigma, height, contrast))
    made = spots(12, centre, sigmas, heights, contrasts, noise=noise, salt=salt + 1)
    assert len(made.lines) == count, "the noise hides some of the spots"
    return made, centre


@pytest.mark.parametrize("contrast", [0.0, 0.1, 0.29])
@pytest.mark.parametrize(
    ("sigma", "height"), [(1.5, 1500), (3, 400), (9, 2000), (20, 150), (28, 45)]
)
def test_peak_fit_model_measures_the_speckle(sigma: float, height: float, contrast: float) -> None:
    """The gains' own contrast, and the float fit's within the steps of the quotients.

    By Cauchy and Schwarz the sum of squared differences changes by no more than twice its root
    times that of the errors, which are 8 quotients' errors at most. Beside this, a difference of a
    line may be in the sum of one and not in that of the other, of 32 lines with 4 s - 3 each. The
    shot noise is taken for 3/4 of the heights' unit, which lowers the contrast of dim spots.
    """
    cases, _ = cell(sigma, height, contrast, salt=round(100 * sigma + 1000 * contrast))
    got, want = cases.fixed(), cases.ideal()
    found = got.speckle / SPECKLE_ONE
    top = height / 2.0 ** math.ceil(math.log2(cases.maximum.mean() - 60))
    dark = (9 + KAPPA * 60) / height**2 * 9  # h**2 is 9 in the mean of the top's pixels
    shot = KAPPA / height * 2.5
    error = math.log(2) / 2**11 * 1.5 + 2.0**-13 / top
    predicted = 2 * math.sqrt(contrast**2 + dark + shot) * error * 8 / math.sqrt(20)
    off = np.abs(found - want.speckle)
    spread = found[DEPTH::DEPTH].std() / math.sqrt(len(found) / DEPTH)
    print(
        f"\ns {sigma:g} px, {height} counts, C**2 {contrast**2:.4f}: mean "
        f"{found[DEPTH:].mean():.4f} +- {spread:.4f}; from the float fit's, 1e-4: 90 % measured "
        f"{1e4 * np.quantile(off, 0.9):.2f} / predicted {1e4 * predicted:.2f} / floor "
        f"{5e3 / SPECKLE_ONE:.3f}; at most {1e4 * off.max():.2f}"
    )
    assert np.quantile(off, 0.9) <= predicted
    assert off[DEPTH:].max() <= predicted + 2 / (DEPTH * (4 * sigma - 3))
    assert abs(found[DEPTH:].mean() - contrast**2) < 4 * spread + 0.22 * contrast**2 + 0.0005


@pytest.mark.parametrize("contrast", [0.0, 0.1, 0.29])
@pytest.mark.parametrize(("sigma", "height"), [(1.5, 1500), (3, 400), (3, 2000), (9, 2000)])
def test_peak_fit_model_reaches_the_least_variance(
    sigma: float, height: float, contrast: float
) -> None:
    """With speckle, too; sigma has room for the correlation of neighbours, which is none here."""
    cases, true = cell(sigma, height, contrast, count=600, salt=round(100 * sigma + 99 * contrast))
    got = cases.fixed()
    place = np.arange(-100, 101)
    electrons = height / KAPPA * np.exp(-0.5 * np.square(place / sigma))[None]
    dark = (9 + 1 / 12 + KAPPA * 60) / KAPPA**2
    bound = cramer_rao_variance(electrons, electrons * place / sigma**2, dark, contrast)[0]
    off = got.position / 2.0**pkg.POSITION_FRACTION - true
    efficiency = bound / np.square(off).mean()
    speckle = (contrast * height) ** 2
    share = speckle / (speckle + KAPPA**2 * dark + KAPPA * height)
    predicted = 1 / math.sqrt(1 + 3 / 8 * share)
    honest = np.sqrt(np.square(off / got.sigma * 2.0**pkg.SIGMA_FRACTION)[DEPTH:].mean())
    print(
        f"\ns {sigma:g} px, {height} counts, C {contrast}: rms {np.sqrt(np.square(off).mean()):.4f}"
        f" / {math.sqrt(bound):.4f} px, efficiency {efficiency:.3f}; error over sigma "
        f"{honest:.3f} / {predicted:.3f}"
    )
    assert 0.75 < efficiency < 1.25  # the square of 600 lines is known to 6 %
    assert honest == pytest.approx(predicted, rel=0.2)  # as the speckle of 32 lines is


@pytest.mark.parametrize(("before", "behind"), [(0.0, 0.29), (0.0, 0.1), (0.1, 0.29), (0.29, 0.0)])
@pytest.mark.parametrize(("sigma", "height"), [(2, 1500), (3, 2000), (9, 800)])
def test_peak_fit_model_sigma_follows_a_change_of_the_surface(
    sigma: float, height: float, before: float, behind: float
) -> None:
    """The first lines of another contrast, too, of which the sum of 32 lines knows little."""
    changes, lines = 30, DEPTH + 2
    draw = generator(round(100 * sigma + 1000 * behind))
    contrast = np.tile(np.repeat([before, behind], lines), changes)
    centre = draw.uniform(300, LENGTH - 300, len(contrast))
    same = np.ones(len(contrast))
    cases = spots(12, centre, sigma * same, height * same, contrast, salt=round(100 * sigma))
    got = cases.fixed()
    error = got.position / 2.0**pkg.POSITION_FRACTION - centre
    ratio = error / got.sigma * 2.0**pkg.SIGMA_FRACTION
    ratio = ratio.reshape(changes, 2 * lines)[:, lines:]
    first, later = (float(np.sqrt(np.mean(each**2))) for each in (ratio[:, :4], ratio[:, 4:16]))
    known = 1 + 1 / math.sqrt(2 * 4 * changes)  # an rms of so many lines, to one deviation
    print(f"\nerror over sigma: first four lines {first:.2f}, twelve behind {later:.2f}")
    assert max(first, later) <= 1.25 * known
    if behind > before:
        assert min(first, later) >= 0.8 / known


def assert_same(got: fixed.Fitted, want: fixed.Fitted) -> None:
    """Assert that two answers have the same bits."""
    for name in ("position", "sigma", "fitted", "mixed", "speckle", "scale", "grains"):
        assert np.array_equal(getattr(got, name), getattr(want, name)), name
    for one, other in zip(got.history, want.history, strict=True):
        assert one.dtype == np.int64 and np.array_equal(one, other)


@pytest.mark.parametrize("chunks", [[1], [7, 1, 32, 31], [40, 300]])
def test_peak_fit_model_in_chunks_has_the_same_bits(chunks: list[int]) -> None:
    """Chunks shorter and longer than the history, one line at a time, and none."""
    cases = all_sorts(12, 200, 77)
    count = len(cases.lines)
    ends = np.minimum(np.cumsum(np.resize(chunks, count)), count)
    parts, history = [], fixed.History.empty()
    for first, last in zip([0, *ends, count], [*ends, count, count], strict=True):
        parts.append(cases[first:last].fixed(history))
        history = parts[-1].history
    names = [field.name for field in fields(fixed.Fitted) if field.name != "history"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    assert_same(fixed.Fitted(**joined, history=history), cases.fixed())


def test_peak_fit_model_takes_nothing_from_a_line_that_is_not_measured() -> None:
    """What stands on such a line is the same to all others, and enough of them forget the rest."""
    cases, _ = cell(3.0, 1500.0, 0.29, count=120, salt=5)
    cases.measured[:] = generator(6).random(120) < 0.5
    other = all_sorts(12, 300, 8)[:120]
    mixed = {
        name: np.where(
            cases.measured.reshape(-1, *[1] * (value.ndim - 1)), value, getattr(other, name)
        )
        for name, value in vars(cases).items()
        if name not in ("measured", "pixel_width")
    }
    got = Cases(**mixed, measured=cases.measured, pixel_width=12).fixed()
    want = cases.fixed()
    assert not got.fitted[~cases.measured].any()
    assert np.array_equal(got.speckle, want.speckle)
    assert np.array_equal(got.position[cases.measured], want.position[cases.measured])
    assert (want.speckle[DEPTH:] > 0.02 * SPECKLE_ONE).all()
    cases.measured[60:110] = False
    quiet = cases.fixed().speckle[60:110]
    known = cases.ideal().speckle[60:110] * SPECKLE_ONE
    first = DEPTH - 1 - int(np.argmax(cases.measured[59::-1]))  # when the last one has left
    assert np.abs(quiet[first:] - known[first:]).max() <= 0.5 + 1e-6
    assert len(set(quiet[first:])) == 1 and quiet[first - 1] > quiet[first]


def test_peak_fit_model_stays_with_the_second_window_where_it_does_not_fit() -> None:
    """A plateau, a box, a spot elsewhere and a line's end that leaves less than 4 pixels."""
    place = np.arange(LENGTH)

    def bell(centre: float, sigma: float, height: float) -> np.ndarray:
        return height * np.exp(-0.5 * np.square((place - centre) / sigma))

    spot = bell(1000.3, 4.0, 2000.0)
    light = np.array(
        [
            spot,
            bell(1000.3, 4.0, 9000.0),
            np.where(np.abs(place - 1000) < 14, 2000.0, 0.0),
            spot + bell(1016, 4.0, 1500.0),
            bell(1005.0, 4.0, 2000.0),
            bell(-3.0, 1.5, 8000.0),
        ]
    )
    draw = generator(9)
    spread = np.sqrt(9 + KAPPA * (light + 60))
    lines = np.clip(np.round(light + 60 + spread * draw.standard_normal(light.shape)), 0, 4095)
    count = len(lines)
    position = np.array([1000.3] * (count - 1) + [0.0])
    sigma = np.array([4.0] * (count - 1) + [1.0])
    scale = 2.0 ** (pkg.COUNT_WIDTH - 12)
    cases = Cases(
        lines=lines.astype(np.uint16),
        pixel_width=12,
        measured=np.ones(count, np.bool_),
        left=np.array([987] * (count - 1) + [0]),
        width=np.array([27] * (count - 1) + [7]),
        slope=np.zeros(count, np.int64),
        position=np.round(position * 2.0**pkg.POSITION_FRACTION).astype(np.int64),
        sigma=np.round(sigma * 512).astype(np.int64),
        background=np.full(count, int(60 * scale)),
        noise=np.full(count, int(4.6 * scale)),
    )
    for fit in (cases.fixed(), cases.ideal()):
        assert fit.fitted.tolist() == [True] + [False] * (count - 1), type(fit)
    got = cases.fixed()
    assert np.array_equal(got.position[1:], cases.position[1:])
    assert abs(got.position[0] / 2.0**pkg.POSITION_FRACTION - 1000.3) < 0.05
