"""The effects that a scene may have, by name: what each is, and which a fidelity switches on."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vrscan.errors import InputError
from vrscan.scene.description import Description


@dataclass(frozen=True)
class Effect:
    """One thing that light or sensor do, which a simulation may leave out."""

    name: str
    what: str  # in a few words
    without: str  # what stands in its place


_ALL = (
    Effect("footprint", "the spot's parts meet the scene each for itself", "a tangent plane"),
    Effect("smear", "the beam turns while the laser is on", "a spot at rest"),
    Effect("truncation", "the collimator's edge cuts the beam", "an uncut Gaussian beam"),
    Effect("diffraction", "the lens's pupil", "a geometric image"),
    Effect("defocus", "the lens's disc for other depths than its focus", "a sharp image"),
    Effect("coma", "a one-sided tail that grows with the field", "a symmetric spot"),
    Effect("falloff", "the pupil seen from the side", "the same pupil for all pixels"),
    Effect("gloss", "the lobe about the mirror direction", "Lambert alone"),
    Effect("bounce", "light from the spot that lights the rest of the scene", "one reflection"),
    Effect("speckle", "a rough surface under coherent light", "smooth light"),
    Effect("sun", "sun and sky on what the camera sees", "darkness"),
    Effect("lamps", "indoor light", "darkness"),
    Effect("ghosts", "double reflections in the camera", "one image"),
    Effect("window", "the double reflection in the scan head's window", "one beam"),
    Effect("halo", "scatter of the lens's surfaces", "smooth surfaces"),
    Effect("dust", "particles on pupil and cover", "clean surfaces"),
    Effect("shot", "photon noise", "the mean"),
    Effect("read", "noise of the read-out", "none"),
    Effect("dark", "dark current", "none"),
    Effect("prnu", "pixels differ in sensitivity", "equal ones"),
    Effect("dsnu", "pixels differ in offset", "equal ones"),
    Effect("blooming", "full pixels spill", "full pixels clip"),
    Effect("index", "jitter and drift of the index: the reported angle", "the true angle"),
)

EFFECTS = {effect.name: effect for effect in _ALL}
BASE = (
    "beam width, range equation with Lambert and the row's share, occlusion, (2)-(5), pixel "
    "aperture, exposure, gain, full scale and converter are always there"
)


def present(scene: Description) -> tuple[str, ...]:
    """Return the effects that a scene can have at all, in their order.

    The others (a sun that does not shine, a gloss that no target has) would change no bit.
    """
    absent = set()
    materials = [scene.material_of(target.material) for target in scene.target]
    if scene.sun is None:
        absent.add("sun")
    if not scene.lamp:
        absent.add("lamps")
    if not any(material.gloss > 0.0 for material in materials):
        absent.add("gloss")
    if math.isinf(scene.laser.aperture_mm):
        absent.add("truncation")
    stray = scene.stray
    head = stray.head_window
    if "head_window" not in stray.enabled or head.inner_reflectance * head.outer_reflectance == 0.0:
        absent.add("window")
    if "halo" not in stray.enabled or stray.polish.roughness_nm == 0.0:
        absent.add("halo")
    if "dust" not in stray.enabled:
        absent.add("dust")
    if not {"window", "filter", "lens", "cover", "sensor"} & set(stray.enabled):
        absent.add("ghosts")
    if scene.lens.coma_px == 0.0:
        absent.add("coma")
    if scene.sensor.prnu == 0.0:
        absent.add("prnu")
    if scene.sensor.dsnu_e == 0.0:
        absent.add("dsnu")
    if scene.sensor.read_noise_e == 0.0:
        absent.add("read")
    if scene.sensor.dark_e_per_s == 0.0:
        absent.add("dark")
    if scene.sensor.blooming == 0.0:
        absent.add("blooming")
    if scene.scan.sweep == "even":
        absent.add("index")
    return tuple(name for name in EFFECTS if name not in absent)


def chosen(names: Iterable[str], source: str) -> frozenset[str]:
    """Return a list of effects as a set.

    Raises:
        InputError: if a name is none, or stands there twice.
    """
    names = list(names)
    for name in names:
        if name not in EFFECTS:
            raise InputError(f"{source}: unknown effect {name!r} (there are {', '.join(EFFECTS)})")
        if names.count(name) > 1:
            raise InputError(f"{source}: effect {name!r} stands there twice")
    return frozenset(names)
