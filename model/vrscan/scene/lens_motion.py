"""The camera's lens in motion: its motor, and the light of a scene at every position of it.

Positions are steps of ``focus.resolution_um`` from ``focus.infinity_mm``: the way of the lens from
where infinity is in focus, f^2 / (g - f) for the depth g. The motor moves at a constant speed; the
model leaves out its run-up and creep, its sensor's noise, and that the lens moves in a pulse. Light
is made with a moving lens where it is to 2 um, which is 0.04 px at the sensor's ends.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from vrscan.data.config import Config
from vrscan.data.correction_maps import extension_mm, focus_of_mm
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer

_NEAR_BITS = 7  # positions that share the light beside the spot, as a power of two: 64 um
MOVING_STEPS = 4  # while it moves the lens is where it is to so many steps
_KEPT = 64  # renderers that are kept
_LEAST_MM = 1e-3  # least way of the lens from infinity that has a focus


def steps_of(focus_mm: float, config: Config) -> int:
    """Return the position of the lens, steps from infinity's, for a depth in focus, within travel.

    Args:
        focus_mm: Depth along the lens's axis, more than the focal length.
        config: The focal length, the motor's steps and its travel.
    """
    step_mm = 1e-3 * config.focus.resolution_um
    last = int((config.focus.travel_mm - config.focus.infinity_mm) / step_mm)
    return min(max(round(extension_mm(focus_mm, config.geometry.focal_mm) / step_mm), 0), last)


def focus_of(steps: int, config: Config) -> float:
    """Return the depth in focus at a position of the lens, mm: the inverse of ``steps_of``."""
    way = max(1e-3 * config.focus.resolution_um * steps, _LEAST_MM)
    return focus_of_mm(way, config.geometry.focal_mm)


@dataclass(frozen=True)
class Motion:
    """A move of the lens at constant speed; times are clocks, positions steps."""

    begin: int  # clock at which it leaves
    start: int  # position before
    target: int
    step_clks: int  # clocks of a step

    def at(self, clock: int) -> int:
        """Return the position of the lens at a clock."""
        done = max(clock - self.begin, 0) // self.step_clks
        way = self.target - self.start
        return self.start + (min(done, way) if way >= 0 else -min(done, -way))

    def seen(self, clock: int) -> int:
        """Return the position for which light is made: at rest exactly, else to some steps."""
        at = self.at(clock)
        if at == self.target or at == self.start:
            return at
        return at - at % MOVING_STEPS

    def towards(self, target: int, clock: int) -> "Motion":
        """Return the move to another target that is given at a clock."""
        return Motion(clock, self.at(clock), target, self.step_clks)


class Foci:
    """Renderers of a scene, by the position of its lens."""

    def __init__(self, light: Light, renderer: Callable[[Light], Renderer]) -> None:
        """Keep the scene; ``renderer`` makes the renderer of a light."""
        self._light, self._make = light, renderer
        self._near: OrderedDict[int, Light] = OrderedDict()
        self._kept: OrderedDict[int, Renderer] = OrderedDict()

    def renderer(self, steps: int) -> Renderer:
        """Return the renderer with the lens at a position, steps from infinity's."""
        if steps not in self._kept:
            near = self._beside(((steps >> _NEAR_BITS) << _NEAR_BITS) + (1 << (_NEAR_BITS - 1)))
            light = near.focused(focus_of(steps, self._light.belief), afresh=False)
            self._kept[steps] = self._make(light)
            if len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(steps)
        return self._kept[steps]

    def _beside(self, steps: int) -> Light:
        if steps not in self._near:
            focus_mm = focus_of(steps, self._light.belief)
            self._near[steps] = self._light.focused(focus_mm, afresh=True)
            if len(self._near) > 4:
                self._near.popitem(last=False)
        return self._near[steps]
