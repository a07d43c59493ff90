"""The correction maps of a configuration as the integers that ``correction_map`` takes."""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.data.config import Config
from vrscan.data.correction_maps import COLUMNS, ROWS, FieldMaps, extension_mm
from vrscan.data.errors import InputError
from vrscan.ideal.correction_map import maps_for
from vrscan.registers.register_map import REGISTERS


@dataclass(frozen=True)
class MapTable:
    """Maps in the formats of ``register_pkg::map_t`` and of the nodes."""

    nodes: Ints  # s17, 10 fraction bits, px [2 to pkg.MAP_COUNT, 33, 65]
    filled: Bools  # whether a node was filled and not measured
    map_begin: int  # u16, steps of the lens: of the first map
    map_shift: int  # the maps are 2**map_shift steps apart
    lens: int  # u16, steps: where the lens stands

    @property
    def words(self) -> Ints:
        """The nodes as the words of ``map_table``, one behind the other."""
        value = self.nodes & (1 << pkg.MAP_WIDTH) - 1
        return (value | self.filled.astype(np.int64) << pkg.MAP_WIDTH).ravel()


def nodes_of(words: Ints) -> tuple[Ints, Bools]:
    """Return the nodes that words of ``map_table`` stand for, and whether each was filled."""
    words = words.reshape(-1, ROWS, COLUMNS)
    sign = 1 << pkg.MAP_WIDTH - 1
    return ((words & 2 * sign - 1) ^ sign) - sign, words >> pkg.MAP_WIDTH != 0


def field_maps(table: MapTable, config: Config) -> FieldMaps:
    """Return maps as their file has them; their residuals, which no board knows, are 0."""
    step_mm = 1e-3 * config.focus.resolution_um
    return FieldMaps(
        focal_mm=config.geometry.focal_mm,
        lens_begin_mm=table.map_begin * step_mm - config.focus.infinity_mm,
        lens_step_mm=step_mm * 2.0**table.map_shift,
        corrections_px=table.nodes.astype(np.float64) * 2.0**-pkg.MAP_FRACTION,
        filled=table.filled,
        residual_px=np.zeros(len(table.nodes)),
    )


def map_registers(config: Config) -> dict[str, int]:
    """Return the registers of the group ``map``, but for the bank, which the host chooses.

    Where the focus is not off, the lens stands where its motor says.

    Raises:
        InputError: as ``map_table``.
    """
    names = ("map_enable", "map_count", "map_begin", "map_shift", "map_follow", "map_lens")
    maps, follow = map_table(config), int(config.focus.mode != "off")
    if maps is None:
        return {name: REGISTERS[name].reset[0] for name in names}
    found = 1, len(maps.nodes), maps.map_begin, maps.map_shift, follow, maps.lens
    return dict(zip(names, found, strict=True))


def map_table(config: Config) -> MapTable | None:
    """Return the maps of a configuration, None where it has none.

    Raises:
        InputError: naming the configuration, if the file cannot be read, has too many maps, or they
            are not a power of two of the lens's steps apart.
    """
    maps = maps_for(config)
    if maps is None:
        return None
    source, step_mm = f"{config.source}: map.file", 1e-3 * config.focus.resolution_um
    nodes = maps.words()
    if not 2 <= len(nodes) <= pkg.MAP_COUNT:
        raise InputError(f"{source}: {len(nodes)} maps, there is room for 2 to {pkg.MAP_COUNT}")
    steps = maps.lens_step_mm / step_mm
    shift = round(math.log2(max(steps, 1.0)))
    if abs(steps - 2**shift) > 1e-6 * steps or shift >= 1 << pkg.MAP_SHIFT_WIDTH:
        raise InputError(
            f"{source}: its maps are {steps:g} steps of the lens apart; it takes a power of two"
        )
    focus_mm = config.map.focus_mm
    most = (1 << pkg.LENS_WIDTH) - 1
    begin, place = (  # of the motor, which stands at infinity_mm where infinity is in focus
        round((config.focus.infinity_mm + way) / step_mm)
        for way in (maps.lens_begin_mm, extension_mm(focus_mm, maps.focal_mm))
    )
    if not 0 <= begin <= most:
        raise InputError(
            f"{source}: its first map is at {begin} steps of the lens, not 0 to {most}"
        )
    return MapTable(
        nodes=nodes,
        filled=maps.filled,
        map_begin=begin,
        map_shift=shift,
        lens=min(max(place, 0), most),
    )
