"""Poses of the scanner over time, which make a cloud of a scan by a scanner that moves or pans."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.data.csv_files import finite, read_table
from vrscan.data.errors import InputError, listed
from vrscan.data.extras import named

PLACE = ("time_s", "x_mm", "y_mm", "z_mm")
ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")
QUATERNION = ("qx", "qy", "qz", "qw")
_UNIT = 0.01  # largest deviation of a quaternion's length from 1


@dataclass(frozen=True)
class Poses:
    """m poses of the scanner in the world, at rising times.

    A point p of the scanner lies at R p + t in the world.
    """

    source: str  # for messages
    time_s: Floats  # [m]
    place_mm: Floats  # t [m, 3]
    turn: Floats  # R as a unit quaternion, x, y, z, w [m, 4]

    def at(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return place, mm [n, 3], and turn, a quaternion x, y, z, w [n, 4], at n times.

        Between two poses the place moves on a straight line and the turn about one axis, both at
        a constant rate (scipy's Slerp).

        Raises:
            InputError: if a time is before the first pose or after the last one, or not known.
            MissingError: if scipy is not installed.
        """
        with named():
            from scipy.spatial.transform import Rotation, Slerp

        first, last = self.time_s[0], self.time_s[-1]
        outside = time_s[~((time_s >= first) & (time_s <= last))]
        if len(outside):
            raise InputError(
                f"{self.source}: poses from {first:g} to {last:g} s, and "
                f"{len(outside)} points beyond them, as at {outside[0]:g} s"
            )
        place = np.stack([np.interp(time_s, self.time_s, each) for each in self.place_mm.T], 1)
        turn = Slerp(self.time_s, Rotation.from_quat(self.turn))(time_s).as_quat()
        return place, np.asarray(turn)

    def to_world(self, points_mm: Floats, time_s: Floats) -> Floats:
        """Return points of the scanner [n, 3] at their times [n] in the world, mm [n, 3].

        Raises:
            InputError, MissingError: as ``at``.
        """
        with named():
            from scipy.spatial.transform import Rotation

        place, turn = self.at(time_s)
        return np.asarray(Rotation.from_quat(turn).apply(points_mm) + place)


def read(path: Path) -> Poses:
    """Return poses from a CSV file.

    Args:
        path: A file with the columns ``PLACE``, and ``ANGLES`` or ``QUATERNION``, and two rows or
            more of rising time. The turn is yaw about z after pitch about y after roll about x:
            R = Rz(yaw) Ry(pitch) Rx(roll).

    Raises:
        InputError: naming the file, and the line if one is wrong.
        MissingError: if scipy is not installed.
    """
    with named():
        from scipy.spatial.transform import Rotation

    table = read_table(path)
    turns = next((each for each in (ANGLES, QUATERNION) if set(each) <= set(table.names)), ())
    if not set(PLACE) <= set(table.names) or not turns:
        wanted = f"{','.join(PLACE)} and {','.join(ANGLES)} or {','.join(QUATERNION)}"
        raise InputError(f"{path}: columns {listed(table.names)}, want {wanted}")
    table.need((*PLACE, *turns))
    values = np.stack([table.column(name, finite) for name in (*PLACE, *turns)], 1)
    late = np.flatnonzero(np.diff(values[:, 0]) <= 0.0) + 1
    if len(late):
        told = f"time_s {values[late[0], 0]:g} is not after the row above"
        raise InputError(f"{path}: line {table.line[late[0]]}: {told}")
    off = np.abs(np.linalg.norm(values[:, 4:], axis=1) - 1.0) > _UNIT
    if turns == QUATERNION and off.any():
        row = int(off.argmax())
        raise InputError(f"{path}: line {table.line[row]}: no unit quaternion ({values[row, 4:]})")
    if len(values) < 2:
        raise InputError(f"{path}: {len(values)} poses, needs 2")
    if turns == ANGLES:
        turn = Rotation.from_euler("ZYX", values[:, [6, 5, 4]], degrees=True).as_quat()
    else:
        turn = Rotation.from_quat(values[:, 4:]).as_quat()
    return Poses(str(path), values[:, 0], values[:, 1:4], np.asarray(turn))
