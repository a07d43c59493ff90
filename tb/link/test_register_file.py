"""register_file, of the instrument and of odd shapes, against its twin: every answer, every port.

Both are whole generated modules with all their registers. A twin has its registers from the
generated Python, so this compares the two that ``scripts/registers.py`` makes of one description.
"""

import sys
from functools import cache
from types import ModuleType

import cocotb
import pytest
from harness import (
    EACH_VOLUME,
    PACKAGES,
    FallingEdge,
    Ports,
    as_integer,
    drive,
    generator,
    port,
    reset,
    rounds,
    simulate,
)

from vrscan.clocked.register_file import (
    LATENCY,
    SAMPLED,
    WORD_MASK,
    WRITABLE,
    WRITTEN,
    RegisterFile,
    Written,
)
from vrscan.data import link_pkg
from vrscan.engines.tools import repository_root
from vrscan.fixed.correction_map import READ_BACK
from vrscan.registers import register_map
from vrscan.registers.register_map import Window
from vrscan.registers.structs import Struct, of_registers

READ, CHECK, WRITE = link_pkg.ACCESS_READ, link_pkg.ACCESS_CHECK, link_pkg.ACCESS_WRITE
RESERVED = 3
OK = link_pkg.STATUS_OK
ODD = "odd_registers"


@EACH_VOLUME
@pytest.mark.parametrize("module", ["register_file", ODD])
def test_register_file(module: str, volume: str) -> None:
    package = repository_root() / "tb" / "devices" / f"{ODD}_pkg.sv"
    sources = [package] if module == ODD else None
    simulate(module, __file__, volume=volume, sources=sources)


def described(module: str) -> ModuleType:
    """Return the generated Python of a module's registers."""
    if module != ODD:
        return register_map
    if ODD in sys.modules:
        return sys.modules[ODD]
    sys.path.insert(0, str(repository_root() / "scripts"))
    import registers

    made = ModuleType(ODD)
    sys.modules[ODD] = made
    source = registers.register_map(registers.described(f"tb/devices/{ODD}.toml"))
    exec(compile(source, ODD, "exec"), made.__dict__)
    return made


@cache
def odd_struct(name: str) -> Struct:
    """Return a struct of odd_registers_pkg by the name of its type."""
    made = described(ODD)
    return of_registers(made.REGISTERS, made.WINDOWS)[name.removesuffix("_t")]


PACKAGES[f"{ODD}_pkg"] = odd_struct


@cache
def twin(made: ModuleType) -> RegisterFile:
    """Return the one twin: what a reset leaves, one test leaves to the next."""
    return RegisterFile(made.REGISTERS, made.WINDOWS, made.LOCKS)


@cache
def elsewhere(made: ModuleType) -> dict[tuple[str, int, int], int]:
    """Return what memories beside the registers hold, by table, bank and entry."""
    return {}


async def keep(dut, window: Window, held: dict[tuple[str, int, int], int]) -> None:
    """Be the memory of a table with two banks: it answers as ``correction_map``."""
    names = ("write", "access_bank", "index")
    write, bank, index = (port(dut, f"{window.name}_{name}_o") for name in names)
    node, back = port(dut, f"{window.fields[0].name}_o"), port(dut, f"{window.name}_read_i")
    coming = [0] * READ_BACK
    while True:
        place = window.name, as_integer(bank, signed=False), as_integer(index, signed=False)
        coming.append(held.get(place, 0))
        if as_integer(write, signed=False):
            held[place] = as_integer(node, signed=False)
        drive(back, coming[-1 - READ_BACK])
        await FallingEdge(dut.clk_i)


class Bus:
    """Does accesses on the RTL and on its twin, and compares answer, latency and every port."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.map = described(dut._name)
        self.draw = generator(len(self.map.REGISTERS))
        self.twin = twin(self.map)
        registers = list(self.map.REGISTERS.values())
        self.rw = [r for r in registers if r.access in WRITABLE]
        self.ro = [r for r in registers if r.access in ("ro", "counter")]
        self.outputs = Ports(dut, [f"{r.name}_o" for r in self.rw])
        self.shown: tuple[int, ...] = ()  # the twin's outputs,
        self.shown_of: dict[str, object] = {}  # and the values that these are of
        self.given = {r.name: (0,) * r.count if r.count > 1 else 0 for r in self.ro}
        self.inputs = {r.name: port(dut, f"{r.name}_i") for r in self.ro}
        strobes = {r.name: f"{r.name}_strobe_o" for r in self.rw if r.access == "strobe"}
        strobes |= {name: f"{name}_write_o" for name in self.map.WINDOWS}
        self.windows = {f: w for w in self.map.WINDOWS.values() for f in w.fields}
        self.copied = [w for w in self.map.WINDOWS.values() if w.commit and w.bank is None]
        self.strobe_names = list(strobes)
        self.strobes = Ports(dut, strobes.values())
        self.words = [(r.address + k, r) for r in registers for k in range(r.words)]
        self.cells = [
            (window.address + entry * window.stride + field.address, field)
            for window in self.map.WINDOWS.values()
            for entry in (0, 1, window.entries - 1)
            for field in window.fields
        ]

    async def free(self, window: Window) -> None:
        """Let the bus access the bank of a table that is not in use, where it has two."""
        if window.bank is not None and window.in_use is not None:
            (used,) = self.twin.active[window.in_use]
            address = self.map.REGISTERS[window.bank].address
            assert await self.access(WRITE, address, 1 - used) == (OK, 1 - used)

    def give_inputs(self) -> None:
        """Put other values on every input, often extreme ones."""
        for register in self.ro:
            values = tuple(self.legal(register) for _ in range(register.count))
            mask = (1 << register.width) - 1
            bits = sum((v & mask) << (k * register.width) for k, v in enumerate(values))
            drive(self.inputs[register.name], bits)
            self.given[register.name] = values if register.count > 1 else values[0]

    def legal(self, register) -> int:
        """Return a value that a register takes, one in four its least or its largest."""
        low, high = register.minimum, register.maximum
        if self.draw.random() < 0.25:
            return low if self.draw.random() < 0.5 else high
        return low + int.from_bytes(self.draw.bytes(9), "little") % (high - low + 1)

    def word_of(self, register, address: int) -> int:
        """Return a word of a legal value."""
        value = self.legal(register)
        if register.width > 32:
            value >>= 32 * ((address - register.address) % 2)
        return value & WORD_MASK

    def doubtful(self, register) -> int:
        """Return a word at or around a limit of a register, or anything."""
        low, high = register.minimum, register.maximum
        around = [low, low - 1, high, high + 1, high >> 32, (high >> 32) + 1, (low >> 32) - 1]
        around += [0, 1, WORD_MASK, 1 << 31, int(self.draw.integers(1 << 32))]
        around += [(1 << register.width) - 1, 1 << register.width, -(1 << register.width)]
        return int(around[self.draw.integers(len(around))]) & WORD_MASK

    def on_port(self, register) -> int:
        """Return what the twin has on a port."""
        mask = (1 << register.width) - 1
        values = self.twin.ports()[register.name]
        return sum((v & mask) << (k * register.width) for k, v in enumerate(values))

    def check_outputs(self, where: str) -> None:
        ports = self.twin.ports()
        if ports != self.shown_of:
            self.shown_of = {name: list(values) for name, values in ports.items()}
            self.shown = tuple(self.on_port(register) for register in self.rw)
        for register, got, want in zip(self.rw, self.outputs.read(), self.shown, strict=True):
            got &= (1 << register.width * register.count) - 1
            assert got == want, f"{where}: {register.name}_o is {got:#x}, want {want:#x}"

    def check_strobes(self, where: str, due: list[Written]) -> None:
        for name, got in zip(self.strobe_names, self.strobes.read(), strict=True):
            wanted = [one for one in due if one.name == name]
            assert got == len(wanted), f"{where}: strobe of {name}"
            if wanted and name in self.map.WINDOWS:
                entry = [as_integer(port(self.dut, f"{name}_index_o"), signed=False)]
                for field in self.map.WINDOWS[name].fields:
                    entry.append(as_integer(port(self.dut, f"{field.name}_o")))
                assert tuple(entry) == (wanted[0].entry, *wanted[0].values), f"{where}: {name}"

    async def access(
        self, access: int, address: int, data: int = 0, *, restless: bool = False
    ) -> tuple[int, int]:
        """Do one access and compare everything; with other inputs every clock if ``restless``."""
        where = f"access {access} at {address:#06x} with {data:#x}"
        before = len(self.twin.written)
        self.present(access, address, data)
        answer = (0, 0)
        for clock in range(1, LATENCY + 1):
            await FallingEdge(self.dut.clk_i)
            # Whatever is on the bus meanwhile is no access.
            self.present(int(self.draw.integers(4)), int(self.draw.integers(1 << 16)), WORD_MASK)
            self.dut.bus_valid_i.value = 0
            if clock == WRITTEN - 1:
                self.check_outputs(f"{where}, clock {clock}")
            if restless:
                self.give_inputs()
            if clock == (WRITTEN if access == WRITE else SAMPLED):
                self.twin.inputs.update(self.given)
                answer = self.twin.access(access, address, data)
            if clock == WRITTEN:
                self.check_outputs(f"{where}, clock {clock}")
            due = self.twin.written[before:] if clock == WRITTEN else []
            self.check_strobes(f"{where}, clock {clock}", due)
            assert int(self.dut.bus_done_o.value) == (clock == LATENCY), f"{where}, clock {clock}"
        got = (int(self.dut.bus_status_o.value), int(self.dut.bus_data_o.value))
        assert got == answer, f"{where}: answer {got}, want {answer}"
        return got

    def present(self, access: int, address: int, data: int) -> None:
        self.dut.bus_valid_i.value = 1
        self.dut.bus_access_i.value = access
        self.dut.bus_address_i.value = address
        self.dut.bus_data_i.value = data

    async def quiet(self, clocks: int) -> None:
        """Let some clocks go by without an access; nothing may happen."""
        self.dut.bus_valid_i.value = 0
        for _ in range(clocks):
            await FallingEdge(self.dut.clk_i)
            assert int(self.dut.bus_done_o.value) == 0
            self.check_strobes("no access", [])

    async def reset(self) -> None:
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        await FallingEdge(self.dut.clk_i)
        self.twin.reset()
        self.check_outputs("after a reset")
        self.check_strobes("after a reset", [])
        assert int(self.dut.bus_done_o.value) == 0

    async def write_whole(self, register, values: list[int]) -> None:
        """Write all words of a register."""
        each = register.words // register.count
        for k in range(register.words):
            data = values[k // each] >> (32 * (k % each)) & WORD_MASK
            assert await self.access(WRITE, register.address + k, data) == (OK, data)


async def new_bus(dut) -> Bus:
    await reset(dut)
    bus = Bus(dut)
    for window in bus.map.WINDOWS.values():
        if window.bank is not None:
            cocotb.start_soon(keep(dut, window, elsewhere(bus.map)))
    await bus.reset()
    return bus


@cocotb.test()
async def every_word_is_read_checked_and_written(dut) -> None:
    """Twice: a legal value, then one around a limit; between them a CHECK that changes nothing."""
    bus = await new_bus(dut)
    seen = set()
    places = [*bus.words, *bus.cells]
    bus.draw.shuffle(places)
    for address, register in places:
        if register.name in bus.map.LOCKS:
            continue
        if register in bus.windows:
            await bus.free(bus.windows[register])
        await bus.access(READ, address, restless=True)
        legal = bus.word_of(register, address)
        for data in [legal, *(bus.doubtful(register) for _ in range(rounds(3, 12)))]:
            await bus.access(CHECK, address, data)
            status, _ = await bus.access(WRITE, address, data)
            seen.add(status)
            assert status in (OK, link_pkg.STATUS_BAD_VALUE) or register.access not in WRITABLE
            if data == legal and register.access in WRITABLE:
                assert status == OK
        await bus.access(RESERVED, address, restless=True)
    assert seen == {OK, link_pkg.STATUS_READ_ONLY, link_pkg.STATUS_BAD_VALUE}
    held = {window.name for window in bus.copied}
    events = [name for name in bus.strobe_names if name not in held]
    assert len(bus.twin.written) > 2 * len(events)


@cocotb.test()
async def every_other_address_is_nothing(dut) -> None:
    """The words beside those that are mapped, their images in other pages, and random ones."""
    bus = await new_bus(dut)
    mapped = {address for address, _ in bus.words}
    for window in bus.map.WINDOWS.values():
        for k in range(window.entries):
            mapped |= {window.address + k * window.stride + f.address for f in window.fields}
    near = {a + step for a in mapped for step in (-1, 1)} - mapped
    near = set(sorted(near)[:300]) | {0x3FF, 0x400, 0x7FFF, 0x8000, 0xFFFF}
    images = {a ^ (1 << bit) for a, _ in bus.words for bit in range(10, 16)}
    cells = {a ^ (1 << bit) for a, _ in bus.cells for bit in range(16)}
    few = [int(a) for a in bus.draw.permutation(sorted(images))[:400]]
    few += [int(a) for a in bus.draw.permutation(sorted(cells))[:100]]
    few += [int(a) for a in bus.draw.integers(1 << 16, size=300)]
    nothing = 0
    for address in [*sorted(near), *few]:
        if not 0 <= address < 1 << 16:
            continue
        access = int(bus.draw.integers(3))
        status, _ = await bus.access(access, address, int(bus.draw.integers(8)))
        nothing += status == link_pkg.STATUS_NO_ADDRESS
        assert (status == link_pkg.STATUS_NO_ADDRESS) == (address not in mapped)
    assert nothing > 500


@cocotb.test()
async def random_traffic_with_locks_and_resets(dut) -> None:
    bus = await new_bus(dut)
    await bus.reset()
    names = {r.name: r for r in bus.rw}
    seen: dict[int, int] = {}
    places = [*bus.words, *bus.cells]
    count = rounds(1500, 10_000)
    for k in range(count):
        if k % 500 == 499:
            await bus.reset()
        elif k % 500 in (150, 300):
            lock = names[str(bus.draw.choice(bus.map.LOCKS))]
            await bus.access(WRITE, lock.address, 1)
        address, register = places[int(bus.draw.integers(len(places)))]
        access = int(bus.draw.choice([READ, CHECK, WRITE, WRITE, WRITE]))
        good = bus.draw.random() < 0.7
        data = bus.word_of(register, address) if good else bus.doubtful(register)
        status, _ = await bus.access(access, address, data, restless=k % 4 == 0)
        seen[status] = seen.get(status, 0) + 1
        if k % 10 == 0:
            await bus.quiet(int(bus.draw.integers(4)))
    print(f"answers by status: {seen}")
    assert min(seen[s] for s in (OK, link_pkg.STATUS_LOCKED, link_pkg.STATUS_BAD_VALUE)) > 25


@cocotb.test()
async def a_lock_takes_only_a_one_and_keeps_it_until_reset(dut) -> None:
    bus = await new_bus(dut)
    for name in bus.map.LOCKS:
        lock = bus.map.REGISTERS[name]
        kept = [r for r in bus.rw if r.lock == name]
        kept += [f for w in bus.map.WINDOWS.values() for f in w.fields if f.lock == name]
        for data in (0, 2, 3, WORD_MASK):
            status, _ = await bus.access(WRITE, lock.address, data)
            assert status == link_pkg.STATUS_BAD_VALUE
        assert await bus.access(CHECK, lock.address, 1) == (OK, 0)
        bases = {f.name: w.address + f.address for w in bus.map.WINDOWS.values() for f in w.fields}
        at = {r.name: bases.get(r.name, r.address) for r in kept}
        for register in kept:
            if register in bus.windows:
                await bus.free(bus.windows[register])
            data = bus.word_of(register, register.address)
            assert (await bus.access(WRITE, at[register.name], data))[0] == OK
        assert await bus.access(WRITE, lock.address, 1) == (OK, 1)
        others = [r for r in bus.rw if r.lock != name and r.name not in bus.map.LOCKS]
        for register in kept:
            for access in (CHECK, WRITE):
                for address in {at[register.name], at[register.name] + register.words - 1}:
                    data = bus.word_of(register, address)
                    assert (await bus.access(access, address, data))[0] == link_pkg.STATUS_LOCKED
            assert (await bus.access(READ, at[register.name]))[0] == OK
        for register in others[:5]:
            data = bus.word_of(register, register.address)
            assert (await bus.access(WRITE, register.address, data))[0] == OK
        assert (await bus.access(WRITE, lock.address, 0))[0] == link_pkg.STATUS_BAD_VALUE
        assert await bus.access(WRITE, lock.address, 1) == (OK, 1)
        await bus.reset()
        for register in kept:
            if register in bus.windows:
                await bus.free(bus.windows[register])
            data = bus.word_of(register, register.address)
            assert (await bus.access(WRITE, at[register.name], data))[0] == OK


@cocotb.test()
async def wide_registers_take_effect_in_one_clock(dut) -> None:
    bus = await new_bus(dut)
    wide = [r for r in bus.rw if r.width > 32]
    assert wide
    for register in wide:
        for _ in range(5):
            value = bus.legal(register)
            before = list(bus.twin.values[register.name])
            await bus.access(WRITE, register.address, value & WORD_MASK)
            assert bus.twin.values[register.name] == before
            # Another register's words may come between.
            await bus.access(WRITE, wide[0].address if register is not wide[0] else 0, 5)
            await bus.access(WRITE, register.address + 1, value >> 32 & WORD_MASK)
            assert bus.twin.values[register.name] == [value] or register is wide[0]
            await bus.write_whole(register, [value])
            assert bus.twin.values[register.name] == [value]
        await bus.access(WRITE, register.address, 123)
        await bus.reset()
        high = register.maximum >> 33
        await bus.access(WRITE, register.address + 1, high)  # with the lower word of the reset
        assert bus.twin.values[register.name] == [high << 32 | register.reset[0] & WORD_MASK]


@cocotb.test()
async def wide_inputs_are_never_torn(dut) -> None:
    """The inputs change in every clock; the two words are those of one of them."""
    bus = await new_bus(dut)
    wide = [r for r in bus.ro if r.width > 32]
    assert len(wide) >= 2
    for _ in range(rounds(6, 20)):
        for register in wide:
            _, low = await bus.access(READ, register.address, restless=True)
            value = bus.twin.inputs[register.name]
            # What is no READ of this lower word keeps nothing.
            other = wide[0] if register is not wide[0] else wide[1]
            await bus.access(CHECK, register.address, restless=True)
            await bus.access(READ, other.address, restless=True)
            await bus.access(READ, register.address ^ 1 << 10, restless=True)
            _, high = await bus.access(READ, register.address + 1, restless=True)
            assert high << 32 | low == value & (1 << 64) - 1


@cocotb.test()
async def a_table_keeps_its_entries(dut) -> None:
    """All entries in random order, field after field or not, then all are read back."""
    bus = await new_bus(dut)
    for window in bus.map.WINDOWS.values():
        await bus.free(window)
        entries = [int(k) for k in bus.draw.permutation(window.entries)[:200]]
        for field in window.fields[:-1]:  # of many entries before the first is complete
            for k in entries[:40]:
                address = window.address + k * window.stride + field.address
                await bus.access(WRITE, address, bus.legal(field) & WORD_MASK)
        assert not [one for one in bus.twin.written if one.name == window.name]
        for k in entries[:40]:
            field = window.fields[-1]
            address = window.address + k * window.stride + field.address
            await bus.access(WRITE, address, bus.legal(field) & WORD_MASK)
        for k in entries[40:]:
            for field in window.fields:
                address = window.address + k * window.stride + field.address
                await bus.access(WRITE, address, bus.legal(field) & WORD_MASK)
        events = [one for one in bus.twin.written if one.name == window.name]
        assert len(events) == (0 if window in bus.copied else len(entries))
        await bus.reset()
        await bus.free(window)
        for k in entries:
            for field in window.fields:
                address = window.address + k * window.stride + field.address
                status, data = await bus.access(READ, address)
                assert status == OK
                stored = bus.twin._tables[window.name, field.address][bus.twin._at(window, k)]
                assert data == stored & WORD_MASK


@cocotb.test()
async def what_waits_goes_out_with_a_commit(dut) -> None:
    """Written values stay inside, cannot be written while a commit waits, and leave together."""
    bus = await new_bus(dut)
    held = [r for r in bus.rw if r.commit]
    tables, banked = bus.copied, [w for w in bus.map.WINDOWS.values() if w.bank is not None]
    assert held and tables and banked
    others = [r for r in bus.rw if not r.commit and r.name not in bus.map.LOCKS]
    waiting, copy, take = dut.waiting_i, dut.copy_i, dut.take_i
    for bank in (0, 1, 0):
        dut.bank_i.value = bank
        for register in (held[int(k)] for k in bus.draw.integers(len(held), size=40)):
            for k in range(register.words):
                at = register.address + k
                await bus.access(WRITE, at, bus.word_of(register, at))
        for window in tables:
            assert port(dut, f"{window.name}_changed_o").integer() == bus.twin.changed[window.name]
            for entry in (0, window.entries - 1):
                for field in window.fields:
                    at = window.address + entry * window.stride + field.address
                    await bus.access(WRITE, at, bus.legal(field) & WORD_MASK)
            assert port(dut, f"{window.name}_changed_o").integer() == 1
        waiting.value, bus.twin.waiting = 1, True
        for register in (held[0], held[-1], others[0], bus.map.REGISTERS["commit"]):
            status, _ = await bus.access(WRITE, register.address, bus.legal(register) & WORD_MASK)
            refused = register.commit or register.name == "commit"
            assert (status == link_pkg.STATUS_BUSY) == refused
            assert (await bus.access(READ, register.address))[0] == OK
        for window in [*tables, *banked]:
            for access in (READ, CHECK, WRITE):
                assert (await bus.access(access, window.address))[0] == link_pkg.STATUS_BUSY
        # Every entry, then what leaves with it two clocks later.
        most = max(window.entries for window in tables)
        for k in range(most + 2):
            copy.value, dut.copy_index_i.value = k < most, k % most
            await FallingEdge(dut.clk_i)
            for window in tables:
                write = port(dut, f"{window.name}_write_o").integer()
                assert write == (k >= 1) if k <= most else not write
                if write:
                    entry = (k - 1) % window.entries
                    assert port(dut, f"{window.name}_index_o").integer() == entry
                    assert port(dut, f"{window.name}_write_bank_o").integer() == 1 - bank
                    assert port(dut, f"{window.name}_bank_o").integer() == bank
                    for field in window.fields:
                        want = bus.twin._tables[window.name, field.address][entry]
                        assert as_integer(port(dut, f"{field.name}_o")) == want
        bus.check_outputs("before the commit")
        take.value = 1
        await FallingEdge(dut.clk_i)
        take.value = 0
        bus.check_outputs("a clock after take")
        await FallingEdge(dut.clk_i)
        bus.twin.take()
        bus.check_outputs("two clocks after take")
        assert not any(port(dut, f"{window.name}_changed_o").integer() for window in tables)
        waiting.value, bus.twin.waiting = 0, False


@cocotb.test()
async def a_bank_in_use_is_not_written(dut) -> None:
    """It is read, and nothing of it changes; a bank is in use from its commit on."""
    bus = await new_bus(dut)
    for window in (w for w in bus.map.WINDOWS.values() if w.bank is not None):
        field = window.fields[0]
        bank, in_use = (bus.map.REGISTERS[name].address for name in (window.bank, window.in_use))
        for used in (0, 1, 1, 0):
            await bus.access(WRITE, in_use, used)
            for accessed in (0, 1):  # what waits is not in use yet
                await bus.access(WRITE, bank, accessed)
                status, _ = await bus.access(WRITE, window.address, bus.word_of(field, 0))
                assert (status == OK) == ([accessed] != bus.twin.active[window.in_use])
            dut.take_i.value = 1
            await FallingEdge(dut.clk_i)
            dut.take_i.value = 0
            await FallingEdge(dut.clk_i)
            bus.twin.take()
            for accessed in (1, 0):
                await bus.access(WRITE, bank, accessed)
                _, held = await bus.access(READ, window.address)
                for access in (CHECK, WRITE):
                    data = bus.word_of(field, 0)
                    status, _ = await bus.access(access, window.address, data)
                    assert status == (link_pkg.STATUS_BUSY if accessed == used else OK)
                kept = held if accessed == used else data
                assert await bus.access(READ, window.address) == (OK, kept)


@cocotb.test()
async def reset_at_every_moment_of_an_access(dut) -> None:
    """The access is forgotten; all is as after a reset, but for tables, which stay."""
    bus = await new_bus(dut)
    written = [r for r in bus.rw if r.name not in bus.map.LOCKS]
    strobed = [r for r in written if r.access == "strobe"]
    wide = [r for r in written if r.width > 32]
    fields = [
        (window.address + window.stride + field.address, field)
        for window in bus.map.WINDOWS.values()
        for field in window.fields
    ]
    banked = [w for w in bus.map.WINDOWS.values() if w.bank is not None]
    for age in range(1, LATENCY + 1):
        some = [written[age], strobed[0], wide[0]]
        places = [*((r.address + r.words - 1, r) for r in some), (wide[0].address, wide[0])]
        for address, register in [*places, *fields]:
            for window in banked:
                await bus.free(window)
            for other in written[:3]:
                data = bus.word_of(other, other.address)
                await bus.access(WRITE, other.address, data)
            await bus.access(WRITE, address, bus.word_of(register, address))
            data = bus.word_of(register, address)
            bus.present(WRITE, address, data)
            for clock in range(1, age):
                await FallingEdge(dut.clk_i)
                dut.bus_valid_i.value = 0
                if clock == WRITTEN - 1:  # then it will be written before the reset works
                    bus.twin.access(WRITE, address, data)
            # An access that comes with the reset is none.
            bus.present(WRITE, address, data)
            await bus.reset()
            await bus.quiet(LATENCY + 2)
            bus.check_outputs(f"reset at age {age}")
            for beside in {address, register.address} if register in some else {address}:
                await bus.access(READ, beside)
            for k in range(3):
                await bus.access(READ, written[k].address)


@cocotb.test()
async def an_access_before_the_answer_is_ignored(dut) -> None:
    bus = await new_bus(dut)
    registers = [r for r in bus.rw if r.name not in bus.map.LOCKS and r.words == 1]
    for age in range(1, LATENCY):
        first, second = (registers[k % len(registers)] for k in (age, age + 1))
        data = bus.word_of(first, first.address)
        bus.present(WRITE, first.address, data)
        for clock in range(1, LATENCY + 1):
            await FallingEdge(dut.clk_i)
            dut.bus_valid_i.value = 0
            if clock == age:
                bus.present(WRITE, second.address, bus.word_of(second, second.address))
            assert int(dut.bus_done_o.value) == (clock == LATENCY)
        answer = bus.twin.access(WRITE, first.address, data)
        assert (int(dut.bus_status_o.value), int(dut.bus_data_o.value)) == answer
        bus.check_outputs(f"an access {age} clocks after another")
        await bus.quiet(LATENCY + 1)


def test_the_twin_answers_and_remembers() -> None:
    """By hand, on the instrument's registers: what no other code works out."""
    twin = RegisterFile()
    assert twin.access(READ, 0) == (OK, 0x56525343)
    assert twin.access(WRITE, 0, 1) == (link_pkg.STATUS_READ_ONLY, 0)
    at = {name: register.address for name, register in register_map.REGISTERS.items()}
    assert twin.access(WRITE, at["min_width"], 2) == (link_pkg.STATUS_BAD_VALUE, 0)
    assert twin.access(WRITE, at["min_width"], 4) == (OK, 4)
    assert twin.access(WRITE, at["k1"], 0xFFFF_FFFE) == (OK, 0xFFFF_FFFE)
    assert twin.values["k1"] == [-2]
    assert twin.access(WRITE, at["k1"], 0x0200_0000) == (link_pkg.STATUS_BAD_VALUE, 0)
    assert twin.access(WRITE, at["k1"], 0x03FF_FFFF) == (link_pkg.STATUS_BAD_VALUE, 0)

    assert twin.access(WRITE, at["sweep_word"], 7) == (OK, 7)
    assert twin.values["sweep_word"] == [0]
    assert twin.access(WRITE, at["sweep_word"] + 1, 0x100) == (link_pkg.STATUS_BAD_VALUE, 0)
    assert twin.access(WRITE, at["sweep_word"] + 1, 0xFF) == (OK, 0xFF)
    assert twin.values["sweep_word"] == [0xFF_0000_0007]

    twin.inputs["uptime"] = 0x1234_FFFF_FFFF
    assert twin.access(READ, at["uptime"]) == (OK, 0xFFFF_FFFF)
    twin.inputs["uptime"] = 0x1235_0000_0000
    assert twin.access(READ, at["uptime"] + 1) == (OK, 0x1234)

    table = register_map.WINDOWS["table"].address
    assert twin.access(WRITE, table + 10, 99) == (OK, 99)
    assert twin.written == []
    assert twin.access(WRITE, table + 11, 0xFFFF_FFFF) == (OK, 0xFFFF_FFFF)
    assert twin.written == []
    assert twin.changed == {"table": True, "free_table": False}
    assert twin.ports()["k1"] == list(register_map.REGISTERS["k1"].reset)
    twin.take()
    assert twin.ports()["k1"] == [-2]
    focus = register_map.WINDOWS["focus_table"].address
    assert twin.access(WRITE, focus + 3, 7) == (OK, 7)
    assert twin.written == [Written("focus_table", 3, (7,))]
    twin.waiting = True
    assert twin.access(WRITE, at["k1"], 0) == (link_pkg.STATUS_BUSY, 0)
    assert twin.access(WRITE, at["commit"], 1) == (link_pkg.STATUS_BUSY, 0)
    assert twin.access(READ, at["k1"]) == (OK, 0xFFFF_FFFE)
    assert twin.access(READ, table + 10) == (link_pkg.STATUS_BUSY, 0)
    twin.waiting = False

    assert twin.access(WRITE, at["lock_calibration"], 0) == (link_pkg.STATUS_BAD_VALUE, 0)
    assert twin.access(WRITE, at["lock_calibration"], 1) == (OK, 1)
    assert twin.access(WRITE, table + 10, 98) == (link_pkg.STATUS_LOCKED, 0)
    assert twin.access(WRITE, at["k1"], 0) == (link_pkg.STATUS_LOCKED, 0)
    twin.reset()
    assert twin.access(READ, table + 11) == (OK, 0xFFFF_FFFF)
    assert twin.access(WRITE, at["k1"], 0) == (OK, 0)
