"""The virtual board: ``vrscan`` in Verilator, with mirror, sensor and lens, on a serial port.

A host uses it like a real one, by the path of its port. Its time is its own: a second of the board
takes minutes here, so a program that waits for it should count the board's clocks.
"""

import contextlib
import json
import math
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.points import check_writable
from vrscan.engines.hardware import Hardware
from vrscan.engines.mirror_engine import polygon_parameters
from vrscan.engines.tools import build_folder, hardware_root
from vrscan.engines.verilated import build_program
from vrscan.scene.description import load
from vrscan.scene.index_diode import IndexDiode
from vrscan.scene.library import library
from vrscan.scene.timeline import series

CLOCK_HZ = 100e6  # of a configuration that gives none: enough for the shipped line rate
_START_S, _STOP_S = 60.0, 20.0  # longest time of a start and of an end


def on_board(config: Config) -> Config:
    """Return the configuration with the virtual board's clock, unless it gives its own."""
    if "frequency_hz" in config.clock.model_fields_set:
        return config
    clock = config.clock.model_copy(update={"frequency_hz": CLOCK_HZ})
    changed = config.model_copy(update={"clock": clock})
    changed._source = config._source
    return changed


def build(config: Config, *, loaded: bool = False) -> Path:
    """Return the program of the board; it is built if a source or a parameter has changed.

    Args:
        config: The instrument.
        loaded: Whether its registers begin as a load of the configuration would leave them.

    Raises:
        InputError: if a tool is missing or fails.
    """
    hardware = Hardware.of(config)
    clock_hz, mems, mirror, focus = (
        config.clock.frequency_hz,
        config.mems,
        config.mirror,
        config.focus,
    )
    resolution_mm = 1e-3 * focus.resolution_um
    diode = IndexDiode.of(config)
    parameters: dict[str, int | float] = {
        **hardware.parameters,
        "NaturalHz": mems.natural_hz,
        "Quality": mems.quality,
        "Torque": mems.torque,
        "CombRad": math.radians(mems.comb_deg),
        "Bias": mems.asymmetry,
        "MarkRad": math.radians(mirror.index_deg),
        "DiodeRad": diode.width_rad,
        "BeamRad": diode.beam_rad,
        "AmbientMw": diode.ambient_mw,
        "ThresholdMw": diode.threshold_mw,
        "ThresholdShare": diode.threshold_share,
        "HoldS": diode.hold_s,
        "MwPerLevel": config.laser.rated_mw / config.laser.power_max,
        "NoiseRad": 1e-6 * mems.noise_urad,
        "JitterS": 1e-9 * mems.jitter_ns,
        "FocusAddress": focus.address,
        "FocusM3": int(focus.motor == "m3"),
        "FocusTravel": round(focus.travel_mm / resolution_mm),
        "FocusStepClks": max(1, round(clock_hz * resolution_mm / focus.speed_mm_per_s)),
        **polygon_parameters(config),
    }
    folder = hardware_root() / "tb" / "board"
    others = [hardware.register_package(config)] if loaded else []
    return build_program(folder / "board.sv", parameters, folder / "main.cpp", others)


def make_folder(port: Path) -> None:
    """Make the folder of a port if it does not exist.

    Raises:
        InputError: if it cannot be made, or nothing can be written there.
    """
    try:
        port.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{port.parent}: cannot make the folder ({error.strerror})") from error
    check_writable(status_file(port))


def status_file(port: Path) -> Path:
    """Return the file with the status of the board behind a port."""
    return port.with_name(f"{port.name}.json")


def command(
    scene: str,
    config: Config,
    port: Path,
    *,
    swinging: bool = False,
    seconds: float | None = None,
    real_time: bool = False,
    seed: int = 1,
    late_lines: float | None = None,
    loaded: bool = False,
    rest_deg: float = 0.0,
    progress: Callable[[int], None] | None = None,
) -> list[str]:
    """Return the command that runs a board, after making the files that it needs.

    Args:
        scene: A shipped scene or a file.
        config: The instrument; its clock is the board's.
        port: The symbolic link to the serial port.
        swinging: Whether the mirror swings, from the drive's first pulse on, as where the loop
            comes to rest; otherwise it is still.
        seconds: Simulated time after which the board stops; None for no limit.
        real_time: Whether the board never runs faster than real time.
        seed: Seed of the index's jitter, and of what registers and memories hold before the
            reset; the scene's own seed is that of the sensor's noise.
        late_lines: How much later than right behind its exposure the sensor reads a line out: so
            many more exposures have to end, and a part of a line's time to go by; the
            configuration's ``readout_lag`` if None.
        loaded: Whether the registers begin as a load of the configuration would leave them.
        rest_deg: Scan angle from the mark at which a polygon rests after ``Process.stall``.
        progress: Called with the number of angles of the scene that are rendered so far.

    Raises:
        InputError: as ``load``, ``library`` and ``build``.
    """
    make_folder(port)
    shown = load(scene)  # before a build of minutes
    program = build(config, loaded=loaded)
    lines = library(shown, config, build_folder() / "board", progress=progress)
    words = [str(program), "--library", str(lines), "--port", str(port)]
    words += ["--status", str(status_file(port)), "--clock-hz", repr(config.clock.frequency_hz)]
    if seconds is not None:
        words += ["--seconds", repr(seconds)]
    if real_time:
        words.append("--real-time")
    # Nothing is zero before the reset: what would need it fails here, not on a real board.
    words += [f"+seed={seed}", f"+rest={math.radians(rest_deg)!r}"]
    words += ["+verilator+rand+reset+2", f"+verilator+seed+{seed}"]
    lag, part = divmod(config.sensor.readout_lag if late_lines is None else late_lines, 1.0)
    delay_clks = round(part * config.clock.frequency_hz / config.line.rate_hz)
    words += [f"+lag={round(lag)}", f"+delay={delay_clks}"]
    if swinging and config.mirror.polygon:
        words += ["+swinging=1", "+velocity=1.0"]
    elif swinging:
        mirror = config.mirror
        # The drive's phase is 0 at its first pulse, and leads the mirror's by this much.
        shape, slope = series(np.array([-mirror.drive_phase]), mirror.harmonics)
        size = math.radians(mirror.amplitude_deg)
        angle, velocity = size * float(shape[0]), size * float(slope[0]) * mirror.frequency_hz
        words += ["+swinging=1", f"+angle={angle!r}", f"+velocity={velocity!r}"]
    return words


@dataclass(frozen=True)
class Status:
    """The status of a board since it was switched on.

    ``to_host`` and ``from_host`` are numbers of bytes; ``dropped`` bytes are those that the host
    did not read, ``unheard`` ones came while nobody had the port open. ``framing`` and ``breaks``
    count events on the board's own line. ``lines_lost`` were exposed while the sensor still read
    out, ``lines_outside`` were beyond the angles that are rendered, and dark.

    The last ones are numbers of clocks, -1 before the first: when the mirror was stopped by
    ``stall``, the last edge of the index within an open gate, the last clock of a pulse, and of the
    start-up channel, whose largest level was ``startup_most``.
    """

    clocks: int
    wall_s: float
    clock_hz: float
    baud: int
    open: bool
    opened: int
    to_host: int
    from_host: int
    dropped: int
    unheard: int
    framing: int
    breaks: int
    lines: int
    lines_lost: int
    lines_outside: int
    stalled_at: int
    edge_at: int
    pulse_at: int
    startup_at: int
    startup_most: int


class Process:
    """A board's program while it runs: ``with`` starts it and stops it at its end."""

    def __init__(self, words: list[str], port: Path) -> None:
        """Prepare a start.

        Args:
            words: Words of the command; ``--port`` is ``port`` and ``--status`` its
                ``status_file``.
            port: The symbolic link to the serial port.
        """
        self.port = port
        self._words = words
        self._log = port.with_name(f"{port.name}.log")
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        """Start the program, and wait until its port exists.

        Raises:
            InputError: if the program ends, or does not get that far.
        """
        with contextlib.suppress(FileNotFoundError):
            status_file(self.port).unlink()
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                self._words, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT
            )
        end = time.monotonic() + _START_S
        while not status_file(self.port).exists():
            if self._process.poll() is not None or time.monotonic() > end:
                self.stop()
                raise InputError(f"virtual board: it did not start: {self.log().strip()}")
            time.sleep(0.01)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop the program."""
        self.stop()

    def log(self) -> str:
        """Return what the program has printed."""
        return self._log.read_text(errors="replace")

    @property
    def running(self) -> bool:
        """Return whether the program is still running."""
        return self._process is not None and self._process.poll() is None

    def status(self) -> Status:
        """Return the board's status, at most a twentieth of a second old while the program runs."""
        return Status(**json.loads(status_file(self.port).read_text()))

    def clocks(self) -> int:
        """Return the number of clocks since the board's reset."""
        return self.status().clocks

    def wait(self, clocks: int) -> None:
        """Wait until the board has run for this number of clocks from now, or more.

        Raises:
            RuntimeError: if the program ends before.
        """
        old = self.clocks()  # up to a twentieth of a second old
        until = None
        while until is None or self.clocks() < until:
            if not self.running:
                raise RuntimeError(f"virtual board: it ended: {self.log().strip()}")
            time.sleep(0.02)
            if until is None and self.clocks() > old:
                until = self.clocks() + clocks

    def signal(self, number: int) -> None:
        """Send a signal to the program."""
        if self._process is not None:
            self._process.send_signal(number)

    def stall(self) -> None:
        """Stop the mirror where it is, a polygon at ``rest_deg``, and do not let it go again."""
        self.signal(signal.SIGUSR1)

    def stop(self) -> int:
        """End the program with SIGTERM, and return its exit status; a second call does nothing."""
        if self._process is None:
            return 0
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        try:
            return self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()


class Board(Process):
    """A virtual board: ``with Board("default", config) as board``, then use ``board.port``."""

    def __init__(
        self,
        scene: str = "default",
        config: Config | None = None,
        *,
        port: Path | None = None,
        swinging: bool = False,
        seconds: float | None = None,
        seed: int = 1,
        late_lines: float | None = None,
        loaded: bool = False,
        rest_deg: float = 0.0,
    ) -> None:
        """Make the files that a board needs; this takes a minute or two for a new configuration.

        Args:
            scene: A shipped scene or a file.
            config: The instrument; the shipped one with ``CLOCK_HZ`` if None.
            port: The symbolic link to the serial port; ``build/board/port`` if None.
            swinging: Whether the mirror swings from the start, as in ``command``.
            seconds: Simulated time after which the board stops; None for no limit.
            seed: Seed of the index's jitter, and of what registers hold before the reset.
            late_lines: How late the sensor reads out, as in ``command``.
            loaded: Whether the registers begin with the configuration, as in ``command``.
            rest_deg: Where a stalled polygon rests, as in ``command``.

        Raises:
            InputError: as ``command``.
        """
        self.config = on_board(Config() if config is None else config)
        where = build_folder() / "board" / "port" if port is None else port
        words = command(
            scene,
            self.config,
            where,
            swinging=swinging,
            seconds=seconds,
            seed=seed,
            late_lines=late_lines,
            loaded=loaded,
            rest_deg=rest_deg,
        )
        super().__init__(words, where)
