"""The registers over AXI4-Lite by name, on the twin of the registers and in a mapped file."""

from pathlib import Path

import pytest
from scanners import EACH_SCANNER, SCANNERS

from vrscan.clocked.register_file import RegisterFile
from vrscan.data import link_pkg
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.link.axi import MAP_BYTES, WORD_BYTES, AxiDevice, BusError
from vrscan.link.register_host import DeviceError
from vrscan.registers.register_map import MAP_HASH, REGISTERS


class TwinWords:
    """The registers' twin as memory; a commit takes effect at the next access.

    Args:
        told: Whether an error says why.
        config: The scanner that it is built for.
    """

    def __init__(self, told: bool = True, config: Config = SCANNERS["default"]) -> None:
        self.file, sensor = RegisterFile(), config.sensor
        self.file.inputs |= {"clock_hz": 100_000_000, "line_length": sensor.line_length}
        self.file.inputs |= {"pixel_width": sensor.pixel_width}
        self.file.inputs |= {"max_window": 255, "lanes": 1, "index_oversample": 4}
        self.writes = 0
        self._told = told

    def _access(self, access: int, address: int, word: int = 0) -> int:
        status, found = self.file.access(access, address, word)
        if status != link_pkg.STATUS_OK:
            raise BusError(status if self._told else None)
        if any(event.name == "commit" for event in self.file.written):
            self.file.written.clear()
            self.file.take()
        return found

    def read(self, address: int) -> int:
        return self._access(link_pkg.ACCESS_READ, address)

    def write(self, address: int, word: int) -> None:
        self.writes += 1
        self._access(link_pkg.ACCESS_WRITE, address, word)


@EACH_SCANNER
def test_a_configuration_is_loaded_and_committed(config: Config) -> None:
    """What the registers then hold is what the serial line's host writes of it."""
    words = TwinWords(config=config)
    device = AxiDevice(words)
    device.load(config)
    wanted = device.settings(config)
    for name in [name for name in wanted if name in REGISTERS]:
        held = words.file.ports()[name]
        assert (tuple(held) if len(held) > 1 else held[0]) == wanted[name], name
        assert device.read(name) == wanted[name]
    assert device.read_scaled("focus_address") == wanted["focus_address"]
    device.registers.scratch = 77
    assert device.registers["scratch"] == 77


@pytest.mark.parametrize("told", [True, False])
def test_what_would_be_refused_is_not_tried(told: bool) -> None:
    """A lock and the map tell it; the error names register and value."""
    words = TwinWords(told)
    device = AxiDevice(words)
    device.lock("laser")
    before = words.writes
    locked = next(n for n, r in REGISTERS.items() if r.lock == "lock_laser" and r.count == 1)
    with pytest.raises(DeviceError, match=f"AXI: {locked} = .*LOCKED"):
        device.write(locked, REGISTERS[locked].minimum)
    device.lock("calibration")
    with pytest.raises(DeviceError, match="LOCKED"):
        device.write_many([("table_amplitude", (0,) * 1024), ("table_midpoint", (0,) * 1024)])
    with pytest.raises(InputError):
        device.write("scratch", 1 << 32)
    with pytest.raises(DeviceError, match="identity = 3: READ_ONLY"):
        device.write_words(type_of_block("identity", [3]))
    assert words.writes == before + 1  # the second lock


def type_of_block(name: str, words: list[int]):
    from vrscan.registers.values import Block

    return Block(REGISTERS[name].address, words)


def test_what_the_bus_refuses_is_told() -> None:
    """Where the map does not tell it: while a commit waits, with the status and without."""
    for told, why in ((True, "BUSY"), (False, "the bus answers with an error")):
        words = TwinWords(told)
        device = AxiDevice(words)
        words.file.waiting = True
        with pytest.raises(InputError, match=f"AXI: k_noise = 640: {why}"):
            device.write("k_noise", 640)


def test_another_instrument_is_refused() -> None:
    words = TwinWords()
    words.read = lambda address: 0
    with pytest.raises(InputError, match="AXI: no scanner"):
        AxiDevice(words)


def test_a_file_is_mapped(tmp_path: Path) -> None:
    """Words lie in it by the byte addresses of the slave."""
    file = tmp_path / "uio0"
    memory = bytearray(MAP_BYTES)
    for name, word in (("identity", REGISTERS["identity"].reset[0]), ("map_hash", MAP_HASH)):
        at = WORD_BYTES * REGISTERS[name].address
        memory[at : at + WORD_BYTES] = word.to_bytes(WORD_BYTES, "little")
    file.write_bytes(memory)
    with AxiDevice.mapped(str(file)) as device:
        device.write("scratch", 0x12345678)
    at = WORD_BYTES * REGISTERS["scratch"].address
    assert file.read_bytes()[at : at + WORD_BYTES] == bytes.fromhex("78563412")
    with pytest.raises(InputError, match="nothing: cannot map its registers"):
        AxiDevice.mapped(str(tmp_path / "nothing"))
