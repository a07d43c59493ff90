"""Configuration files: what is taken and how what is not is refused."""

from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data import pkg
from vrscan.data.config import BLANKING_CLKS, HARMONICS, Config, load, presets
from vrscan.data.errors import InputError, beside
from vrscan.fixed.vrscan_chain import MAX_WINDOW, min_period
from vrscan.registers.chain_registers import Registers


def write(folder: Path, text: str) -> Path:
    path = folder / "config.toml"
    path.write_text(text)
    return path


def mirror_with(count: int) -> str:
    """Return a file with so many harmonics, each a tenth of the one before and a tenth later."""
    pairs = ", ".join(f"[1e-{k}, 0.{k}]" for k in range(count))
    return f"[mirror]\nharmonics = [{pairs}]\n"


def test_defaults_are_the_instrument() -> None:
    config = load(None)
    assert config == Config()
    assert config.geometry.base_mm == 60.0
    assert (config.peak.window, config.peak.period) == ("fit", "n")
    assert config.source == "defaults"


def test_a_file_overrides_only_what_it_names(tmp_path: Path) -> None:
    path = write(tmp_path, '[peak]\nk_noise = 3\nwindow = "threshold"\n[geometry]\nk1 = -1e-4\n')
    config = load(path)
    assert config.peak.k_noise == 3.0
    assert config.peak.window == "threshold"
    assert config.peak.k_height == Config().peak.k_height
    assert config.geometry.k1 == -1e-4
    assert config.source == str(path)


def test_six_to_nine_harmonics_are_taken(tmp_path: Path) -> None:
    """The paper's six and up to nine, in their order; those that are not given are 0."""
    for count in (6, 7, 9):
        harmonics = load(write(tmp_path, mirror_with(count))).mirror.harmonics
        assert harmonics[:count] == [[10.0**-k, k / 10] for k in range(count)]
        assert harmonics[count:] == [[0.0, 0.0]] * (9 - count)
        assert len(harmonics) == len(HARMONICS) == pkg.HARMONIC_COUNT
    assert len(Config().mirror.harmonics) == 9
    assert list(HARMONICS) == list(range(1, 18, 2))


BAD = {
    "unknown_section": ("[peek]\nk_noise = 3\n", ["peek"]),
    "unknown_key": ("[peak]\nk_nose = 3\n", ["peak.k_nose", "3"]),
    "unknown_choice": ('[peak]\nperiod = "n+1"\n', ["peak.period", "n+1"]),
    "two_pass_period": (
        '[peak]\nwindow = "two_pass"\nperiod = "n-1"\n',
        ["peak", "two_pass", 'period = "n"'],
    ),
    "period_of_the_default": ('[peak]\nperiod = "n-1"\n', ["peak", "fit", 'window = "threshold"']),
    "text_for_number": ('[peak]\nk_noise = "3"\n', ["peak.k_noise", "'3'"]),
    "truth_for_number": ("[peak]\nk_noise = true\n", ["peak.k_noise", "True"]),
    "fraction_for_count": ("[peak]\nmin_width = 3.5\n", ["peak.min_width", "3.5"]),
    "below": ("[peak]\nmin_width = 2\n", ["peak.min_width", "2"]),
    "above": ("[peak]\nmax_width = 256\n", ["peak.max_width", "256"]),
    "negative": ("[peak]\nk_noise = -1\n", ["peak.k_noise", "-1"]),
    "nan": ("[geometry]\nfocal_mm = nan\n", ["geometry.focal_mm", "nan"]),
    "infinite": ("[geometry]\nbase_mm = inf\n", ["geometry.base_mm", "inf"]),
    "zero": ("[geometry]\nfocal_mm = 0\n", ["geometry.focal_mm", "0"]),
    "crossed_widths": ("[peak]\nmin_width = 9\nmax_width = 8\n", ["peak", "9", "8"]),
    "harmonics": ("[mirror]\nharmonics = [[1, 0]]\n", ["mirror.harmonics", "[[1, 0]]", "not 1"]),
    "five_harmonics": (mirror_with(5), ["mirror.harmonics", "6 to 9 pairs", "not 5"]),
    "ten_harmonics": (mirror_with(10), ["mirror.harmonics", "6 to 9 pairs", "not 10"]),
    "harmonic_of_three": (
        "[mirror]\nharmonics = [[1, 0], [1, 0], [1, 0, 0], [1, 0], [1, 0], [1, 0]]\n",
        ["mirror.harmonics", "[1, 0, 0]", "pairs [a_k, phi_k_rad]"],
    ),
    "pulse_after_line": ("[line]\npulse_us = 27\n", ["line", "pulse"]),
    "section_is_number": ("peak = 3\n", ["peak", "3"]),
    "readout_window": (
        "[sensor]\nreadout_min_us = 9.0\nreadout_max_us = 8.0\n",
        ["sensor", "readout_min_us 9.0 is above readout_max_us 8.0"],
    ),
    "lag": ("[sensor]\nreadout_lag = 4\n", ["sensor.readout_lag", "4"]),
    "not_toml": ("[peak\n", ["not a TOML file"]),
    "length": ("[sensor]\nline_length = 63\n", ["sensor.line_length", "63"]),
    "misspelt_section": ("[sensr]\n", ["unknown key sensr ({}); did you mean 'sensor'?"]),
    "misspelt_key": (
        "[sensor]\nline_lenght = 1024\n",
        ["unknown key sensor.line_lenght (1024); did you mean 'line_length'?"],
    ),
    "too_few_facets": (
        '[mirror]\nkind = "polygon"\nfacets = 3\nfrequency_hz = 240\n',
        ["mirror.facets = 3", "4"],
    ),
    "misspelt_key_of_a_polygon": (
        '[mirror]\nkind = "polygon"\nfacet = 5\n',
        ["unknown key mirror.facet (5); did you mean 'facets'?"],
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_line_that_names_file_key_and_value(tmp_path: Path, name: str) -> None:
    text, wanted = BAD[name]
    path = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load(path)
    message = str(caught.value)
    assert "\n" not in message
    for part in [str(path), *wanted]:
        assert part in message, message


def test_a_missing_file_is_answered_with_one_beside_it_of_its_kind(tmp_path: Path) -> None:
    for name in ("part.toml", "parts.stl", "part.txt"):
        (tmp_path / name).touch()
    for path, told in (
        ("prt.toml", "prt.toml: No such file or directory; did you mean 'part.toml'?"),
        ("part.tml", "part.tml: No such file or directory; did you mean 'part.toml'?"),
        ("sphere.toml", "sphere.toml: No such file or directory"),
    ):
        with pytest.raises(InputError) as caught:
            load(tmp_path / path)
        assert str(caught.value) == str(tmp_path / told)
    assert beside(tmp_path / "part.stl") == "; did you mean 'parts.stl'?"
    assert beside(tmp_path / "part.obj") == beside(tmp_path / "no" / "part.stl") == ""
    assert beside(tmp_path / "part.obj", ".obj", ".stl") == "; did you mean 'parts.stl'?"


def test_missing_folder_and_binary_files_are_refused(tmp_path: Path) -> None:
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "none.toml", tmp_path, binary):
        with pytest.raises(InputError, match=str(path)):
            load(path)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[geometry]\ncentre_px = 4000\n", "geometry.centre_px"),
        ("[geometry]\nk1 = 1\n", "geometry.k1"),
        ("[geometry]\nk2 = -1\n", "geometry.k2"),
        ("[geometry]\nbase_mm = 5000\n", "geometry.base_mm"),
        ("[geometry]\nfocal_mm = 1\n", "geometry.focal_mm"),
        ("[peak]\nk_noise = 255.9999\n", "peak.k_noise"),
    ],
)
def test_what_no_register_holds_is_refused(tmp_path: Path, text: str, key: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        Registers.from_config(load(path))
    assert str(caught.value).startswith(f"{path}: {key}: ")


@pytest.mark.parametrize("window", ["threshold", "two_pass", "fit"])
@pytest.mark.parametrize("length", [64, 1024, 2040, 2048, 4096])
def test_a_rate_that_sensor_and_clock_cannot_have_is_refused(
    tmp_path: Path, window: str, length: int
) -> None:
    """The largest rate leaves sensor and chain their time where the trim is at its end."""
    chain = min_period(
        length, MAX_WINDOW, two_pass=window != "threshold", fit=window == "fit"
    )  # 0 where the pixels alone take longer
    least_clks = max(length + 16, chain)
    most = 1e8 / least_clks / (1.0 + 2.0 / 250.0)
    text = (
        f"[clock]\nfrequency_hz = 1e8\n[mirror]\nfrequency_hz = 250.0\ntrim_hz = 2.0\n"
        f'[sensor]\nline_length = {length}\n[peak]\nwindow = "{window}"\n[line]\nrate_hz = '
    )
    assert load(write(tmp_path, f"{text}{most - 0.01}\n")).line.rate_hz == most - 0.01
    path = write(tmp_path, f"{text}{most + 0.01}\n")
    with pytest.raises(InputError) as caught:
        load(path)
    message = str(caught.value)
    assert "\n" not in message
    for part in (str(path), "line.rate_hz", f"{length} px", "100 MHz", f"at most {int(most)} Hz"):
        assert part in message


def test_a_default_rate_binds_only_who_wants_lines(tmp_path: Path) -> None:
    config = load(write(tmp_path, "[sensor]\nline_length = 8192\n"))
    assert "8192 px" in config.rate_complaint()


@EACH_SCANNER
def test_no_line_of_a_shipped_scanner_comes_too_early(config: Config) -> None:
    """At the fastest of the mirror, a line is read out and measured before the next one."""
    mirror, rate = config.mirror, config.line.rate_hz
    fastest = rate * (1.0 + mirror.trim_hz / mirror.frequency_hz)
    most = max(config.sensor.line_length + BLANKING_CLKS, config.peak.period_clks)
    assert config.rate_complaint() == "" and most * fastest <= config.clock.frequency_hz


def test_the_rate_follows_the_mirror(tmp_path: Path) -> None:
    """150.1 lines a period: the lines of ten periods lie a tenth of a line apart, the paper's."""
    line = Config().line
    assert line.rate_hz == pytest.approx(37_374.9, abs=1e-9)
    place = np.sort(np.arange(1501) / line.rate_hz * Config().mirror.frequency_hz % 1.0)
    gaps = np.diff(place) * 150.1
    assert gaps.max() == pytest.approx(0.1, abs=1e-6) == pytest.approx(gaps.min(), abs=1e-6)
    own = load(
        write(tmp_path, "[mirror]\nfrequency_hz = 250.0\n[line]\nlines_per_period = 100.25\n")
    )
    assert own.line.rate_hz == 25_062.5
    assert own.model_copy(update={}).line.rate_hz == 25_062.5
    both = "[line]\nrate_hz = 37400.0\nlines_per_period = 150.1\n"
    with pytest.raises(InputError, match="give one of the two"):
        load(write(tmp_path, both))
    with pytest.raises(InputError, match="line: the pulse ends after"):
        load(write(tmp_path, "[line]\nlines_per_period = 150.1\npulse_us = 30.0\n"))


def test_a_preset_is_a_configuration_by_its_name() -> None:
    """Each fits in the registers, and its centre and kappa are those of its own sensor."""
    for name, path in presets().items():
        config = load(Path(name))
        assert config.model_dump() == load(path).model_dump()
        assert config.source == name
        assert not config.rate_complaint()
        registers, length = Registers.from_config(config), config.sensor.line_length
        assert registers.centre == (length - 1) << (pkg.OFFSET_FRACTION - 1)
    metre = load(Path("metre"))
    assert (metre.sensor.line_length, metre.geometry.centre_px) == (1024, 511.5)
    assert metre.peak.kappa == 1023 / 20_475
    with pytest.raises(InputError, match=r"^metr: no such file, nor a preset of .*metre"):
        load(Path("metr"))


def test_a_stated_value_does_not_follow_the_sensor(tmp_path: Path) -> None:
    text = "[sensor]\nline_length = 1024\npixel_width = 10\n"
    path = write(tmp_path, f"{text}[geometry]\ncentre_px = 500.0\n[peak]\nkappa = 0.1\n")
    config = load(path)
    assert (config.geometry.centre_px, config.peak.kappa) == (500.0, 0.1)
    again = Config(geometry=load(write(tmp_path, text)).geometry)
    assert again == Config()  # 511.5 had followed, so it follows again
