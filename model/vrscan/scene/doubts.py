"""Values of a scene that a file may have, and that hardly anybody means."""

import numpy as np

from vrscan.scene.beam import radius_mm
from vrscan.scene.light import Light
from vrscan.scene.surface import tis_of


def doubts(light: Light) -> list[str]:
    """Return a line of text for each value that hardly anybody means: its key, itself, and why."""
    return [*_of_targets(light), *_of_materials(light), *_of_the_instrument(light)]


def _of_targets(light: Light) -> list[str]:
    found, end = [], light.config.geometry.range_mm
    for name, (low, high) in zip(light.world.names, light.world.each_bounds, strict=True):
        if low[2] > end:
            found.append(
                f"target {name} begins at z = {low[2]:g} mm: coordinates end at {end:g} mm"
            )
        elif high[2] <= 0.0:
            found.append(f"target {name} ends at z = {high[2]:g} mm: behind the instrument")
    return found


def _of_materials(light: Light) -> list[str]:
    scene, found = light.scene, []
    for name in dict.fromkeys(target.material for target in scene.target):
        material = scene.material_of(name)
        if material.reflectance == 0.0 and material.gloss == 0.0:
            found.append(
                f"material.{name}.reflectance = 0, without gloss: it sends nothing to the camera"
            )
        scatter = tis_of(material, scene.laser.wavelength_nm)
        if material.gloss > 0.0 and scatter > 1.0:
            found.append(
                f"material.{name}.roughness_nm = {material.roughness_nm:g}: a smooth surface would "
                f"scatter {scatter:.3g} times its gloss, more than it gets; all of it is scattered"
            )
    return found


def _of_the_instrument(light: Light) -> list[str]:
    scene, config = light.scene, light.config
    laser, lens, sensor = scene.laser, scene.lens, scene.sensor
    found = [
        f"{key} = 0: {why}"
        for key, value, why in (
            ("laser.power_mw", laser.power_mw, "no light of the laser"),
            ("lens.transmission", lens.transmission, "no light reaches the sensor"),
            ("lens.filter_transmission", lens.filter_transmission, "no light reaches the sensor"),
            ("sensor.quantum_efficiency", sensor.quantum_efficiency, "the sensor is blind"),
        )
        if value == 0.0
    ]
    focal = config.geometry.focal_mm
    z_mm = float(light.world.bounds[0, 2])
    near = np.array([z_mm if 0.0 < z_mm < config.geometry.range_mm else lens.focus_mm])
    wide = 2.0 * float(radius_mm(near, laser)[0]) * focal / config.geometry.pitch_mm / near[0]
    most = min(config.peak.max_width, config.sensor.line_length)
    if wide > most:
        field = " and the field" if wide > config.sensor.line_length else ""
        found.append(
            f"laser.beam_diameter_mm = {laser.beam_diameter_mm:g}: the spot at {near[0]:.0f} mm is "
            f"{wide:,.0f} px wide, wider than the largest window of {most} px{field}"
        )
    dark = sensor.dark_electrons(light.exposure_s)
    if dark > sensor.full_well_e:
        found.append(
            f"sensor.dark_e_per_s = {sensor.dark_e_per_s:g}: fills the pixels in one exposure"
        )
    return found
