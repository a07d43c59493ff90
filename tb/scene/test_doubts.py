"""Values of a scene that hardly anybody means: each is told with its key, and no shipped one is."""

from pathlib import Path

import pytest
from harness import in_volume

from vrscan.data.config import Config
from vrscan.scene.description import load, parse, shipped
from vrscan.scene.doubts import doubts
from vrscan.scene.light import Light

PLANE = {"kind": "plane", "position_mm": [0, 0, 400]}
ROUGH = {"reflectance": 0.1, "gloss": 0.5, "roughness_nm": 800}


@pytest.mark.parametrize(
    ("tables", "wanted"),
    [
        ({"target": [{**PLANE, "position_mm": [0, 0, 1e7]}]}, "target plane begins at z = 1e+07"),
        ({"target": [{**PLANE, "position_mm": [0, 0, -5]}, PLANE]}, "plane 1 ends at z = -5 mm"),
        ({"material": {"default": {"reflectance": 0}}}, "material.default.reflectance = 0"),
        ({"material": {"default": ROUGH}}, "material.default.roughness_nm = 800"),
        ({"laser": {"power_mw": 0}}, "laser.power_mw = 0"),
        ({"lens": {"transmission": 0}}, "lens.transmission = 0"),
        ({"lens": {"filter_transmission": 0}}, "lens.filter_transmission = 0"),
        ({"sensor": {"quantum_efficiency": 0}}, "sensor.quantum_efficiency = 0"),
        ({"sensor": {"dark_e_per_s": 1e12}}, "sensor.dark_e_per_s = 1e+12"),
        ({"laser": {"beam_diameter_mm": 60, "aperture_mm": 60}}, "laser.beam_diameter_mm = 60"),
    ],
)
def test_each_is_told_by_itself(tables: dict[str, object], wanted: str) -> None:
    scene = parse({"target": [PLANE], **tables}, "my.toml", Path())
    found = doubts(Light(scene, Config()))
    assert len(found) == 1 and wanted in found[0] and "\n" not in found[0], found


def test_nothing_is_doubted_without_need() -> None:
    black = {"default": {"reflectance": 0, "gloss": 0.5, "roughness_nm": 20}}
    tilted = {**PLANE, "rotation_deg": [0, 40, 0]}  # endless, and in part behind the instrument
    for tables in ({"material": black}, {"target": [tilted]}, {"lens": {"focus_mm": 2000}}):
        scene = parse({"target": [PLANE], **tables}, "my.toml", Path())
        assert doubts(Light(scene, Config())) == []


@pytest.mark.parametrize(
    "name", ["dark", "glossy", "turned-metal", "far", *(in_volume(name) for name in shipped())]
)
def test_no_shipped_scene_is_doubted(name: str) -> None:
    assert doubts(Light(load(name), Config())) == []
