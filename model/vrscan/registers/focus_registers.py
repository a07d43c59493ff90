"""The autofocus's configuration as the integers that the registers take."""

import math
from dataclasses import dataclass
from enum import IntEnum

from vrscan.data import pkg
from vrscan.data.config import Config, Geometry
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import fit
from vrscan.registers.register_map import WINDOWS
from vrscan.registers.settings import FocusSettings

Z_ONE = 2**pkg.LENGTH_FRACTION  # steps per unit of length
TABLE_SIZE = WINDOWS["focus_table"].entries
FRACTION_WIDTH = 10  # fraction bits of a distance between two entries of the table


class Mode(IntEnum):
    """Source of the target of the focus."""

    OFF = 0
    MANUAL = 1
    AUTOMATIC = 2


def image_shift(z_mm: float, geometry: Geometry) -> float:
    """Return the distance of the image behind that of infinity, for a thin lens, mm.

    1/f = 1/g + 1/b gives b - f = f**2 / (g - f), where g is the way along the camera's axis to its
    point at ``z_mm``: for a point beside the axis the focus is in the sensor's plane, not at the
    point's distance.

    Args:
        z_mm: z of the point, mm.
        geometry: Geometry of the camera.

    Returns:
        The shift, infinite for a point that has no image behind the lens.
    """
    way = (z_mm - geometry.offset_mm) / math.sin(geometry.bias_rad)
    focal = geometry.focal_mm
    return focal**2 / (way - focal) if way > focal else math.inf


@dataclass(frozen=True)
class FocusRegisters(FocusSettings):
    """Configuration of the autofocus in integers; formats are those of the registers."""

    table_position: tuple[int, ...]

    @classmethod
    def from_config(cls, config: Config) -> "FocusRegisters":
        """Return the registers of a configuration, each rounded to nearest, half up.

        Positions are kept within the lens's travel.

        Raises:
            InputError: naming the key, if a value does not fit in its register, or the focus is not
                off and ``near_mm``, ``far_mm`` or ``manual_mm`` is out of the lens's reach.
        """
        focus, clock = config.focus, config.clock.frequency_hz

        def put(name: str, key: str, value: float) -> int:
            return fit(config.source, f"focus.{key}", value, f"focus_{name}")

        def steps(name: str, key: str, micrometres: float) -> int:
            return put(name, key, micrometres / focus.resolution_um)

        def position_mm(z_mm: float) -> float:
            position = focus.infinity_mm + image_shift(z_mm, config.geometry)
            return min(max(position, 0.0), focus.travel_mm)

        def reached(key: str, z_mm: float) -> float:
            position = focus.infinity_mm + image_shift(z_mm, config.geometry)
            if focus.mode != "off" and not 0.0 <= position <= focus.travel_mm:
                raise InputError(
                    f"{config.source}: focus.{key}: {z_mm:g} mm needs the lens at "
                    f"{position:.3f} mm, outside 0 to {focus.travel_mm:g}"
                )
            return position_mm(z_mm)

        reached("near_mm", focus.near_mm)
        reached("far_mm", focus.far_mm)
        manual_um = 1e3 * reached("manual_mm", focus.manual_mm)
        steps("manual", "travel_mm", 1e3 * focus.travel_mm)
        unit = config.geometry.unit_mm
        z_begin = put("z_begin", "near_mm", focus.near_mm / unit)
        # The finest table that reaches this far.
        span = focus.far_mm / unit * Z_ONE - z_begin
        z_shift = 0
        while (TABLE_SIZE - 1) << (z_shift + FRACTION_WIDTH) < span:
            z_shift += 1

        def entry(k: int) -> int:
            z_mm = (z_begin + (k << (z_shift + FRACTION_WIDTH))) / Z_ONE * unit
            return math.floor(1e3 * position_mm(z_mm) / focus.resolution_um + 0.5)

        return cls(
            manual=steps("manual", "manual_mm", manual_um),
            average_shift=focus.average_points.bit_length() - 1,
            lapse=focus.lapse_points,
            z_begin=z_begin,
            z_shift=put("z_shift", "far_mm", z_shift),
            hysteresis=steps("hysteresis", "hysteresis_um", focus.hysteresis_um),
            hold_points=focus.hold_points,
            address=focus.address,
            quarter_clks=put("quarter_clks", "quarter_us", 1e-6 * focus.quarter_us * clock),
            stretch_clks=put("stretch_clks", "stretch_ms", 1e-3 * focus.stretch_ms * clock),
            poll_clks=put("poll_clks", "poll_ms", 1e-3 * focus.poll_ms * clock),
            tolerance=steps("tolerance", "tolerance_um", focus.tolerance_um),
            timeout_clks=put("timeout_clks", "timeout_s", focus.timeout_s * clock),
            retries=focus.retries,
            protocol=int(focus.motor == "m3"),
            mode=Mode[focus.mode.upper()],
            table_position=tuple(entry(k) for k in range(TABLE_SIZE)),
        )
