"""Poses over time: what is between two of them, against rotations written out, and bad files."""

from pathlib import Path

import numpy as np
import pytest

from vrscan.data.errors import InputError
from vrscan.data.poses import read

HEAD = "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n"


def poses(text: str, folder: Path):
    path = folder / "pose.csv"
    path.write_text(text)
    return read(path)


def about(axis: int, angle: float) -> np.ndarray:
    """Return the matrix of a turn about an axis."""
    c, s = np.cos(angle), np.sin(angle)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    found = np.eye(3)
    found[one, one] = found[two, two] = c
    found[two, one], found[one, two] = s, -s
    return found


def test_the_turn_is_yaw_after_pitch_after_roll(tmp_path: Path) -> None:
    given = poses(HEAD + "0,1,2,3,10,20,30\n1,1,2,3,10,20,30\n", tmp_path)
    points = np.random.default_rng(2).normal(0.0, 100.0, (5, 3))
    roll, pitch, yaw = np.radians([10.0, 20.0, 30.0])
    turn = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    want = points @ turn.T + [1.0, 2.0, 3.0]
    assert np.allclose(given.to_world(points, np.full(5, 0.3)), want, atol=1e-9)


def test_a_quaternion_is_the_same_turn(tmp_path: Path) -> None:
    half = np.radians(35.0)
    head = "qw,qx,qy,qz,time_s,x_mm,y_mm,z_mm,note\n"  # by name, in any order
    row = f"{np.cos(half)},0,{np.sin(half)},0"
    given = poses(head + f"{row},0,0,0,0,a\n\n{row},1,0,0,0,b\n", tmp_path)
    other = poses(HEAD + "0,0,0,0,0,70,0\n1,0,0,0,0,70,0\n", tmp_path)
    points = np.eye(3)
    time = np.zeros(3)
    assert np.allclose(given.to_world(points, time), other.to_world(points, time), atol=1e-12)


def test_between_poses_place_and_turn_go_at_a_constant_rate(tmp_path: Path) -> None:
    given = poses(HEAD + "1,0,0,0,0,0,170\n3,8,0,0,0,0,-170\n4,8,5,0,0,0,-170\n", tmp_path)
    time = np.array([1.0, 1.5, 2.5, 3.0, 3.5])
    place, turn = given.at(time)
    assert np.allclose(place, [[0, 0, 0], [2, 0, 0], [6, 0, 0], [8, 0, 0], [8, 2.5, 0]])
    yaw = 2.0 * np.arctan2(turn[:, 2], turn[:, 3])
    want = np.radians([170.0, 175.0, 185.0, 190.0, 190.0])  # the short way, over 180 degrees
    assert np.allclose(np.exp(1j * yaw), np.exp(1j * want))


def test_there_is_no_pose_beyond_the_first_and_the_last(tmp_path: Path) -> None:
    given = poses(HEAD + "1,0,0,0,0,0,0\n2,0,0,0,0,0,0\n", tmp_path)
    for time in (0.99, 2.01, np.nan):
        with pytest.raises(InputError, match=r"pose\.csv: poses from 1 to 2 s, and 1 points"):
            given.at(np.array([1.5, time]))


WRONG = {
    "": ["columns none", "want time_s,x_mm,y_mm,z_mm and roll_deg"],
    "time_s,x_mm,y_mm,z_mm\n0,0,0,0\n": ["columns time_s, x_mm, y_mm, z_mm"],
    HEAD + "0,0,0,0,0,0,0\n": ["1 poses, needs 2"],
    HEAD + "0,0,0,0,0,0,0\n1,0,0,0,0,x,0\n": ["line 3: pitch_deg 'x' is no number"],
    HEAD + "0,0,0,0,0,0,0\n1,0,0,0,0\n": ["line 3: 5 fields, want 7"],
    HEAD + "0,0,0,0,0,0,0\n1,0,0,0,0,nan,0\n": ["line 3", "nan"],
    HEAD + "1,0,0,0,0,0,0\n1,0,0,0,0,0,0\n": ["line 3", "time_s 1 is not after"],
    "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,0,2\n": ["line 2", "no unit quaternion"],
}


@pytest.mark.parametrize("text", WRONG)
def test_a_bad_file_is_one_line(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        poses(text, tmp_path)
    message = str(caught.value)
    assert "\n" not in message
    for part in ["pose.csv", *WRONG[text]]:
        assert part in message, message
