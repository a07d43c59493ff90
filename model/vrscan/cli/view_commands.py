"""``vrscan view``: a page of a board's points while they come."""

import contextlib
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vrscan.cli.checks import check_range
from vrscan.cli.interrupt import interrupted
from vrscan.cli.link_commands import (
    BAUD,
    TIMEOUT_S,
    BaudOption,
    PortOption,
    StartOption,
    TimeoutOption,
    chosen_port,
)
from vrscan.data.errors import InputError

if TYPE_CHECKING:
    from vrscan.data.config import Config
    from vrscan.view.live import LiveSource, Options
    from vrscan.view.playback import Playback

HTTP_PORT = 5100
BOARD_TIMEOUT_S = 60.0


def view(
    ctx: typer.Context,
    port: PortOption = None,
    file: Annotated[
        Path | None,
        typer.Option(
            help="Show a recording over and over: .mcap, points.csv, lines.npz, points.npz."
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(help="How many times as fast as it was taken a recording is played.")
    ] = 1.0,
    board: Annotated[
        bool, typer.Option("--board", help="Simulate a board, with its mirror at work.")
    ] = False,
    scene: Annotated[
        str, typer.Option(help="What the simulated board looks at: a shipped scene or FILE.toml.")
    ] = "default",
    start: StartOption = False,
    control: Annotated[
        bool,
        typer.Option(
            "--control",
            help="Let the page start, stop, record and write registers, once a word that is "
            "printed here is typed into it.",
        ),
    ] = False,
    space: Annotated[
        bool,
        typer.Option("--space", help="Show points and free beams in 9 bytes: all lines of a scan."),
    ] = False,
    step: Annotated[
        int | None,
        typer.Option(help="Take every n-th line; default: as many as the serial line carries."),
    ] = None,
    stream_baud: Annotated[
        int | None, typer.Option(help="Rate of the link while points come; default: as it is.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for recordings; default: build/view.")
    ] = None,
    http_port: Annotated[
        int, typer.Option(help="Port of the page on this machine; 0: any that is free.")
    ] = HTTP_PORT,
    baud: BaudOption = BAUD,
    timeout: TimeoutOption = TIMEOUT_S,
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file that overrides the defaults.")
    ] = None,
) -> None:
    """Show a live page of a board or a recording, until Ctrl-C."""
    from vrscan.data import config as configuration
    from vrscan.data.extras import named
    from vrscan.data.records import Form
    from vrscan.engines.board import make_folder
    from vrscan.engines.tools import build_folder
    from vrscan.link.device import MOST_STEP

    with named():
        from vrscan.view.live import LiveSource, Options
        from vrscan.view.playback import opened

    origin = ctx.get_parameter_source("port")
    typed = origin is not None and origin.name == "COMMANDLINE"  # and not by VRSCAN_PORT
    wanted = {"--file": file is not None, "--board": board, "--port": typed}
    given = [name for name, there in wanted.items() if there]
    if len(given) > 1:
        raise InputError(f"{' or '.join(given)}: only one of them")
    if control and file is not None:
        raise InputError("--control: a recording has no board to control")
    check_range("--speed", speed, 1e-4, 100.0)
    if step is not None:
        check_range("--step", step, 1, MOST_STEP)
    check_range("--http-port", http_port, 0, 65535)
    check_range("--baud", baud, 1, 1_000_000_000)
    check_range("--timeout", timeout, 0.01, 3600.0)
    settings = configuration.load(config)
    source: LiveSource | Playback
    with contextlib.ExitStack() as stack:
        options = Options(
            port="",
            baud=baud,
            stream_baud=stream_baud,
            timeout=timeout,
            form=Form.SPACE if space else Form.FULL,
            step=step,
            start=start,
            config=settings,
        )
        folder = build_folder() / "view" if out is None else out
        if file is not None:
            source = opened(file, config, speed)
        else:
            if board:
                options = _simulated(options, scene, settings, stack)
            else:
                options = replace(options, port=chosen_port(port))
                _tell_missing(options.port)
            make_folder(folder / "view")
            source = LiveSource(options)
        ended = stack.enter_context(interrupted(signal.SIGINT, signal.SIGTERM))
        stack.callback(source.close)
        if isinstance(source, LiveSource):
            source.begin()
        _serve(source, folder, http_port, ended, control=control)


def _tell_missing(port: str) -> None:
    """Print a line on the error stream where a port is not there yet."""
    file = "://" not in port and os.name != "nt"  # others are URLs of pyserial, and COM3
    if file and not Path(port).exists():
        print(f"vrscan: {port}: no such port yet; it is waited for", file=sys.stderr)


def _simulated(
    options: "Options", scene: str, settings: "Config", stack: contextlib.ExitStack
) -> "Options":
    """Start a simulated board until the stack ends; return how it is used."""
    from vrscan.engines import board as virtual
    from vrscan.engines.tools import build_folder
    from vrscan.scene.description import load

    load(scene)  # refuses one that there is not
    settings = virtual.on_board(settings)
    where = build_folder() / "view" / "port"
    print("a board is built and its scene rendered; the first time this takes minutes", flush=True)
    stack.enter_context(virtual.Board(scene, settings, port=where, swinging=True))
    timeout = max(options.timeout, BOARD_TIMEOUT_S)
    return replace(
        options, port=str(where), timeout=timeout, config=settings, load=True, start=True
    )


def _serve(
    source: "LiveSource | Playback",
    folder: Path,
    port: int,
    ended: Callable[[], int | None],
    *,
    control: bool,
) -> None:
    """Show pages of a source until a signal comes."""
    import asyncio

    from vrscan.view import page, server
    from vrscan.view.live import LiveSource
    from vrscan.view.word import new_word

    word = new_word() if control else None

    async def run() -> None:
        served, url = server.serve(lambda document: page.make(document, source, folder, word), port)
        print(url, flush=True)
        if word is not None:
            print(f"{word}  is the word that gives a page its buttons", flush=True)
        elif isinstance(source, LiveSource):
            print("the page is read-only; with --control it has buttons", flush=True)
        while ended() is None:
            await asyncio.sleep(0.1)
        served.stop()

    asyncio.run(run())
