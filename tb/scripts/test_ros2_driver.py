"""The driver for ROS 2 before a board made of the twins: what it publishes is what is exported."""

import re
import runpy
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from fake_board import CLOCK_HZ, FakeBoard
from fake_ros import Ros
from random_records import random_records
from ros_reader import messages

from vrscan.clocked.command_executor import link_pkg
from vrscan.data import clouds, filters, pkg, records
from vrscan.data.config import Config
from vrscan.data.recordings import Clock, full_table
from vrscan.engines.tools import repository_root
from vrscan.link.register_host import RUN
from vrscan.link.sweeps import columns

PACKAGE = repository_root() / "scripts" / "ros2" / "vrscan_driver"
LINES_PER_S = 4000.0
PERIOD = 150.1
PATIENCE_S = 60.0


def made() -> records.Records:
    """Return records of a wall before a mirror, among them lines without a place."""
    rng = np.random.default_rng(20261126)
    found = random_records(rng, range(24_000))
    line = np.arange(len(found))
    angle = np.radians(20.4) * np.cos(2.0 * np.pi * line / PERIOD)
    found["angle"] = np.rint(angle / (2.0 * np.pi) * 2.0**pkg.ANGLE_WIDTH)
    for name, mm in {"x": 400.0 * np.tan(angle), "z": np.full(len(found), 400.0)}.items():
        found[name] = np.rint(mm * 2.0**pkg.LENGTH_FRACTION)
    found["flags"] &= ~np.uint16(1 << pkg.FLAG_NO_RANGE | 1 << pkg.FLAG_OUT_OF_RANGE)
    found["bits"] = np.where(rng.random(len(found)) < 0.9, records.MEASURED, 0)
    found["power"] = 32768
    found["time"] = np.rint(line / LINES_PER_S * CLOCK_HZ)
    return found


MADE = made()


@pytest.fixture
def board(tmp_path: Path) -> Iterator[FakeBoard]:
    with FakeBoard(tmp_path / "port") as running:
        running.made, running.lines_per_s, running.room = MADE, LINES_PER_S, 10_000
        running.file.values["line_enable"] = [1]
        running.file.inputs["mirror_state"] = RUN
        yield running


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch) -> Ros:
    monkeypatch.syspath_prepend(PACKAGE)
    for name in ("vrscan_driver", "vrscan_driver.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return Ros(monkeypatch)


def until(wanted: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not wanted():
        assert time.monotonic() < end
        time.sleep(0.01)


@contextmanager
def running(ros: Ros, board: FakeBoard, **given: Any) -> Iterator[Future[int]]:
    """Run the node as its command does, until the context ends or it does."""
    from vrscan_driver.node import main

    ros.given = {"port": str(board.path), "timeout": 4.0, "step": 1} | given
    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(main)
        try:
            until(lambda: done.done() or (ros.node and ros.node.timers))
            yield done
        finally:
            ros.stopped.set()
    assert done.result() == 0 and ros.node.destroyed


def sent(ros: Ros, topic: str) -> list[Any]:
    found: list[Any] = ros.node.publishers[topic].sent
    return found


def seconds(message: Any) -> float:
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


@pytest.mark.parametrize("count", [1, 4])
def test_what_is_published_is_what_is_exported(
    ros: Ros, board: FakeBoard, tmp_path: Path, count: int
) -> None:
    def now_s() -> float:
        """Return a time that is the board's time of the last point that has come, and 1,000 s."""
        clock = getattr(ros.node, "_clock", None)
        return 1000.0 + (clock._last / CLOCK_HZ if clock is not None else 0.0)

    ros.now_s = now_s
    board.file.values["length_unit"] = [4]  # mm
    with running(ros, board, min_confidence=0.25, frame="head", sweeps=count):
        until(lambda: len(sent(ros, "points")) > 8)
    clouds_sent, scans_sent = list(sent(ros, "points")), list(sent(ros, "scan"))
    table = filters.min_confidence(full_table(MADE, 12, Clock(CLOCK_HZ), 4), 0.25)
    whole = clouds.cloud(table)
    grid = columns(Config(), 1, count)
    exports = []  # one of them puts the same sweeps together
    for shift in range(count):
        group = (whole.sweep + shift) // count
        exported = replace(whole, sweep=group, columns=grid)
        path = tmp_path / f"{shift}.mcap"
        with path.open("wb") as file:
            clouds.write(exported, path.suffix, file, name="made", frame="head")
        exports.append(messages(path))
    first = clouds_sent[1].data.tobytes()
    (read, place) = next(
        (read, place)
        for read in exports
        for place, each in enumerate(read["/points"])
        if each.data.tobytes() == first
    )
    # All but the first, which begins where the stream does.
    pairs = [
        (clouds_sent[1:], read["/points"][place:]),
        (scans_sent[1:], read["/scan"][place:]),
    ]
    for got, want in pairs:
        for one, other in zip(got, want, strict=False):
            mine, exported = asdict(one), asdict(other)
            assert mine["header"]["frame_id"] == exported["header"]["frame_id"]
            for name in set(mine) - {"header", "scan_time"}:
                np.testing.assert_array_equal(mine[name], exported[name], name)
    # The stamps are by this machine's clock.
    stamps = np.array([seconds(each) for each in clouds_sent[1:]])
    boards = np.array([seconds(each) for each in read["/points"][place : place + len(stamps)]])
    np.testing.assert_allclose(stamps - boards, 1000.0, rtol=0.0, atol=1e-6)
    assert scans_sent[2].scan_time == pytest.approx(boards[1] - boards[0], abs=1e-6)
    (placed,) = sent(ros, "/tf_static")
    (want,) = read["/tf_static"]
    one, other = asdict(placed.transforms[0]), asdict(want.transforms[0])
    assert one["transform"] == other["transform"]
    assert one["child_frame_id"] == other["child_frame_id"] == "head_laser"
    assert ros.node.publishers["/tf_static"].qos.durability == "transient local"
    assert board.executed[link_pkg.COMMAND_STREAM_STOP] >= 2  # before and after


def test_a_board_that_is_lost_comes_back(
    ros: Ros, board: FakeBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    board.unplug()
    monkeypatch.setattr("vrscan_driver.node.RETRY_S", 0.1)
    with running(ros, board):
        until(lambda: ros.node.said)
        assert "cannot open" in ros.node.said[0]
        board.plug()
        for _ in range(2):
            seen = len(sent(ros, "points"))
            until(lambda seen=seen: len(sent(ros, "points")) > seen + 2)
            told = len(ros.node.said)
            board.unplug()
            until(lambda known=told: len(ros.node.said) > known)
            assert any("the port is gone" in each for each in ros.node.said[told:])
            time.sleep(0.3)  # more than one attempt
            assert len(ros.node.said) - told <= 2  # each reason once
            board.plug()
        before = len(sent(ros, "points"))
        until(lambda: len(sent(ros, "points")) > before)


def test_a_board_that_is_lost_at_a_change_of_rate_comes_back(
    ros: Ros, board: FakeBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vrscan_driver.node.RETRY_S", 0.1)
    board.unplug_at_rate()
    with running(ros, board, stream_baud=1_000_000):
        until(lambda: any("the port is gone" in each for each in ros.node.said))
        board.plug()
        until(lambda: len(sent(ros, "points")) > 2)


def test_lines_that_stand_still_are_told(ros: Ros, board: FakeBoard) -> None:
    board.file.values["line_enable"] = [0]
    with running(ros, board, timeout=0.4):
        until(lambda: any("lines stand still" in each for each in ros.node.said))
        board.file.values["line_enable"] = [1]
        until(lambda: sent(ros, "points"))


def test_services_start_and_stop(ros: Ros, board: FakeBoard) -> None:
    board.file.values["line_enable"] = [0]
    enabled = ("line_enable", "laser_enable", "mirror_enable")

    def held() -> set[int]:
        return {board.file.values[name][0] for name in enabled}

    with running(ros, board):
        until(lambda: any("answers" in each for each in ros.node.said))
        assert ros.call("~/start").success and held() == {1}
        until(lambda: sent(ros, "points"))
        assert ros.call("~/stop").success and held() == {0}
        board.unplug()
        until(lambda: any("the port is gone" in each for each in ros.node.said))
        answer = ros.call("~/start")
        assert not answer.success and "no board answers" in answer.message
        board.plug()
        until(lambda: ros.node.said[-1].endswith("answers"))
    assert held() == {0}


def test_what_was_started_is_stopped_at_the_end(ros: Ros, board: FakeBoard) -> None:
    with running(ros, board, start=True):
        until(lambda: sent(ros, "points"))
        assert board.file.values["mirror_enable"] == [1]
    assert board.file.values["mirror_enable"] == board.file.values["laser_enable"] == [0]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"min_confidence": 1.5}, "min_confidence: must be 0 to 1 (1.5)"),
        ({"sweeps": 0}, "sweeps: must be 1 to 1000 (0)"),
        ({"frame": ""}, "frame: must not be empty or begin with a slash ('')"),
        ({"frame": "/map"}, "frame: must not be empty or begin with a slash ('/map')"),
        ({"configuration": "meter"}, "meter: no such file, nor a preset of .*'metre'.*"),
        ({"stream_baud": 900_000_000}, "baud: the board makes rates up to .*"),
    ],
)
def test_what_no_retry_mends_is_one_line(
    ros: Ros, board: FakeBoard, given: dict[str, Any], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from vrscan_driver.node import main

    ros.given = {"port": str(board.path), "timeout": 4.0} | given
    assert main() == 2 and not ros.ok()
    line = capsys.readouterr().err
    pattern = told if ".*" in told else re.escape(told)
    assert re.fullmatch(f"vrscan_driver: {pattern}\n", line), line


def test_the_package_fits_together(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    """Names in package.xml, setup.py, launch file and parameters are those of the node."""
    from vrscan_driver import node

    given: dict[str, Any] = {}
    monkeypatch.setattr("setuptools.setup", lambda **words: given.update(words))
    runpy.run_path(str(PACKAGE / "setup.py"))
    manifest = ET.parse(PACKAGE / "package.xml").getroot()
    assert given["name"] == manifest.findtext("name") == "vrscan_driver"
    assert given["version"] == manifest.findtext("version")
    (script,) = given["entry_points"]["console_scripts"]
    name, _, where = script.partition(" = ")
    assert where == f"{node.__name__}:{node.main.__name__}"
    for _, files in given["data_files"]:
        assert all((PACKAGE / file).is_file() for file in files)
    depends = {each.text for each in manifest.iter("exec_depend")}
    used = {
        m[1]
        for m in re.finditer(
            r"^from (\w+)[\w.]*\.(?:msg|srv) ",
            (PACKAGE / "vrscan_driver" / "node.py").read_text(),
            re.MULTILINE,
        )
    }
    assert used | {"rclpy", "launch", "launch_ros"} == depends

    def module(name: str, *names: str) -> None:
        made = ModuleType(name)
        for each in names:
            setattr(made, each, lambda *w, _n=each, **k: SimpleNamespace(kind=_n, words=w, **k))
        monkeypatch.setitem(sys.modules, name, made)

    module("launch", "LaunchDescription")
    module("launch.actions", "DeclareLaunchArgument")
    module("launch.substitutions", "LaunchConfiguration", "PathJoinSubstitution")
    module("launch_ros")
    module("launch_ros.actions", "Node")
    module("launch_ros.substitutions", "FindPackageShare")
    found = runpy.run_path(str(PACKAGE / "launch" / "vrscan.launch.py"))
    port, parameters, started = found["generate_launch_description"]().words[0]
    assert (started.package, started.executable) == (given["name"], name)
    assert port.default_value == node.PARAMETERS["port"][0]
    shared, *path = parameters.default_value.words[0]
    assert shared.words == (given["name"],)
    folders = dict(given["data_files"])
    assert folders[f"share/{given['name']}/{path[0]}"] == ["/".join(path)]
    assert port.words == started.parameters[1]["port"].words == ("port",)
    assert parameters.words == started.parameters[0].words == ("parameters",)
    shipped = yaml.safe_load((PACKAGE / "/".join(path)).read_text())["/**"]["ros__parameters"]
    defaults = {name: value for name, (value, *_) in node.PARAMETERS.items() if name != "port"}
    assert shipped == defaults
    assert {n: type(v) for n, v in shipped.items()} == {n: type(v) for n, v in defaults.items()}


def test_the_page_names_what_there_is(ros: Ros) -> None:
    from vrscan_driver import node

    page = (repository_root() / "docs" / "formats.md").read_text()
    (section,) = re.findall(r"^## A driver for ROS 2\n(.*?)^## ", page, re.DOTALL | re.MULTILINE)
    rows = dict(re.findall(r"^\| `(\w+)` \| `?([^`|]*?)`? \|", section, re.MULTILINE))
    defaults = {name: value for name, (value, *_) in node.PARAMETERS.items()}
    assert {name: yaml.safe_load(text) for name, text in rows.items()} == defaults
    (launched,) = re.findall(r"^ros2 launch (\w+) ([\w.]+) (\w+):=(\S+)$", section, re.MULTILINE)
    assert launched == (PACKAGE.name, "vrscan.launch.py", "port", defaults["port"])
    assert (PACKAGE / "launch" / launched[1]).is_file()
    assert str(PACKAGE.relative_to(repository_root())) in section
    ros.inits = 1
    started = node.Driver()
    assert {f"/{started.name}/{name.removeprefix('~/')}" for name in started.services} == set(
        re.findall(r"`?(/vrscan/\w+)", section)
    )
    assert set(started.publishers) == {"points", "scan", "/tf_static"}
    assert all(f"`{topic}`" in section for topic in started.publishers)
