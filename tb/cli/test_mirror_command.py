"""``vrscan mirror``: its table against the truth, recorded edges, and what the user got wrong.

At a clock of 10 MHz, where a second of mirror time takes three.
"""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from run_command import ended
from scipy.optimize import brentq
from typer.testing import CliRunner

from vrscan.cli.app import app
from vrscan.data.config import load
from vrscan.ideal.motion import motion
from vrscan.study.report.mirror_report import COLUMNS, Events, read_edges, simulate

CLOCK = "[clock]\nfrequency_hz = 10e6\n"
STEP_S = 25e-9  # of the index's samples
PEAK_RAD_PER_S = 562.0
HARMONICS = [[1.0, 0.0], [0.004, 2.0], [0.0012, -1.0], [0.0003, 0.5], [0.0, 0.0], [1e-4, 3.0]]
AMPLITUDE_RAD = math.radians(20.3)  # not the configured one
PHASE = 0.37  # phi_0, turns: nothing that the drive knows
MARK_RAD = math.radians(17.0)
HERTZ = 249.0


def written(folder: Path, text: str) -> str:
    path = folder / "config.toml"
    path.write_text(text)
    return str(path)


def table(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        assert file.readline().rstrip("\n") == COLUMNS
        file.seek(0)
        return list(csv.DictReader(file))


def column(rows: list[dict[str, str]], name: str) -> np.ndarray:
    return np.array([float(row[name]) for row in rows])


def run(*arguments: str):
    return CliRunner().invoke(app, ["mirror", *arguments])


def test_a_shock_from_power_on(tmp_path: Path) -> None:
    """States in their order; angles right where unflagged; the shock flagged within a period."""
    out = tmp_path / "mirror.csv"
    config = written(tmp_path, CLOCK)
    result = run("--out", str(out), "--config", config, "--seconds", "0.4", "--shock", "3")
    assert result.exit_code == 0, result.output
    for words in ("RUN after", "angle error, unflagged, rms", "event flagged after"):
        assert words in result.output
    # The shipped mirror's middle is 0.2 urad off; the loop changes its amplitude by millionths.
    assert shown(result.output, "(11)") < 5.0 and shown(result.output, "(12)") < 5.0
    rows = table(out)
    states = [row["state"] for row in rows]
    order = [state for k, state in enumerate(states) if k == 0 or state != states[k - 1]]
    assert order == ["SWEEP", "SETTLE", "RUN"]
    assert [int(row["line"]) for row in rows] == list(range(len(rows)))
    time = column(rows, "time_s")
    assert np.all(np.diff(time) > 0)
    begin = time[states.index("RUN")]
    assert abs(time[-1] - begin - 0.4) < 1e-3
    running = np.array([state == "RUN" for state in states])
    clean = np.array([row["flags"] == "" for row in rows])
    assert not clean[~running].any()
    error = column(rows, "angle_rad") - column(rows, "angle_true_rad")
    natural = column([row for row in rows if row["state"] == "RUN"], "natural_hz")
    assert np.abs(natural - 248.5).max() < 0.02  # while the phase settles
    assert "natural frequency, by the drive's phase    248.50" in result.output
    before = running & clean & (time < begin + 0.1)
    assert np.sqrt(np.mean(error[before] ** 2)) < 10e-6
    assert np.abs(error[before]).max() < 2.5 * STEP_S * PEAK_RAD_PER_S
    flagged = time[running & ~clean]
    assert begin + 0.1 < flagged[0] < begin + 0.1 + 1.02 / HERTZ
    assert {row["flags"] for row in rows if row["state"] == "RUN"} == {"", "UNSETTLED"}
    late = time > flagged[-1]
    assert late.sum() > 1000
    assert np.sqrt(np.mean(error[late] ** 2)) < 10e-6
    amplitude = column(rows, "amplitude_true_rad")
    assert abs(amplitude[-1] / math.radians(20.5) - 1) < 1e-4
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_its_progress_goes_on_every_few_milliseconds(tmp_path: Path) -> None:
    told: list[int] = []
    config = load(Path(written(tmp_path, CLOCK)))
    simulate(config, 0.01, Events(), told.append, start_seconds=0.05)
    assert told[-1] == 50_000
    assert np.diff([0, *told]).min() > 0 and np.diff([0, *told]).max() <= 4_000  # us


def shown(output: str, name: str) -> float:
    """Return the urad in the line of a table that begins with a name."""
    (line,) = [line for line in output.splitlines() if line.strip().startswith(name)]
    return float(line.split(" urad")[0].split()[-1])


def test_what_the_equations_leave_of_a_crooked_motion(tmp_path: Path) -> None:
    """A constant torque holds the middle of the motion off: (11) by twice that, (12) by it once."""
    crooked_urad = 100.0
    text = f"{CLOCK}[mems]\nasymmetry = {1e-6 * crooked_urad}\n"
    config, out = written(tmp_path, text), tmp_path / "mirror.csv"
    result = run("--out", str(out), "--config", config, "--seconds", "0.2")
    assert result.exit_code == 0, result.output
    half_turn, left = shown(result.output, "(11)"), shown(result.output, "(12)")
    print(f"(11) leaves {half_turn} urad, (12) {left}")
    assert half_turn == pytest.approx(2.0 * crooked_urad, rel=0.05)
    assert left == pytest.approx(crooked_urad, rel=0.05)


def recorded(path: Path, seconds: float) -> None:
    """Write the edges of a motion (12) over a diode of 1 degree either side of the mark."""

    def at(level: float, low: float, high: float) -> float:
        return float(
            brentq(lambda p: motion(np.array([p]), AMPLITUDE_RAD, HARMONICS)[0] - level, low, high)
        )

    width = math.radians(1.0)
    pairs = ((MARK_RAD - width, 0, 1), (MARK_RAD, 1, 1), (MARK_RAD + width, 1, 0))
    way_out = [(at(level, -0.3, 0.01), c, g) for level, c, g in pairs]
    # On the way back a level ends where it began; without light the comparator says anything.
    way_back = [
        (at(MARK_RAD + width, 0.01, 0.3), 1, 1),
        (at(MARK_RAD, 0.01, 0.3), 0, 1),
        (at(MARK_RAD - width, 0.01, 0.3), 1, 0),
    ]
    periods = np.arange(-1, math.ceil(seconds * HERTZ) + 1)
    rows = [((n + PHASE + p) / HERTZ, c, g) for n in periods for p, c, g in (*way_out, *way_back)]
    rows = [row for row in sorted(rows) if 0 <= row[0] <= seconds]
    text = "".join(f"{t:.12f},{c},{g}\n" for t, c, g in rows)
    path.write_text("time_s,comparator,gate\n" + text)


def test_times_before_a_trigger_count_from_the_first_row(tmp_path: Path) -> None:
    whole, shifted = tmp_path / "edges.csv", tmp_path / "shifted.csv"
    recorded(whole, 0.1)
    head, *rows = whole.read_text().splitlines()
    first = float(rows[0].partition(",")[0])
    for path, start in ((whole, 0.0), (shifted, -0.25)):
        times = [float(row.partition(",")[0]) - first + start for row in rows]
        kept = [row.partition(",")[2] for row in rows]
        text = "".join(f"{t:.12f},{r}\n" for t, r in zip(times, kept, strict=True))
        path.write_text(f"{head}\n{text}")
    (want, amplitude, length), got = (read_edges(path, load(None)) for path in (whole, shifted))
    assert len(want) > 100
    assert np.array_equal(got[0], want)
    assert got[1:] == pytest.approx((amplitude, length), abs=1e-9)


def test_recorded_edges_give_the_angle_of_their_motion(tmp_path: Path) -> None:
    edges, out = tmp_path / "edges.csv", tmp_path / "mirror.csv"
    recorded(edges, 0.3)
    pairs = ", ".join(f"[{a}, {phi}]" for a, phi in HARMONICS)
    config = written(tmp_path, f"{CLOCK}[mirror]\nharmonics = [{pairs}]\n")
    result = run("--replay", str(edges), "--out", str(out), "--config", config)
    assert result.exit_code == 0, result.output
    rows = table(out)
    assert {row["angle_true_rad"] for row in rows} == {row["amplitude_true_rad"] for row in rows}
    assert {row["angle_true_rad"] for row in rows} == {""}
    time = column(rows, "time_s")
    want = motion(time * HERTZ - PHASE, AMPLITUDE_RAD, HARMONICS)
    error = column(rows, "angle_rad") - want
    late = time > 0.15
    assert np.sqrt(np.mean(error[late] ** 2)) < 0.5 * STEP_S * PEAK_RAD_PER_S
    assert {row["state"] for row, is_late in zip(rows, late, strict=True) if is_late} == {"RUN"}
    assert {row["flags"] for row, is_late in zip(rows, late, strict=True) if is_late} == {""}
    assert np.all(column(rows, "frequency_hz") == pytest.approx(HERTZ, abs=1e-6))
    assert np.allclose(column(rows, "amplitude_rad")[late], AMPLITUDE_RAD, rtol=1e-4)


def test_a_mirror_that_does_not_start_ends_in_fault(tmp_path: Path) -> None:
    """Too little drive: the table is written, the fault named, the exit status 1."""
    out = tmp_path / "mirror.csv"
    text = "[mirror]\nsweep_level = 0.2\nsettle_timeout_s = 0.05\n"
    result = run("--out", str(out), "--config", written(tmp_path, CLOCK + text))
    assert result.exit_code == 1
    assert "did not settle in time" in result.output
    assert table(out)[-1]["state"] == "FAULT"


def test_a_recorded_motion_gives_its_harmonics(tmp_path: Path) -> None:
    """What ``calibrate mirror`` prints is a configuration with the motion's own numbers."""
    hertz, file = 249.0012, tmp_path / "motion.csv"
    time = np.arange(0.0, 0.2, 1 / 37_400)
    angle = motion(time * hertz - PHASE, AMPLITUDE_RAD, HARMONICS)
    rows = "".join(f"{t:.9f},,{a:.10f}\n" for t, a in zip(time, angle, strict=True))
    file.write_text("time_s,other,seen\n0,,\n" + rows)
    arguments = ["calibrate", "mirror", str(file), "--column", "seen", "--from", "0.01"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = load(Path(written(tmp_path, result.output))).mirror
    assert found.frequency_hz == pytest.approx(hertz, abs=1e-5)
    assert math.radians(found.amplitude_deg) == pytest.approx(AMPLITUDE_RAD, rel=1e-8)
    for got, want in zip(found.harmonics, HARMONICS, strict=False):
        assert got[0] == pytest.approx(want[0], abs=1e-8)
        if want[0]:
            assert got[1] == pytest.approx(want[1], abs=1e-3)


BAD_MOTIONS = {
    "missing": (None, "motion.csv"),
    "column": ("time_s,angle\n0,0\n", "no column angle_rad"),
    "text": ("time_s,angle_rad\n0,now\n", "is no number"),
    "nothing": ("time_s,angle_rad\n0,\n", "no angle_rad from 0 s on"),
    "few": ("time_s,angle_rad\n0,0.1\n", "1 samples, needs"),
}


@pytest.mark.parametrize("name", BAD_MOTIONS)
def test_a_motion_that_cannot_be_fitted_is_one_line(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text, words = BAD_MOTIONS[name]
    file = tmp_path / "motion.csv"
    if text is not None:
        file.write_text(text)
    assert ended(monkeypatch, "calibrate", "mirror", str(file)) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error


BAD = {
    "drop": (["--drop", "1"], ["--drop", "1"]),
    "seconds": (["--seconds", "0"], ["--seconds", "0"]),
    "not_a_number": (["--drift", "nan"], ["--drift", "nan"]),
    "shock": (["--shock", "1e9"], ["--shock", "1e+09"]),
    "jitter": (["--jitter-ns", "-1"], ["--jitter-ns", "-1"]),
    "both": (["--replay", "EDGES", "--drift", "0.1"], ["--replay", "--drift"]),
    "missing": (["--replay", "none.csv"], ["none.csv"]),
    "config": (["--config", "none.toml"], ["none.toml"]),
}


@pytest.mark.parametrize("name", BAD)
def test_what_the_user_got_wrong_is_one_line(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, words = BAD[name]
    monkeypatch.chdir(tmp_path)
    assert ended(monkeypatch, "mirror", "--out", "mirror.csv", *arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert all(word in error for word in words), error
    assert list(tmp_path.iterdir()) == []


def test_a_mark_out_of_reach_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    config = written(tmp_path, "[mirror]\nindex_deg = 20.5\n")
    out = tmp_path / "mirror.csv"
    assert ended(monkeypatch, "mirror", "--out", str(out), "--config", config) == 2
    assert "mirror.index_deg: 20.5" in capsys.readouterr().err
    assert not out.exists()
