"""The virtual board with a polygon: what it measures between two starts of scan, and its dark.

A clock of 25 MHz and 960 facets a second keep it short.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from harness import in_volume
from rich.console import Console

from vrscan.data import pkg
from vrscan.data.config import Config
from vrscan.data.records import Form
from vrscan.engines.board import Board
from vrscan.link.device import Device
from vrscan.link.link_report import info_table
from vrscan.registers.values import integer
from vrscan.scene import library as lines
from vrscan.scene.description import load

CLOCK_HZ = 25e6
CONFIG = Config.model_validate(
    {
        "clock": {"frequency_hz": CLOCK_HZ},
        "line": {"rate_hz": 9000.3},
        "mirror": {"kind": "polygon", "frequency_hz": 960.0, "settle_periods": 16},
    }
)
SCENE = "plane"
POWER = round(0.4 * CONFIG.laser.power_max)
DIODE_RAD = math.radians(1.0)  # that of tb/board: half of the beam's way over the diode
POINTS = 150
STEP = 3  # as many lines as the serial port carries
DARK_S, LIGHT_S = 1.5 / CONFIG.mirror.frequency_hz, 0.025  # after the last edge of the index
ARMED = 1 << 2  # of laser_status
UNSETTLED = 1 << pkg.FLAG_UNSETTLED
MIRROR = ((1 << pkg.MIRROR_FLAG_WIDTH) - 1) << pkg.FLAG_NOT_RUNNING
NO_SPOT = 1 << pkg.FLAG_LOW_SNR | 1 << pkg.FLAG_TOO_NARROW | 1 << pkg.FLAG_RIVAL
UNCLEAR = NO_SPOT | 1 << pkg.FLAG_AT_EDGE | 1 << pkg.FLAG_OUT_OF_RANGE | MIRROR

pytestmark = pytest.mark.timeout(1800)


def test_a_polygon_is_scanned_measured_and_dark_when_it_stands(tmp_path: Path) -> None:
    port = tmp_path / "port"
    with Board(SCENE, CONFIG, port=port, swinging=True) as board:
        with Device(str(port), timeout=240.0) as host:
            host.load(CONFIG)
            host.write_many([("line_enable", 1), ("laser_adapt", 0), ("laser_power", POWER)])
            host.write_many([("laser_enable", 1), ("mirror_enable", 1)])
            host.wait_for_mirror()
            while not integer(host.read("laser_status")) & ARMED:  # two lines behind RUN
                pass
            ready = integer(host.read("uptime"))
            rows = []
            with host.stream(Form.FULL, STEP) as stream:
                for some in stream:
                    rows.append(some)
                    if sum(map(len, rows)) >= POINTS:
                        break
            assert stream.account.lost == 0 and host.read("mirror_state") == pkg.MIRROR_RUN
            console = Console(width=200)
            with console.capture() as shown:
                console.print(info_table(host))
            assert "mirror   RUN, settled" in shown.get() and "no fault" in shown.get()
            assert board.status().lines_outside == 0
            board.stall()
            board.wait(round(1.2 * LIGHT_S * CLOCK_HZ))
            assert host.read("mirror_state") == pkg.MIRROR_FAULT
        status = board.status()
    found = np.concatenate(rows)
    found = found[found["time"] > ready]  # the first may have begun before

    # The scan is lit and without a flag of the mirror, and beyond it there is no light.
    angle = 2.0 * math.pi * found["angle"] / 2.0**pkg.ANGLE_WIDTH
    reach = math.radians(CONFIG.mirror.reach_deg)
    inside, outside = np.abs(angle) < reach - 0.01, np.abs(angle) > reach + 0.01
    assert inside.sum() > POINTS / 2 and outside.sum() > POINTS / 10
    assert (found["flags"][inside] & MIRROR == 0).all() and (found["power"][inside] == POWER).all()
    assert (found["flags"][outside] & MIRROR == UNSETTLED).all()
    assert (found["power"][outside] == 0).all()
    assert not (found["bits"] & 1)[outside].any()

    # The points are those of the plane where the beam of their angle meets it.
    made = lines.renderer(load(SCENE), CONFIG)
    words = np.zeros((len(found), CONFIG.sensor.line_length), np.uint16)
    truth = made.render(lines.at_angles(angle, CONFIG.mirror), words).truth
    clear = (found["flags"] & UNCLEAR == 0) & (found["bits"] & 1 == 1)
    seen = inside & np.isfinite(truth.position_px)
    off = {
        name: np.abs(found[name] * 2.0**-pkg.LENGTH_FRACTION - exact)[seen & clear]
        for name, exact in (("x", truth.x_mm), ("z", truth.z_mm))
    }
    print(f"{len(off['z'])} of {seen.sum()} points clear, z off by {np.median(off['z']):.3f} mm")
    assert len(off["z"]) > 0.6 * seen.sum() > 0.3 * inside.sum()
    assert np.median(off["z"]) < 0.5 and off["z"].max() < 5.0 and np.median(off["x"]) < 0.3

    # A polygon that stands with its beam on the diode is dark 3/2 facets after the start of scan.
    pulse, light = ((at - status.edge_at) / CLOCK_HZ for at in (status.pulse_at, status.startup_at))
    print(f"stalled: last pulse {1e3 * pulse:.2f} ms, last light {1e3 * light:.2f} ms after it")
    facet = CLOCK_HZ / CONFIG.mirror.frequency_hz
    # On its way to the diode, or on it already: up to 3/2 of DIODE_RAD after the edge.
    on_diode = 1.5 * DIODE_RAD / (4.0 * math.pi / CONFIG.mirror.facets) * facet
    assert -on_diode < status.edge_at - status.stalled_at < 1.1 * facet
    assert status.stalled_at + facet < status.clocks - LIGHT_S * CLOCK_HZ
    assert 0.0 < pulse < DARK_S and 0.0 < light < LIGHT_S
    assert status.lines_lost == 0
    # Where it stands nothing is made of the pulses' light.
    assert status.lines_outside < 1.5 * CONFIG.line.rate_hz / CONFIG.mirror.frequency_hz


@pytest.mark.parametrize("rest_deg", [in_volume(-1.1), in_volume(0.0), 1.2])
def test_no_host_lights_a_polygon_that_rests_on_its_diode(rest_deg: float, tmp_path: Path) -> None:
    """At the diode's edge start-up light is below the threshold, and each pulse above it.

    A host has one pulse a facet and start-up light all the time, so every pulse makes two edges of
    a good period, and lifts all limits of the index. The pulses end all the same.
    """
    port = tmp_path / "port"
    facet_s = 1.0 / CONFIG.mirror.frequency_hz
    with Board(SCENE, CONFIG, port=port, swinging=True, rest_deg=rest_deg) as board:
        with Device(str(port), timeout=240.0) as host:
            host.load(CONFIG)
            host.write_many([("line_enable", 1), ("laser_adapt", 0), ("laser_power", POWER)])
            host.write_many([("laser_enable", 1), ("mirror_enable", 1)])
            host.wait_for_mirror()
            host.write_many([("scan_begin", 0), ("scan_span", 0xFFFF)])
            host.write_many([("laser_index_begin", 0), ("laser_index_end", 0xFFFF)])
            host.write_many([("period_max_clks", 0xFFFF_FFFF), ("width_max_clks", 0xFFFF_FFFF)])
            host.write_many([("width_min_clks", 0), ("lost_timeout", 0xFFFF_FFFF)])
            host.write_many([("pulse_clks", round(2e-6 * CLOCK_HZ)), ("ratio", 1 << 32)])
            board.wait(round(10.0 * facet_s * CLOCK_HZ))
            before = board.status()
            assert before.pulse_at > before.clocks - 0.5 * LIGHT_S * CLOCK_HZ
            board.stall()
            board.wait(round(3.0 * LIGHT_S * CLOCK_HZ))
        status = board.status()
    rested = status.stalled_at + facet_s * CLOCK_HZ  # at most: it turns to where it rests
    last = (status.pulse_at - rested) / CLOCK_HZ
    print(f"rest at {rest_deg} degrees: last pulse {1e3 * last:.2f} ms after it")
    assert status.clocks - rested > 2.5 * LIGHT_S * CLOCK_HZ
    assert last < 0.010
