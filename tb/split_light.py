"""Ghosts found by splitting light at every surface, apart from the polynomials of ``ghosts``."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.scene.ghosts import Stack, Surface
from vrscan.scene.stray import disc_overlap

Key = tuple[int, int, int]  # place along and across the row, and size, in 1e-4 px


@dataclass(frozen=True)
class Found:
    """A ghost with the surfaces that make it."""

    surfaces: tuple[str, ...]
    times: tuple[int, ...]  # number of reflections at each surface
    power: float  # share of the spot's light
    offset_px: float
    across_px: float
    blur_px: float

    @property
    def name(self) -> str:
        """Return its surfaces, each with the number of its reflections where that is not 1."""
        parts = zip(self.surfaces, self.times, strict=True)
        return " + ".join(name if count == 1 else f"{name} x{count}" for name, count in parts)


def identify(
    stack: Stack, *, focus_mm: float, distance_mm: float, field_mm: float, least_power: float
) -> tuple[Found, ...]:
    """Return which surfaces make each ghost, the strongest first.

    Metis 3.1: light is split at every surface, whichever way it runs, until it is too weak, which
    gives a list of images whose origin is not known. Then one surface after another transmits all
    light, and the ghosts that are gone are assigned to it. How often a surface reflects a ghost
    follows from the ghost's intensity when the surface reflects half as much.

    Ghosts that fall on each other within 1e-4 px are one row, and all surfaces without which it
    loses light are named; one that falls so on the direct image is not seen.

    Args:
        stack: The receiver.
        focus_mm: Distance at which the receiver is in focus, from the entrance pupil.
        distance_mm: Distance of the spot.
        field_mm: Position u of the direct image.
        least_power: Light weaker than this share of the direct light is not followed.
    """
    spot = (focus_mm, distance_mm, field_mm)
    # Well below the threshold, so that a ghost that only weakens does not count as gone.
    deep = 0.1 * least_power
    whole = _split(stack, *spot, deep)
    makers: dict[Key, list[tuple[str, int]]] = {key: [] for key in whole}
    for index, surface in enumerate(stack.surfaces):
        if surface.reflectance == 0.0:
            continue
        without = _split(_with(stack, index, 0.0), *spot, deep)
        half = _split(_with(stack, index, 0.5 * surface.reflectance), *spot, deep)
        for key, ghost in whole.items():
            left = without[key].power if key in without else 0.0
            if left < 0.99 * ghost.power:
                weaker = half[key].power if key in half else 0.0
                times = math.log2(ghost.power / weaker) if weaker > 0.0 else 1.0
                makers[key].append((surface.name, max(1, round(times))))
    found = [
        replace(
            ghost,
            surfaces=tuple(name for name, _ in makers[key]),
            times=tuple(count for _, count in makers[key]),
        )
        for key, ghost in whole.items()
        if ghost.power >= least_power
    ]
    return tuple(sorted(found, key=lambda ghost: -ghost.power))


def _with(stack: Stack, index: int, reflectance: float) -> Stack:
    surfaces = list(stack.surfaces)
    surfaces[index] = replace(surfaces[index], reflectance=reflectance)
    return replace(stack, surfaces=tuple(surfaces))


def _through(surface: Surface, way: int, rays: Floats, lean: Floats) -> Floats:
    """Return the slopes of rays (y, slope) behind a surface that they pass forwards, 1, or -1."""
    leaning = surface.curvature * rays[:, 0] + lean
    ratio = (surface.before / surface.after) ** way
    return ratio * (rays[:, 1] + leaning) - leaning - way * surface.power * rays[:, 0]


def _straight(stack: Stack, places: Floats, rays: Floats, lean: Floats) -> Iterator[Floats]:
    """Yield y of rays that nothing reflects at each surface; ``lean`` is [surface, ray]."""
    rays = rays.copy()
    for index, surface in enumerate(stack.surfaces):
        yield rays[:, 0].copy()
        if index + 1 < len(stack.surfaces):
            rays[:, 1] = _through(surface, 1, rays, lean[index])
            rays[:, 0] += rays[:, 1] * (places[index + 1] - places[index])


def _split(
    stack: Stack, focus_mm: float, distance_mm: float, field_mm: float, least: float
) -> dict[Key, Found]:
    """Return the images that the split light makes, by place and size, without the direct one."""
    places = np.cumsum([0.0] + [surface.gap_mm for surface in stack.surfaces[:-1]])
    places[stack.moving + 1 :] += float(stack.travel(np.array(focus_mm)))
    lean = np.array([(each.tilt_rad, each.across_rad, 0.0) for each in stack.surfaces])
    last = len(stack.surfaces) - 1
    # Chief ray along and across the row, and a ray of the pencil, each as (y, slope).
    rays = np.zeros((3, 2))
    for plane, target in enumerate((field_mm, 0.0)):
        # By y, by slope, and by the surfaces' tilts, at the stop and at the sensor.
        unit = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
        met = list(_straight(stack, places, unit, lean[:, plane, None] * np.array([0.0, 0.0, 1.0])))
        stop, end = met[stack.stop], met[last]
        rays[plane] = np.linalg.solve([stop[:2], end[:2]], [-stop[2], target - end[2]])
    near = 1.0 / distance_mm
    rays[2] = np.array([1.0 - stack.pupil_mm * near, near]) / stop[0]
    direct = math.prod(1.0 - surface.reflectance for surface in stack.surfaces[:-1])
    images: dict[Key, Found] = {}
    waiting = [(0, 1, rays, 1.0 / direct, 1.0, -1)]
    while waiting:
        index, way, rays, power, share, visits = waiting.pop()
        surface = stack.surfaces[index]
        if index == stack.stop:
            visits += 1
            if visits > 0:
                middle = np.hypot(rays[0, 0], rays[1, 0])
                radius = max(abs(rays[2, 0]) * stack.stop_mm, 1e-6)
                common = float(disc_overlap(radius, stack.stop_mm, middle))
                share = min(share, common / (math.pi * radius**2))
        if index == last:
            offset, across = (rays[0, 0] - field_mm) / stack.pitch_mm, rays[1, 0] / stack.pitch_mm
            blur = abs(rays[2, 0]) * stack.stop_mm / stack.pitch_mm
            key = (round(1e4 * offset), round(1e4 * across), round(1e4 * blur))
            old = images[key].power if key in images else 0.0
            images[key] = Found((), (), old + power * share, offset, across, blur)
        if 0 <= index + way <= last and power * (1.0 - surface.reflectance) >= least:
            onward = rays.copy()
            onward[:, 1] = _through(surface, way, rays, lean[index])
            onward[:, 0] += onward[:, 1] * (places[index + way] - places[index])
            waiting.append(
                (index + way, way, onward, power * (1.0 - surface.reflectance), share, visits)
            )
        if index - way >= 0 and power * surface.reflectance >= least:
            back = rays.copy()
            back[:, 1] = -rays[:, 1] - 2.0 * (surface.curvature * rays[:, 0] + lean[index])
            back[:, 0] += back[:, 1] * (places[index - way] - places[index])
            waiting.append((index - way, -way, back, power * surface.reflectance, share, visits))
    # The direct image: where the spot is, as sharp as its defocus, with all of the light.
    brightest = max(images, key=lambda key: images[key].power)
    del images[brightest]
    return images
