"""``vrscan view``: a page of a board's points while they come."""

import contextlib
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
    port: PortOption = None,
    file: Annotated[
        Path | None, typer.Option(help="Show a recording: points.csv, lines.npz or .mcap.")
    ] = None,
    board: Annotated[
        bool, typer.Option("--board", help="Simulate a board, with its mirror at work.")
    ] = False,
    scene: Annotated[
        str, typer.Option(help="What the simulated board looks at: a shipped scene or FILE.toml.")
    ] = "default",
    start: StartOption = False,
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
    from vrscan.engines.tools import build_folder
    from vrscan.link.device import MOST_STEP

    with named():
        from vrscan.view.live import LiveSource, Options
        from vrscan.view.playback import opened
        from vrscan.view.recorder import Recorder

    if sum((port is not None, file is not None, board)) > 1 and (file is not None or board):
        raise InputError("--port, --file or --board: only one of them")
    if step is not None and not 1 <= step <= MOST_STEP:
        raise InputError(f"--step: must be 1 to {MOST_STEP} ({step})")
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
        )
        folder = build_folder() / "view" if out is None else out
        if file is not None:
            source = opened(file, settings)
        else:
            if board:
                options = _simulated(options, scene, settings, stack)
            else:
                options = replace(options, port=chosen_port(port))
            folder.mkdir(parents=True, exist_ok=True)
            source = LiveSource(options, Recorder)
        ended = stack.enter_context(interrupted(signal.SIGINT, signal.SIGTERM))
        stack.callback(source.close)
        _serve(source, folder, http_port, ended)


def _simulated(
    options: "Options", scene: str, settings: "Config", stack: contextlib.ExitStack
) -> "Options":
    """Start a simulated board until the stack ends; return how it is used."""
    from vrscan.engines import board as virtual
    from vrscan.engines.tools import build_folder

    settings = virtual.on_board(settings)
    where = build_folder() / "view" / "port"
    print("a board is built and its scene rendered; the first time this takes minutes", flush=True)
    stack.enter_context(virtual.Board(scene, settings, port=where, swinging=True))
    timeout = max(options.timeout, BOARD_TIMEOUT_S)
    return replace(options, port=str(where), timeout=timeout, config=settings, start=True)


def _serve(
    source: "LiveSource | Playback", folder: Path, port: int, ended: Callable[[], int | None]
) -> None:
    """Show pages of a source until a signal comes."""
    import asyncio

    from vrscan.view import page, server

    async def run() -> None:
        served, url = server.serve(lambda document: page.make(document, source, folder), port)
        source.begin()
        print(url, flush=True)
        while ended() is None:
            await asyncio.sleep(0.1)
        served.stop()

    asyncio.run(run())
