"""The attack on the detectors: its light against theory, its rows, its table and its command."""

import math
from pathlib import Path

import numpy as np
import pytest
from run_command import ended
from scipy.special import j1
from typer.testing import CliRunner

from vrscan.cli.app import app
from vrscan.data.config import Config, Sensor
from vrscan.data.errors import InputError
from vrscan.engines.engine import Engine, run
from vrscan.engines.tools import repository_root
from vrscan.show.sheet import block_of
from vrscan.study.bench import attack, attack_cases, attack_optics
from vrscan.study.bench.attack import MODES, SCIPY, SIMPLE, Row, Score
from vrscan.study.bench.attack_cases import CASES, DARK, Beam, Case, source
from vrscan.study.bench.attack_optics import OFFSET, OVERSAMPLE, PITCH_UM, WAVELENGTH_UM
from vrscan.study.cases import case_page

CONFIG = Config()
SEED = 3


def beam(sigma: float, half: int, offset: float = 0.0) -> Beam:
    """Return a line around a spot, and a generator."""
    sample = np.arange((2 * half + 1) * OVERSAMPLE, dtype=np.float64)[None]
    away = (sample + 0.5) / OVERSAMPLE - 0.5 - half - offset
    return Beam(away, sample, sigma, 2048, np.random.default_rng(SEED))


def pixel_contrast(f_number: float) -> float:
    """Return the contrast of a square pixel: the mean of |Airy's coherence|^2 over its pairs."""
    step = (np.arange(400) + 0.5) / 400
    x, y = np.meshgrid(step, step)
    z = math.pi * np.hypot(x, y) * PITCH_UM / (WAVELENGTH_UM * f_number)
    return math.sqrt(4.0 * np.mean((1.0 - x) * (1.0 - y) * np.square(2.0 * j1(z) / z)))


@pytest.mark.parametrize(("f_number", "looks"), [(3.2, 1), (3.2, 4), (16.0, 1), (64.0, 2)])
def test_speckle_has_the_contrast_of_its_grains_over_the_root_of_the_looks(
    f_number: float, looks: int
) -> None:
    rng = np.random.default_rng(SEED)
    light = attack_optics.speckled(np.ones((160, 128 * OVERSAMPLE)), f_number, looks, rng)
    want = pixel_contrast(f_number) / math.sqrt(looks)
    assert f_number < 64.0 or want * math.sqrt(looks) > 0.98  # a pixel within a grain
    # Standard errors: as many independent grains as fit into the lines.
    grains = light.size * min(1.0, PITCH_UM / (WAVELENGTH_UM * f_number))
    assert light.mean() == pytest.approx(1.0, abs=4.0 * want / math.sqrt(grains))
    assert light.std() / light.mean() == pytest.approx(want, rel=4.0 / math.sqrt(grains) + 0.01)


@pytest.mark.parametrize(("share", "length"), [(0.1, 8.0), (0.3, 3.0), (0.3, 5.0)])
def test_a_tail_moves_the_centroid_by_its_share_of_its_length(share: float, length: float) -> None:
    given = beam(2.5, 120, 0.3)
    for both, want in ((False, share * length), (True, 0.0)):
        light = attack_cases.tail(share, length, both=both)(given)
        assert (light * given.away).sum() / light.sum() == pytest.approx(want, abs=1e-3)
        assert light.sum() == pytest.approx(given.gauss.sum(), rel=1e-5)  # no light is lost
        inside = light[np.abs(given.away) < 15.0]
        assert np.abs(np.diff(inside, 2)).max() < 0.01  # smooth where its two forms meet


def test_speckle_keeps_the_mean_light() -> None:
    """And so its centroid, but for that of the patterns, which the aperture only blurs."""
    given = beam(2.5, 40)
    mean = np.repeat(attack_cases.tail(0.3, 5.0)(given), 400, axis=0)
    rng = np.random.default_rng(SEED)
    light = attack_optics.speckled(mean, 3.2, 4, rng).mean(axis=0)
    even = attack_optics.pixels(mean[:1])[0]
    assert light.sum() == pytest.approx(even.sum(), rel=0.005)
    assert np.abs(light - even).max() < 0.03
    place = np.arange(81) - 40
    assert light @ place / light.sum() == pytest.approx(even @ place / even.sum(), abs=0.05)


def test_reflectances_have_the_spread_and_the_length_that_they_say() -> None:
    flat = Beam(np.zeros((1, 2048 * OVERSAMPLE)), np.arange(2048.0 * OVERSAMPLE)[None], 1.0, 2048,
                np.random.default_rng(SEED))  # fmt: skip
    for length, rms in ((1.0, 0.2), (4.0, 0.5)):
        log = np.log(attack_cases.texture(length, rms)(flat)[0])
        assert np.exp(log).std() / np.exp(log).mean() == pytest.approx(rms, rel=0.15)
        log -= log.mean()
        lag = round(length * OVERSAMPLE)
        alike = float(log[lag:] @ log[:-lag] / (log @ log))
        assert alike == pytest.approx(math.exp(-1.0), abs=0.1)
    stripes = attack_cases.printed(4.0)(flat)[0]
    assert set(stripes) == {attack_cases.BLACK, 1.0}
    count = np.count_nonzero(np.diff(stripes)) + 1
    assert 2048 / count == pytest.approx(4.0, rel=0.2)


@pytest.mark.parametrize("sigma", [2.5, 8.0])
def test_a_gaussian_without_noise_is_found_by_every_detector(sigma: float) -> None:
    true = 1000.0 + np.linspace(0.0, 1.0, 21)
    half = math.ceil(8.0 * sigma)
    counts = np.full((len(true), 2048), OFFSET)
    for k, place in enumerate(true):
        first = round(place) - half
        light = attack_optics.pixels(beam(sigma, half, place - round(place)).gauss)[0]
        counts[k, first : first + len(light)] += 3000.0 * light
    lines = attack_optics.converted(counts, CONFIG)
    found = {name: own for name, (own, _) in attack.simple(lines, CONFIG).items()}
    for mode, points in attack._Work(Engine.IDEAL, CONFIG, SEED, True).points(lines).items():
        assert points.measured.all()
        found[mode] = points.position_px
    # A cut through the flanks takes a pixel more on one side than on the other.
    # A cut through the flanks may take a pixel of this height on one side alone, so far away.
    pixel = 0.2 * math.sqrt(2.0 * math.log(5.0)) / math.sqrt(2.0 * math.pi)
    for name in (*MODES, *SIMPLE):
        bound = 1.1 * pixel if name == "centroid 20%" else 0.01
        assert np.abs(found[name] - true).max() < bound, name


def test_a_row_is_made_of_the_same_lines_whatever_else_is_tried() -> None:
    case = CASES[2]
    one, two, other = (case.lines(40, CONFIG, seed) for seed in (1, 1, 2))
    assert np.array_equal(one[0], two[0]) and np.array_equal(one[1], two[1])
    assert not np.array_equal(one[0], other[0])
    step = np.diff(one[1])
    assert step.min() > 0.3 - 1e-9 and step.max() < 1.0 + 1e-9
    assert one[0].shape == (40, 2048) and one[0].max() < 4095


def test_the_dark_is_as_noisy_and_as_lit_as_it_says() -> None:
    plain, hot, clipped, pink = (
        case.lines(100, CONFIG, source(case.title, SEED)).astype(float) for case in DARK
    )
    assert plain.mean() == pytest.approx(60.0, abs=0.05)
    assert plain.std() == pytest.approx(attack_cases.noise(CONFIG), rel=0.01)
    lit = [np.flatnonzero(row > 160.0) for row in hot]
    assert all(len(pair) == 2 and 2 <= pair[1] - pair[0] <= 5 for pair in lit)
    assert 0.6 < (clipped == 0.0).mean() < 0.8
    assert pink.std() == pytest.approx(math.hypot(6.0, attack_cases.noise(CONFIG)), rel=0.05)
    power = np.square(np.abs(np.fft.rfft(pink - pink.mean()))).mean(axis=0)
    assert power[8:16].mean() / power[32:64].mean() == pytest.approx(4.0, rel=0.4)


def test_the_fit_beats_every_simple_detector_in_plain_speckle() -> None:
    row = attack._Work(Engine.IDEAL, CONFIG, SEED, True).spots(Case("speckle"))
    assert row.best is not None and row.fit.kept > 0.95
    assert row.fit.rms < 0.9 * row.best_rms < 0.9 * row.scores["two_pass"].rms
    assert row.fit.silent == 0.0 and 0.6 < row.fit.ratio < 1.4
    assert row.scores[SCIPY].ratio > 3.0  # it knows of no speckle


def test_scores_tell_silent_lines_from_those_with_a_warning() -> None:
    pixels, true = Case("speckle").lines(40, CONFIG, SEED)
    points = run(Engine.IDEAL, attack.plain_lines(pixels, CONFIG), CONFIG)
    moved = true.copy()
    moved[:10] += 20.0
    every = np.ones(40, np.bool_)
    score = attack._score(points, moved, every)
    assert score.silent == 0.25 and score.kept == 1.0
    assert score.bias == pytest.approx(-5.0, abs=0.1) and score.rms == pytest.approx(10.0, abs=0.1)
    points.flags["MIXED"][:4] = True
    score = attack._score(points, moved, every)
    assert score.silent == 0.15 and score.kept == 0.9
    assert attack._simple_score(np.full(40, np.nan), None, true, every).kept == 0.0


def rows(**changes: float) -> list[Row]:
    """Return a made-up row for each case; the fit is the worse the later it comes."""
    other = Score(0.1, 0.0, 1.0, 1.0, 0.0)
    made = []
    for k, case in enumerate(CASES):
        own = {"rms": 0.1 + 0.001 * k, "bias": 0.0, "kept": 1.0, "ratio": 1.0, "silent": 0.0}
        fit = Score(**own | (changes if k == 1 else {}))
        made.append(Row(case.title, dict.fromkeys((*MODES, *SIMPLE), other) | {"fit": fit}))
    return made


DARK_ROWS = [
    attack.DarkRow(case.title, dict.fromkeys(MODES, 9.0), dict.fromkeys(MODES, 7.0))
    for case in DARK
]


def test_the_table_has_every_case_and_the_page_the_worst() -> None:
    titles = [case.title for case in (*CASES, *DARK)]
    assert len(set(titles)) == len(titles) == attack.COUNT
    names = " ".join(titles)
    for word in ("tail 30%, 8 px", "scatter", "halo", "second spot", "cut at its axis", "edges",
                 "texture 50%, 12 px", "printed", "dim", "hot", "clipped", "pink"):  # fmt: skip
        assert word in names, word
    made = rows()
    sheet = attack.sheet(made)
    heading, *lines = sheet.csv().decode().splitlines()
    assert len(lines) == len(CASES) and len(set(heading.split(","))) == len(heading.split(","))
    assert len(attack.dark_sheet(DARK_ROWS).csv().splitlines()) == len(DARK) + 1
    assert attack.shown(made) == made[::-1][: attack.WORST]
    for changes in ({"silent": 0.02}, {"ratio": 1.7}):
        made = rows(**changes)
        assert attack.shown(made) == [*made[::-1][: attack.WORST], made[1]]
    assert "fit 7," in attack.block(made, DARK_ROWS, Engine.IDEAL, SEED)


def test_lines_that_are_too_short_are_refused() -> None:
    short = CONFIG.model_copy(update={"sensor": Sensor(line_length=512)})
    with pytest.raises(InputError, match="at least 1024 px"):
        CASES[0].lines(4, short, SEED)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--seed", "-1"), "--seed: must be 0 to 4294967295 (-1)"),
        (("--seed", "x"), "--seed': Input should be a valid integer"),
        (("--engine", "float"), "'float' is not one of 'rtl', 'fixed', 'ideal'"),
        (("--quick", "--write"), "--write: needs all lines (--quick is given)"),
        (("--jobs", "-1"), "--jobs: must not be negative (-1)"),
    ],
)
def test_a_bad_option_is_one_line(
    words: tuple[str, ...],
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ended(monkeypatch, "bench", "attack", *words) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1 and told in text


def test_the_command_writes_its_tables_and_the_page_keeps_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vrscan.engines import tools

    monkeypatch.setattr(attack, "CASES", (Case("speckle"), Case("cut", attack_cases.cut(0.0))))
    monkeypatch.setattr(attack, "DARK", DARK[:1])
    monkeypatch.setattr(attack, "COUNT", 3)
    monkeypatch.setattr(attack, "LINES", 40)
    monkeypatch.setattr(attack, "DARK_LINES", 50)
    monkeypatch.setattr(tools, "repository_root", lambda: tmp_path)
    page = tmp_path / case_page.PAGE
    page.parent.mkdir()
    monkeypatch.setattr(case_page, "rooms", dict)
    page.write_text(case_page.page({}))
    words = ["bench", "attack", "--write", "--jobs", "1", "--seed", "5", "--out"]
    shown = CliRunner().invoke(app, [*words, str(tmp_path / "out")])
    assert shown.exit_code == 0, shown.output
    assert "seed 5" in shown.output and "speckle" in shown.output
    assert len((tmp_path / "out" / "attack.csv").read_text().splitlines()) == 3
    assert len((tmp_path / "out" / "dark.csv").read_text().splitlines()) == 2
    text = page.read_text()
    assert "| cut |" in block_of(text, case_page.ATTACK) and "seed 5" in text
    assert case_page.page({}, text) == text  # as vrscan cases writes it


def test_the_shipped_page_has_a_block_that_its_generator_keeps() -> None:
    text = (repository_root() / case_page.PAGE).read_text()
    block = block_of(text, case_page.ATTACK)
    assert "| case | kept |" in block and block in text
    assert block_of("no page", case_page.ATTACK).count("\n") == 2
