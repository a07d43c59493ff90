"""The registers' one description: what it refuses, and that it is complete and its page fresh."""

import importlib
import re
import sys
from pathlib import Path

import pytest

from vrscan.data import link_pkg, pkg
from vrscan.data.config import load
from vrscan.data.errors import InputError
from vrscan.engines.tools import repository_root, rtl_modules
from vrscan.registers.chain_registers import Registers
from vrscan.registers.register_map import LOCKS, MAP_HASH, REGISTERS, WINDOWS

SCRIPTS = repository_root() / "scripts"


sys.path.insert(0, str(SCRIPTS))  # as for a script of that folder
generate = importlib.import_module("generate")
registers = importlib.import_module("registers")

SMALL = """
locks_address = 0x3F0

[locks]
lock_it = "it"

[groups.one]
address = 0
access = "rw"
doc = "One"
[groups.one.registers]
alpha = { width = 8, doc = "a" }
beta = { width = 40, lock = "lock_it", doc = "b" }

[groups.two]
address = 16
access = "ro"
doc = "Two"
[groups.two.registers]
gamma = { width = 4, doc = "c" }

[windows.list]
address = 0x400
entries = 8
doc = "List"
[windows.list.fields]
item = { width = 32, doc = "d" }
"""


def parsed(folder: Path, text: str):
    path = folder / "some.toml"
    path.write_text(text)
    return registers.parse(path)


def test_addresses_follow_each_other(tmp_path: Path) -> None:
    made = parsed(tmp_path, SMALL)
    assert [(r.name, r.address, r.words) for r in made.registers] == [
        ("alpha", 0, 1),
        ("beta", 1, 2),
        ("gamma", 16, 1),
        ("lock_it", 0x3F0, 1),
    ]
    assert (made.windows[0].stride, made.windows[0].bits) == (1, 3)


BAD = {
    # name: (what of SMALL, instead of it, the complaint)
    "no_toml": ("[groups.one]", "[groups.one", "not a TOML file"),
    "unknown_key_of_a_register": (
        'alpha = { width = 8, doc = "a" }',
        'alpha = { width = 8, wdith = 9, doc = "a" }',
        "unknown key groups.one.registers.alpha.wdith (9)",
    ),
    "unknown_key_of_a_group": (
        'doc = "One"',
        'doc = "One"\nbase = 3',
        "unknown key groups.one.base (3)",
    ),
    "unknown_key_of_a_field": (
        'item = { width = 32, doc = "d" }',
        'item = { width = 32, doc = "d", reset = 1 }',
        "unknown key windows.list.fields.item.reset (1)",
    ),
    "unknown_table": ("[locks]", "[tables]\n[locks]", "unknown key tables ({})"),
    "no_width": ("alpha = { width = 8, doc", "alpha = { doc", "groups.one.registers.alpha"),
    "no_doc": ('width = 4, doc = "c"', "width = 4", "groups.two.registers.gamma"),
    "not_the_type": (
        'beta = { width = 40, lock = "lock_it", doc = "b" }',
        'beta = { width = 40, signed = 1, doc = "b" }',
        "groups.one.registers.beta.signed = 1",
    ),
    "float_width": ("width = 8", "width = 8.0", "groups.one.registers.alpha.width"),
    "a_bad_name": ("alpha =", "Alpha =", "groups.one.registers.Alpha"),
    "an_unknown_access": ('access = "ro"', 'access = "wo"', "groups.two.access = 'wo'"),
    "an_unknown_width": (
        "width = 8",
        'width = "WirdWidth"',
        "group one, register alpha: width = 'WirdWidth': no localparam of this name",
    ),
    "width_0": ("width = 8", "width = 0", "group one, register alpha: width 0 is not 1 to 64"),
    "width_65": ("width = 40", "width = 65", "group one, register beta: width 65 is not 1 to 64"),
    "several_wide": ("width = 40,", "width = 40, count = 2,", "group one, register beta: count 2"),
    "count_0": ("width = 8,", "width = 8, count = 0,", "group one, register alpha: count 0"),
    "no_access": (
        'access = "rw"\n',
        "",
        "group one, register alpha: access is missing, here and in the group",
    ),
    "name_twice_in_a_group": ("beta =", "alpha =", "not a TOML file"),
    "name_twice": (
        "gamma =",
        "alpha =",
        "group two, register alpha: the name alpha is taken by group one, register alpha",
    ),
    "name_of_a_lock": (
        "gamma =",
        "lock_it =",
        "group locks, register lock_it: the name lock_it is taken by group two, register lock_it",
    ),
    "name_of_a_strobe": (
        'alpha = { width = 8, doc = "a" }\nbeta =',
        'alpha = { width = 8, access = "strobe", doc = "a" }\nalpha_strobe =',
        "group one, register alpha_strobe: the name alpha_strobe is taken by group one, register",
    ),
    "name_of_a_field": (
        "gamma =",
        "list_item =",
        "window list: the name list_item is taken by group two, register list_item",
    ),
    "name_of_the_clock": ("alpha =", "clk =", "group one, register clk: the name clk is taken by"),
    "name_of_a_keyword": ("alpha =", "time =", "group one, register time: the name time is taken"),
    "name_of_a_struct": (
        "[groups.two]\naddress = 16\naccess = \"ro\"\ndoc = \"Two\"\n[groups.two.registers]",
        "[groups.list]\naddress = 16\naccess = \"ro\"\ndoc = \"Two\"\n[groups.list.registers]",
        "window list: the struct list is taken by group list",
    ),
    "overlap": (
        "address = 16",
        "address = 2",
        "group two, register gamma: address 0x0002 is taken by group one, register beta",
    ),
    "overlap_with_the_locks": (
        "locks_address = 0x3F0",
        "locks_address = 16",
        "group locks, register lock_it: address 0x0010 is taken by group two, register gamma",
    ),
    "behind_the_locks": (
        "locks_address = 0x3F0",
        "locks_address = 15",
        "locks_address: a register follows the locks without a gap",
    ),
    "beyond_the_end": ("address = 16", "address = 0x400", "group two, register gamma: ends above"),
    "wide_beyond_the_end": (
        "address = 0\n",
        "address = 0x3FE\n",
        "group one, register beta: ends above 0x03ff",
    ),
    "locks_beyond_the_end": ("= 0x3F0", "= 0x400", "locks_address: ends above 0x03ff"),
    "an_unknown_lock": (
        'lock = "lock_it"',
        'lock = "lock_that"',
        "group one, register beta: lock = 'lock_that': there is no such lock",
    ),
    "an_unknown_lock_of_a_group": (
        'access = "ro"',
        'access = "ro"\nlock = "lock_that"',
        "group two: lock = 'lock_that': there is no such lock",
    ),
    "an_unknown_lock_of_a_window": (
        "entries = 8",
        'entries = 8\nlock = "lock_that"',
        "window list: lock = 'lock_that': there is no such lock",
    ),
    "min_above_max": (
        "width = 8,",
        "width = 8, min = 9, max = 8,",
        "group one, register alpha: min 9 to max 8 is not within 8 bits",
    ),
    "max_beyond_the_width": (
        "width = 8,",
        "width = 8, max = 256,",
        "group one, register alpha: min 0 to max 256 is not within 8 bits",
    ),
    "min_beyond_a_sign": (
        "width = 32,",
        "width = 8, signed = true, min = -129,",
        "window list, field item: min -129 to max 127 is not within 8 bits",
    ),
    "range_of_a_wide_one": (
        "width = 40,",
        "width = 40, max = 5,",
        "group one, register beta: min and max need at most 32 bits",
    ),
    "reset_out_of_range": (
        "width = 8,",
        "width = 8, reset = 256,",
        "group one, register alpha: reset 256 is not within 0 to 255",
    ),
    "reset_of_no_configuration": (
        "width = 8,",
        'width = 8, reset = "config",',
        'group one, register alpha: reset = "config": the configuration has no such register',
    ),
    "reset_of_an_input": (
        "width = 4,",
        "width = 4, reset = 1,",
        "group two, register gamma: reset, lock, min and max are for what can be written",
    ),
    "lock_of_an_input": (
        "width = 4,",
        'width = 4, lock = "lock_it",',
        "group two, register gamma: reset, lock, min and max are for what can be written",
    ),
    "a_constant_without_a_value": (
        "width = 4,",
        'width = 4, access = "constant",',
        "group two, register gamma: value is for a constant, and a constant has one",
    ),
    "a_value_of_no_constant": (
        "width = 4,",
        "width = 4, value = 3,",
        "group two, register gamma: value is for a constant, and a constant has one",
    ),
    "a_constant_that_does_not_fit": (
        "width = 4,",
        'width = 4, access = "constant", value = 16,',
        "group two, register gamma: value 16 is not within 0 to 15",
    ),
    "a_wide_strobe": (
        "width = 40,",
        'width = 40, access = "strobe",',
        "group one, register beta: a strobe is one word",
    ),
    "a_wide_field": ("width = 32,", "width = 33,", "window list, field item: width 33 is not 1 to"),
    "a_window_at_no_multiple": (
        "address = 0x400",
        "address = 0x404",
        "window list: address 0x0404 is not a multiple of 0x8",
    ),
    "a_window_among_the_registers": (
        "address = 0x400",
        "address = 0x3F8",
        "window list: address 0x03f8 is not a multiple of 0x8 from 0x400",
    ),
    "a_window_of_one": ("entries = 8", "entries = 1", "windows.list.entries = 1"),
    "a_window_on_another": (
        "[windows.list]",
        '[windows.other]\naddress = 0x400\nentries = 3\ndoc = ""\n'
        '[windows.other.fields]\nx = { width = 1, doc = "" }\n[windows.list]',
        "window list: 0x0400 is taken by window other",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_description_is_one_line_that_says_where(tmp_path: Path, name: str) -> None:
    old, new, words = BAD[name]
    assert SMALL.count(old) == 1
    with pytest.raises(InputError) as error:
        parsed(tmp_path, SMALL.replace(old, new))
    text = str(error.value)
    assert text.startswith(f"{tmp_path / 'some.toml'}: ")
    assert words in text
    assert "\n" not in text


def test_a_missing_description_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.toml: No such file"):
        registers.parse(tmp_path / "none.toml")


def test_the_hash_is_of_what_a_host_has_to_know(tmp_path: Path) -> None:
    first = parsed(tmp_path, SMALL).hash
    assert parsed(tmp_path, SMALL.replace('doc = "a"', 'doc = "else"')).hash == first
    assert parsed(tmp_path, SMALL.replace("width = 8,", "width = 8, reset = 1,")).hash == first
    for old, new in [
        ("width = 8", "width = 9"),
        ("alpha", "alpine"),
        ("address = 16", "address = 17"),
        ("address = 0x400", "address = 0x408"),
        ("width = 8,", "width = 8, max = 254,"),
        ("width = 8,", "width = 8, signed = true,"),
        ("width = 8,", 'width = 8, lock = "lock_it",'),
        ("width = 8,", "width = 8, fraction = 1,"),
        ("width = 32,", "width = 31,"),
        ('access = "ro"', 'access = "counter"'),
    ]:
        assert parsed(tmp_path, SMALL.replace(old, new)).hash != first, new


def test_the_python_is_the_description() -> None:
    made = registers.described()
    assert MAP_HASH == made.hash == REGISTERS["map_hash"].reset[0]
    assert REGISTERS["identity"].address == 0
    assert [r.address for r in REGISTERS.values()] == [r.address for r in made.registers]
    assert made.locks == LOCKS
    field = WINDOWS["table"].fields[1]
    assert (field.name, field.address, field.width, field.signed) == (
        "table_midpoint",
        1,
        pkg.MIDPOINT_WIDTH,
        True,
    )
    word = REGISTERS["sweep_word"]
    assert (word.words, word.width, word.fraction) == (2, pkg.WORD_WIDTH, pkg.TURN_WIDTH)
    shipped = Registers.from_config(load(None))
    for name in ("k_noise", "centre", "n1", "min_width"):
        assert REGISTERS[name].reset == (getattr(shipped, name),), name


def test_no_command_of_locks_reaches_another_register() -> None:
    addresses = {r.address + k for r in REGISTERS.values() for k in range(r.words)}
    last = max(REGISTERS[name].address for name in LOCKS)
    assert last + 1 not in addresses
    assert {REGISTERS[name].address for name in LOCKS} == set(
        range(last - len(LOCKS) + 1, last + 1)
    )


# ---- complete ----


def test_every_setting_is_used() -> None:
    """As a field of its struct, in some module besides the register file."""
    code = "".join(
        re.sub(r"//.*", "", module.read_text())
        for module in rtl_modules()
        if module.stem != "register_file"
    )
    used = set(re.findall(r"\w\.(\w+)", code))
    settings = [r for r in REGISTERS.values() if r.access != "constant"]
    fields = [field for window in WINDOWS.values() for field in window.fields]
    kept = {"scratch", "map_access_bank", "length_unit", *LOCKS}  # of register file and host
    assert {one.name for one in [*settings, *fields]} - used == kept


def test_words_fit_the_bus() -> None:
    addresses = [r.address + k for r in REGISTERS.values() for k in range(r.words)]
    addresses += [
        w.address + k * w.stride + f.address
        for w in WINDOWS.values()
        for k in range(w.entries)
        for f in w.fields
    ]
    assert len(addresses) == len(set(addresses))
    assert min(addresses) == 0 and max(addresses) < 2**link_pkg.ADDRESS_WIDTH


# ---- fresh ----


def test_what_is_generated_is_fresh() -> None:
    targets = [name for name in generate.TARGETS if "register" in name]
    assert len(targets) >= 4
    for name in targets:
        assert (repository_root() / name).read_text() == generate.TARGETS[name](), name


def test_the_page_lists_every_register_once() -> None:
    page = (repository_root() / "docs/registers.md").read_text()
    for register in REGISTERS.values():
        name = register.name if register.count == 1 else f"{register.name}[{register.count}]"
        row = rf"^\| 0x{register.address:04X}(\.\.\w+)? \| `{re.escape(name)}` \|"
        assert len(re.findall(row, page, re.MULTILINE)) == 1, name
    for lock in LOCKS:
        assert re.search(rf"^\| 0x\w+ \| `{lock}` \| rw \|", page, re.MULTILINE)
    for window in WINDOWS.values():
        assert f"## Table {window.name}" in page
