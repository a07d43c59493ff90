"""The correction maps: a lens error that is known is found, and nodes without points are told."""

import numpy as np
import pytest
from synthetic import CONFIG, plane, relief, scanned

from vrscan.calibrate import field_map, results, verify
from vrscan.calibrate.recording import Recording
from vrscan.data.correction_maps import FieldMaps, extension_mm, focus_of_mm, read_maps
from vrscan.data.errors import InputError
from vrscan.ideal.correction_map import COLUMNS, ROWS, correction
from vrscan.scene.tolerances import Instrument

OWN = Instrument(reference_focus_mm=420.0)
FOCAL = CONFIG.geometry.focal_mm
FOCI = [focus_of_mm(place, FOCAL) for place in (1.2, 1.712, 2.224)]


def lens(angle: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return a smooth error of the lens, px; what a position lacks is minus that."""
    return 0.8 * np.sin(position / 400.0) + 2.0 * angle


@pytest.fixture(scope="module")
def planes() -> list[Recording]:
    found = []
    for k, focus in enumerate(FOCI):
        place = extension_mm(focus, FOCAL)
        for j, off in enumerate((0.2, 0.0, -0.2)):
            z = round(focus_of_mm(place + off, FOCAL), 1)
            found.append(scanned(plane(z, focus), OWN, 10 * k + j, lens=lens))
    return found


@pytest.fixture(scope="module")
def maps(planes: list[Recording]) -> FieldMaps:
    return field_map.calibrate(planes, CONFIG)


def test_it_finds_the_error_of_the_lens(planes: list[Recording], maps: FieldMaps) -> None:
    """Where points are, the map is minus the error, with the image's scale at its focus."""
    for each in planes:
        angle = each.angle_rad
        at = np.full(len(each), maps.lens(each.setup.focus_mm))
        found = correction(each.position_px, angle, at, maps.corrections_px, line_length=2048)
        scale = OWN.true(CONFIG, each.setup.focus_mm).geometry.focal_mm / FOCAL
        clean = each.position_px - lens(angle, each.position_px)
        wanted = (clean - CONFIG.geometry.centre_px) / scale + CONFIG.geometry.centre_px
        off = found - (wanted - each.position_px)
        print(f"{each.name}: {off.std():.4f} px rms, at most {np.abs(off).max():.3f}")
        assert off.std() < 0.02


def test_a_focus_between_two_maps_has_no_jump(maps: FieldMaps) -> None:
    """A plane in focus between two maps is as good as at one: the maps are straight between."""
    place = 1.2 + 0.256
    focus = focus_of_mm(place, FOCAL)
    scan = scanned(plane(focus, focus), OWN, 77, lens=lens)
    with_maps, without = (verify.verified(scan, CONFIG, each) for each in (maps, None))
    print(f"{with_maps.plane_percent:.4f} % with maps, {without.plane_percent:.3f} % without")
    # 1 / (f + way) bends by 0.13 px from the middle to the sensor's end, over 0.512 mm.
    assert with_maps.plane_percent < 0.06 < without.plane_percent


def test_nodes_without_points_are_filled_and_told(planes: list[Recording], maps: FieldMaps) -> None:
    assert maps.filled.shape == (3, ROWS, COLUMNS)
    assert np.isfinite(maps.corrections_px).all()
    assert 0.5 < maps.filled.mean() < 0.99
    # The mirror never reaches the outer nodes; what is filled there stays near to what is known.
    assert maps.filled[:, [0, -1]].all()
    assert np.abs(maps.corrections_px).max() < 64.0
    assert np.abs(maps.words() * 2.0**-10 - maps.corrections_px).max() <= 2.0**-11
    for each in planes:
        column = (each.position_px / 32.0).astype(int)
        row = (each.angle_rad / (2 * np.pi / 256) + 16).astype(int)
        k = FOCI.index(each.setup.focus_mm)
        assert maps.filled[k, row, column].mean() < 0.1


def test_maps_are_read_back(maps: FieldMaps, tmp_path) -> None:
    path = tmp_path / "map.npz"
    with path.open("wb") as file:
        results.write_maps(maps, {"made_by": "a test"}, file)
    held = read_maps(path)
    assert np.array_equal(held.corrections_px, maps.corrections_px)
    assert np.array_equal(held.filled, maps.filled)
    assert held.lens(400.0) == maps.lens(400.0)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"map\.npz: no correction maps"):
        read_maps(path)


def test_what_cannot_work_is_refused(planes: list[Recording]) -> None:
    uneven = scanned(plane(500.0, 700.0), OWN, 1), scanned(plane(600.0, 700.0), OWN, 2)
    for scans, wanted in (
        (planes[:3], "1 focus position"),
        (planes[::3], "1 distance at this focus"),
        ([*planes, *uneven], "not evenly spaced"),
        ([*planes, scanned(relief(400.0, FOCI[0]), OWN, 1)], "the map needs a plane"),
    ):
        with pytest.raises(InputError, match=wanted):
            field_map.calibrate(scans, CONFIG)
