"""A scene's file: what it may say, and one clear line for what it may not."""

import re
from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.data.config import load as configuration
from vrscan.data.errors import InputError
from vrscan.engines.tools import repository_root
from vrscan.scene.description import Description, load, parse, shipped
from vrscan.scene.effects import BASE, EFFECTS, chosen, present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate
from vrscan.study.plan import plan

WANTED = [
    *("default", "plane", "step", "relief", "bolt", "bust", "dark", "glossy"),
    *("corner", "sunlit", "window-ghost", "far", "near", "two-surfaces"),
    *("shiny-corner", "turned-metal", "plastic"),
]
PLANE: dict[str, object] = {"kind": "plane", "position_mm": [0, 0, 400]}


def _parse(**values: object) -> Description:
    return parse({"target": [PLANE], **values}, "my.toml", Path())


def _fails(make: object, *wanted: str) -> None:
    """Assert that a call raises an InputError of one line that says all this."""
    assert callable(make)
    with pytest.raises(InputError) as caught:
        make()
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 320
    for part in wanted:
        assert part in text, text


def test_the_shipped_scenes_are_all_there() -> None:
    names = shipped()
    assert names[0] == "default"
    assert set(WANTED) <= set(names)


@pytest.mark.parametrize("name", WANTED)
def test_each_shipped_scene_gives_lines_with_points_in_view(name: str) -> None:
    scene = load(name)
    assert scene.title
    assert scene.source == name
    frame = simulate(Light(scene, Config()), 300, frozenset())
    truth = frame.lines.truth
    assert truth is not None
    seen = np.isfinite(truth.position_px)
    assert seen.mean() > 0.1
    assert frame.lines.lines[seen].max() > 200


def test_the_shortest_scene_is_one_target() -> None:
    scene = _parse()
    assert scene.fidelity == "auto"
    assert scene.tolerance_px == 0.01
    assert scene.material_of("default").reflectance == 0.3
    names = present(scene)
    # What the file does not have is not there; all else is.
    assert set(EFFECTS) - set(names) == {"sun", "lamps", "veil", "gloss", "mirrored", "subsurface"}
    assert list(names) == [name for name in EFFECTS if name in names]
    assert BASE


@pytest.mark.parametrize(
    ("table", "gone"),
    [
        ({"sensor": {"read_noise_e": 0}}, {"read"}),
        ({"sensor": {"prnu": 0, "dsnu_e": 0}}, {"prnu", "dsnu"}),
        ({"sensor": {"dark_e_per_s": 0, "blooming": 0}}, {"dark", "blooming"}),
        ({"lens": {"coma_px": 0}}, {"coma"}),
        ({"scan": {"sweep": "even"}}, {"index"}),
        ({"laser": {"aperture_mm": float("inf")}}, {"truncation"}),
        ({"stray": {"enabled": ["lens"]}}, {"window", "skirt", "halo", "dust"}),
        ({"stray": {"enabled": []}}, {"window", "skirt", "halo", "dust", "ghosts"}),
        (
            {"stray": {"enabled": ["cover", "mirror", "halo"], "polish": {"roughness_nm": 0}}},
            {"window", "halo", "dust"},
        ),
        ({"stray": {"head_window": {"inner_reflectance": 0}}}, {"window"}),
    ],
)
def test_what_a_scene_does_not_have_is_absent_and_would_change_nothing(
    table: dict[str, object], gone: set[str]
) -> None:
    scene = _parse(**table)
    base = set(present(_parse()))
    assert base - set(present(scene)) == gone
    light = Light(scene, Config())
    plain = simulate(light, 40, frozenset({"shot", "defocus"}))
    more = simulate(light, 40, frozenset({"shot", "defocus"} | gone))
    if gone != {"index"}:
        assert np.array_equal(plain.lines.lines, more.lines.lines)
    assert np.array_equal(plain.lines.angle_rad, more.lines.angle_rad)


def test_a_files_own_files_are_looked_for_beside_it(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(
        '[[target]]\nkind = "mesh"\nfile = "box.stl"\nposition_mm = [0, 0, 400]\n'
    )
    name = str(tmp_path / "scene.toml")
    scene = load(name)
    assert scene.folder == tmp_path
    assert scene.source == name
    _fails(lambda: Light(scene, Config()), "box.stl")
    import trimesh

    trimesh.creation.box((30, 30, 30)).export(tmp_path / "box.stl")
    assert Light(scene, Config()).world.bounds[0, 2] == pytest.approx(385.0)
    half = trimesh.creation.box((30, 30, 30))
    half.update_faces(np.arange(len(half.faces)) > 1)
    half.export(tmp_path / "box.stl")
    _fails(lambda: Light(scene, Config()), "box.stl")
    (tmp_path / "box.stl").write_bytes(b"solid nothing of the sort")
    _fails(lambda: Light(scene, Config()), "box.stl")


@EACH_SCANNER
def test_the_sensor_is_the_configurations(config: Config) -> None:
    """A scene knows neither its length, bits nor pitch; any scene is seen by any sensor."""
    for key in ("line_length", "pixel_width", "pitch_mm"):
        _fails(lambda key=key: _parse(sensor={key: 8}), f"unknown key sensor.{key}")
    sensor, top = config.sensor, 2**config.sensor.pixel_width - 1
    wall = {"kind": "plane", "position_mm": [0, 0, 700]}
    scene = _parse(target=[wall], scan={"sweep": "even", "half_angle_deg": 5.0})
    lines = simulate(Light(scene, config), 8, frozenset({"shot"})).lines.lines
    assert lines.shape == (8, sensor.line_length) and 0.1 * top < lines.max() <= top


def test_what_a_scene_does_not_say_is_the_configurations() -> None:
    """The instrument's power, lens and sensor have one place, unless a scene says another."""
    deep = {"pixel_width": 10, "full_well_e": 102_375.0}
    config = Config.model_validate(
        {
            "sensor": deep,
            "free": {"focus_mm": 380.0, "f_number": 4.0},
            "laser": {"rated_mw": 30.0},
        }
    )
    light = Light(_parse(), config)
    assert light.scene.laser.power_mw == 30.0
    assert (light.scene.lens.f_number, light.scene.lens.focus_mm) == (4.0, 380.0)
    assert light.lens.pupil_mm == pytest.approx(light.config.geometry.focal_mm / 4.0)
    assert light.scene.sensor.full_well_e == pytest.approx(125_000.0)
    # Its pixels end at the converter's last code; a well of 25,000 e would end at 310 of 1,023.
    frame = simulate(Light(_parse(lens={"f_number": 1.0}), config), 64, frozenset())
    assert frame.lines.lines.max() == 1023
    said = _parse(
        laser={"power_mw": 20.0}, lens={"focus_mm": 500.0}, sensor={"full_well_e": 25_000.0}
    )
    own = Light(said, config).scene
    assert (own.laser.power_mw, own.lens.focus_mm) == (20.0, 500.0)
    assert (own.lens.f_number, own.sensor.full_well_e) == (4.0, 25_000.0)
    assert said.of(Config()) == said and Light(own, Config()).scene == own
    with pytest.raises(InputError, match="rated 30 mW"):
        Light(_parse(laser={"power_mw": 31.0}), config)


def test_an_instrument_of_another_sensor_is_refused() -> None:
    scene = _parse(instrument={"centre_px": 1023.5})
    Light(scene, Config())
    words = "my.toml: instrument.centre_px = 1023.5: the configuration has a sensor of 1024 px"
    _fails(lambda: Light(scene, configuration(Path("metre"))), words)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('[[target]]\nkind = "plane"\ncolour = "red"\n', "unknown key target.0"),
        (
            '[[target]]\nkind = "sphere"\nradius = 5\n',
            "unknown key target.0.sphere.radius (5); did you mean 'radius_mm'?",
        ),
        ('[[target]]\nkind = "torus"\n', "torus"),
        ('titel = "x"\n[[target]]\nkind = "plane"\n', "unknown key titel"),
        ('[[target]]\nkind = "plane"\n[laser]\npower_mw = -5\n', "laser.power_mw"),
        ('[[target]]\nkind = "plane"\n[laser]\npower_mw = nan\n', "laser.power_mw"),
        ('[[target]]\nkind = "plane"\n[laser]\npower_mw = "much"\n', "laser.power_mw"),
        ('[[target]]\nkind = "plane"\n[lens]\nfilter_nm = [665, 645]\n', "filter_nm"),
        ('[[target]]\nkind = "plane"\n[lens]\nfilter_nm = 650\n', "filter_nm"),
        ('[[target]]\nkind = "plane"\nmaterial = "gold"\n', "gold"),
        ('[[target]]\nkind = "plane"\n[material.m]\nreflectance = 0.8\ngloss = 0.3\n', "gloss"),
        ('[[target]]\nkind = "plane"\nposition_mm = [0, 0]\n', "position_mm"),
        ('[[target]]\nkind = "sphere"\nradius_mm = -1\n', "radius_mm"),
        ('[[target]]\nkind = "plane"\n[sun]\ntime = "noon"\n', "time"),
        ('[[target]]\nkind = "plane"\n[sun]\ntime = "2024-06-01T12:00:00"\n', "time"),
        ('fidelity = "best"\n[[target]]\nkind = "plane"\n', "fidelity"),
        ('tolerance_px = 0\n[[target]]\nkind = "plane"\n', "tolerance_px"),
        ("", "target"),
        ("target = []\n", "target"),
        ("[[target]\n", "not a TOML file"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(tmp_path: Path, text: str, wanted: str) -> None:
    path = tmp_path / "my.toml"
    path.write_text(text)
    _fails(lambda: load(str(path)), "my.toml", wanted)


def test_files_that_are_none_are_told_in_one_line(tmp_path: Path) -> None:
    _fails(lambda: load("nowhere"), "nowhere", "no such scene", "default")
    _fails(lambda: load(str(tmp_path / "none.toml")), "none.toml")
    _fails(lambda: load(str(tmp_path) + "/"), "no such scene")
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    _fails(lambda: load(str(folder)), "folder.toml")
    (tmp_path / "binary.toml").write_bytes(bytes(range(128, 256)))
    _fails(lambda: load(str(tmp_path / "binary.toml")), "binary.toml", "not a TOML file")


def test_a_scene_and_an_instrument_that_do_not_fit_are_told_in_one_line() -> None:
    night = {"latitude_deg": 48, "longitude_deg": 11, "time": "2024-12-21T23:00:00+01:00"}
    _fails(lambda: Light(_parse(sun=night), Config()), "sun", "below the horizon")
    _fails(lambda: Light(_parse(laser={"power_mw": 51}), Config()), "power_mw", "rated")
    _fails(lambda: Light(_parse(exposure_us=30), Config()), "exposure_us", "longer")
    _fails(lambda: Light(_parse(exposure_us=0.5), Config()), "exposure_us", "shorter")
    _fails(lambda: Light(_parse(laser={"wavelength_nm": 780}), Config()), "wavelength_nm", "filter")
    Light(_parse(laser={"wavelength_nm": 780}, lens={"filter_nm": [770, 790]}), Config())
    two = [{**PLANE, "name": "a"}, {**PLANE, "name": "a"}]
    _fails(lambda: Light(parse({"target": two}, "my.toml", Path()), Config()), "target a")
    slow = _parse(laser={"rise_us": 3})
    _fails(lambda: simulate(Light(slow, Config()), 5, frozenset()), "rise_us")


def test_what_cannot_be_seen_is_told_in_one_line() -> None:
    for place in ([0, 0, -300], [0, 900, 400], [900, 0, 300]):
        ball = {"kind": "sphere", "position_mm": place, "radius_mm": 20}
        scene = parse({"target": [ball]}, "my.toml", Path())
        _fails(lambda scene=scene: plan(Light(scene, Config()), 300), "my.toml", "no target")


def test_an_unknown_effect_is_told_in_one_line() -> None:
    _fails(lambda: chosen(["speckle", "specle"], "my.toml"), "my.toml", "'specle'", "speckle")
    _fails(lambda: chosen(["sun", "sun"], "my.toml"), "twice")
    scene = _parse(fidelity=["speckle", "gremlins"])
    _fails(lambda: plan(Light(scene, Config()), 300), "my.toml", "gremlins")
    assert chosen([], "my.toml") == frozenset()


def test_the_page_on_light_knows_every_scene_and_every_effect() -> None:
    page = (repository_root() / "docs" / "light.md").read_text()
    for name in shipped():
        assert re.search(rf"\b{name}\b", page), f"docs/light.md: no scene {name}"
    effects = page.partition("## The effects")[2].partition("\n## ")[0]
    for name in EFFECTS:
        assert re.search(rf"\| [^|]*\b{name}\b", effects), f"docs/light.md: no effect {name}"
