"""The integers that the RTL takes, against the quantities they stand for."""

import numpy as np
import pytest

from vrscan.data.config import Config, Geometry, Peak, Sensor, checked
from vrscan.data.errors import InputError
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.registers.chain_registers import Registers, angle_turns


def test_thresholds_and_gains() -> None:
    peak = Peak(k_noise=2.5, k_height=0.02, k_first=0.25, k_fit=0.15, snr_min=8.0, kappa=0.2)
    for window, share in (("threshold", 1311), ("two_pass", 16384), ("fit", 9830)):
        registers = Registers.from_config(Config(peak=peak.model_copy(update={"window": window})))
        assert registers.k_height == share
        assert (registers.window_two_pass, registers.window_fit) == (
            window != "threshold",
            window == "fit",
        )
    assert registers.k_noise == 640
    assert registers.snr_min == 2048
    assert registers.kappa == 13107
    assert registers.tolerance == 16_777  # 0.001
    assert (65_535 * registers.c_sfm_gain + 2**15) >> 16 == 255


@pytest.mark.parametrize("length", [256, 1000, 2048, 4096, 8192])
@pytest.mark.parametrize("distortion", ["odd", "even"])
def test_geometry_constants_give_the_same_triangle(length: int, distortion: str) -> None:
    geometry = Geometry(
        offset_mm=3.0,
        centre_px=0.51 * length,
        pitch_mm=14.0 / length,
        k1=2e-4,
        k2=-1e-6,
        distortion="odd" if distortion == "odd" else "even",
    )
    registers = Registers.from_config(Config(geometry=geometry, sensor=Sensor(line_length=length)))
    assert registers.ports["centre"] == round(0.51 * length * 2**20)
    position, angle = np.meshgrid(np.linspace(0, length - 1, 101), np.linspace(-0.3, 0.3, 31))
    want = triangle(undistorted(position, geometry)[0], angle, geometry)

    reach = 2.0 ** np.ceil(np.log2(length))
    share = (position - registers.centre * 2.0**-20) / reach
    k1, k2 = registers.k1 * 2.0**-24, registers.k2 * 2.0**-24
    radial = np.abs(share) if registers.even else share
    share = share + radial * (k1 * share**2 + k2 * share**4)
    n = (registers.n0 + registers.n1 * share) * 2.0**-20
    d = (registers.d0 + registers.d1 * share) * np.cos(angle)
    d = (d + (registers.e0 + registers.e1 * share) * np.sin(angle)) * 2.0**-30
    near = ~want.no_range & (want.z > 200.0) & (want.z < 1000.0)
    assert near.sum() > 500
    # Half a step of n is 0.5e-6 mm of some 60, of k1 3e-8 of 2048 px: together well below 1 um.
    assert np.abs(n * np.cos(angle) / d - want.z)[near].max() < 1e-3
    assert np.abs(n * np.sin(angle) / d - want.x)[near].max() < 1e-3


@pytest.mark.parametrize("unit_mm", [2, 4, 8])
def test_an_instrument_of_twice_the_size_has_the_same_integers(unit_mm: int) -> None:
    """The chain knows no mm: what is larger by the unit of length is the same to it."""
    small = Geometry(offset_mm=3.0)
    large = Geometry(base_mm=60.0 * unit_mm, offset_mm=3.0 * unit_mm, unit_mm=unit_mm)
    got, want = (Registers.from_config(Config(geometry=each)) for each in (large, small))
    assert got.length_unit == unit_mm
    for name in ("n0", "n1", "d0", "d1", "e0", "e1", "k1", "tolerance"):
        assert getattr(got, name) == getattr(want, name)
    assert large.range_mm == unit_mm * 2048.0
    with pytest.raises(InputError, match=r"free.far_mm = 16384: x and z end at 16384 mm"):
        checked(Config, {"geometry": {"unit_mm": 8}, "free": {"far_mm": 16384.0}}, "far.toml")


def test_angles_are_turns_and_wrap_at_half_a_turn() -> None:
    angle = np.array(
        [0.0, np.pi / 2, -np.pi / 2, np.pi, -np.pi, 2 * np.pi / 2**24, 1.2 * np.pi / 2**24]
    )
    assert angle_turns(angle).tolist() == [0, 2**22, -(2**22), -(2**23), -(2**23), 1, 1]


@pytest.mark.parametrize("angle", [np.nan, np.inf, -np.inf, 3.15, -7.0])
def test_angles_that_are_none_of_a_turn_are_refused(angle: float) -> None:
    """Beyond half a turn an angle would be another one, and what is no number would be 0."""
    with pytest.raises(InputError, match=rf"angle_rad outside -pi to pi \({angle} at line 1\)"):
        angle_turns(np.array([0.0, angle]))


def test_angles_of_other_kinds_are_refused() -> None:
    """Integers are turns or degrees by mistake; a complex number would lose half of itself."""
    for angle in (np.array([1]), np.array([True]), np.array([0.1 + 1j]), np.array(["0.1"])):
        with pytest.raises(InputError, match="must be floating point"):
            angle_turns(angle)
