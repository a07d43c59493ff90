"""The effects that a scene may have, by name, and which of them a fidelity switches on."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vrscan.data.errors import InputError, nearest
from vrscan.scene.description import Description
from vrscan.scene.scatter import emitter, receiver


@dataclass(frozen=True)
class Effect:
    """One effect of light or sensor, which a simulation may leave out."""

    name: str
    what: str  # description in a few words
    without: str  # what replaces it
    # Per line, from the medians that ``vrscan bench light --write`` measures. auto uses it, so its
    # choice is the same on any machine.
    typical_us: float


_ALL = (
    Effect("footprint", "the spot's parts meet the scene each for itself", "a tangent plane", 4.0),
    Effect("detail", "every ray meets the scene for itself", "a few on smooth surfaces", 1.0),
    Effect("smear", "the beam turns while the laser is on", "a spot at rest", 0.2),
    Effect("truncation", "the collimator's edge cuts the beam", "an uncut Gaussian beam", 1.0),
    Effect("diffraction", "the lens's pupil", "a geometric image", 0.0),
    Effect("defocus", "the lens's disc for other depths than its focus", "a sharp image", 2.0),
    Effect("coma", "a one-sided tail that grows with the field", "a symmetric spot", 0.3),
    Effect("falloff", "the pupil seen from the side", "the same pupil for all pixels", 0.0),
    Effect("gloss", "the lobe about the mirror direction", "Lambert alone", 0.5),
    Effect(
        "bounce", "light from the spot that lights the rest of the scene", "one reflection", 8.0
    ),
    Effect("mirrored", "spots seen in a glossy surface, and mirrored beams", "one reflection", 5.0),
    Effect("subsurface", "light leaves beside where it entered", "it leaves where it enters", 10.0),
    Effect("speckle", "a rough surface under coherent light", "smooth light", 4.5),
    Effect("grain", "speckle is coarser out of focus", "speckle as in focus", 2.0),
    Effect("sun", "sun and sky on what the camera sees", "darkness", 5.0),
    Effect("lamps", "indoor light", "darkness", 5.0),
    Effect("veil", "sun and lamps outside what the lens sees", "a black barrel", 0.0),
    Effect("ghosts", "reflections to and fro in the camera", "one image", 8.0),
    Effect("window", "the double reflection in the scan head's window", "one beam", 1.0),
    Effect("skirt", "what the scan head scatters lights the scene", "its loss alone", 4.5),
    Effect("halo", "what polish, dust, digs in the camera scatter", "its loss alone", 2.0),
    Effect("wings", "bounce, skirt, halo far from spots", "in their windows alone", 0.1),
    Effect("dust", "shadows of particles on pupil and cover", "clean surfaces", 0.3),
    Effect("shot", "photon noise", "the mean", 0.1),
    Effect("read", "noise of the read-out", "none", 0.1),
    Effect("dark", "dark current", "none", 0.0),
    Effect("prnu", "pixels differ in sensitivity", "equal ones", 0.7),
    Effect("dsnu", "pixels differ in offset", "equal ones", 0.3),
    Effect("blooming", "full pixels spill", "full pixels clip", 1.0),
    Effect("index", "jitter and drift of the index: the reported angle", "the true angle", 0.0),
)

EFFECTS = {effect.name: effect for effect in _ALL}
BESIDE = frozenset({"bounce", "skirt", "halo"})  # light beside the spot, whose far part is wings
# With one of these no line is mostly even.
WHOLE_LINE = frozenset({"ghosts", "wings"})
WHOLE_LINE_US = 15.0  # typical time of these
RAYS_US, DETAIL_US = 3.0, 4.0  # typical times of rays that are not needed, and of all of these
LINE_US = 20.0  # typical time of a line without effects, up to its point
START_US = 8000.0  # typical time to start rendering, however few the lines
BASE = (
    "beam width, range equation with Lambert and the row's share, occlusion, loss by scatter, "
    "(2)-(5), pixel aperture, exposure, gain, full scale and converter are always there"
)


def present(scene: Description) -> tuple[str, ...]:
    """Return the effects that can occur in a scene, in their order.

    The others (a sun that does not shine, a gloss that no target has) would change no bit.
    """
    absent = set()
    materials = [scene.material_of(target.material) for target in scene.target]
    if scene.sun is None:
        absent.add("sun")
    if not scene.lamp:
        absent.add("lamps")
    if not any(material.gloss > 0.0 for material in materials):
        absent |= {"gloss", "mirrored"}
    if all(material.subsurface is None for material in materials):
        absent.add("subsurface")
    if math.isinf(scene.laser.aperture_mm):
        absent.add("truncation")
    stray = scene.stray
    head = stray.head_window
    if "head_window" not in stray.enabled or head.inner_reflectance * head.outer_reflectance == 0.0:
        absent.add("window")
    if (scene.sun is None and not scene.lamp) or math.isinf(stray.out_of_field):
        absent.add("veil")
    if receiver(stray).total == 0.0:
        absent.add("halo")
    if emitter(stray).total == 0.0:
        absent.add("skirt")
    if "dust" not in stray.enabled:
        absent.add("dust")
    if absent >= BESIDE:
        absent.add("wings")
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
        InputError: if a name is unknown, or is given twice.
    """
    names = list(names)
    for name in names:
        if name not in EFFECTS:
            raise InputError(
                f"{source}: unknown effect {name!r} (there are {', '.join(EFFECTS)})"
                f"{nearest(name, EFFECTS)}"
            )
        if names.count(name) > 1:
            raise InputError(f"{source}: effect {name!r} stands there twice")
    return frozenset(names)


def whole_lines(active: frozenset[str]) -> bool:
    """Return whether light falls on all of every line with a set of effects."""
    return "ghosts" in active or ("wings" in active and bool(active & BESIDE))


def typical_us(active: frozenset[str], *, rays: bool) -> float:
    """Return the typical time of a set of effects, microseconds per line."""
    total = sum(EFFECTS[name].typical_us for name in active)
    total += WHOLE_LINE_US if whole_lines(active) else 0.0
    if rays and "footprint" in active:
        total += RAYS_US + (DETAIL_US if "detail" in active else 0.0)
    return total
