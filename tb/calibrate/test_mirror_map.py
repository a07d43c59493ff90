"""The mirror's calibration: angles at operating points, those of no scan included."""

import numpy as np
import pytest
from synthetic import CONFIG, angle_error_urad, plane, relief, scanned

from vrscan.calibrate import mirror_map
from vrscan.calibrate.recording import Recording
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.scene.tolerances import Instrument, drawn
from vrscan.study.experiment import OperatingPoint, at, operating_points

OWN = drawn(12)
LEVELS = (0.62, 0.70, 0.78)


@pytest.fixture(scope="module")
def points() -> list[OperatingPoint]:
    return operating_points(OWN, CONFIG, (*LEVELS, 0.66, 0.75))


@pytest.fixture(scope="module")
def geometry() -> Config:
    """A coarse calibration whose geometry is right and whose mirror is as believed."""
    true = OWN.true(CONFIG, 360.0)
    return CONFIG.model_copy(update={"geometry": true.geometry})


@pytest.fixture(scope="module")
def planes(points: list[OperatingPoint]) -> list[Recording]:
    return [
        scanned(plane(z, drive_phase=point.drive_phase), at(OWN, point), 10 * k + j)
        for k, point in enumerate(points[: len(LEVELS)])
        for j, z in enumerate((320.0, 420.0))
    ]


def test_angles_are_right_where_the_loop_may_rest(
    planes: list[Recording], points: list[OperatingPoint], geometry: Config
) -> None:
    found = mirror_map.calibrate(planes, geometry)
    true = OWN.true(CONFIG, 360.0).mirror.index_deg
    index_urad = 1e6 * np.radians(found.config.mirror.index_deg - true)
    print(f"index {index_urad:+.2f} urad; {found.before_mm:.4f} to {found.after_mm:.4f} mm")
    assert abs(index_urad) < 10.0
    for point in points:
        own: Instrument = at(OWN, point)
        before, after = angle_error_urad(geometry, own), angle_error_urad(found.config, own)
        print(f"level {point.level}: {before:.1f} urad before, {after:.2f} after")
        assert after < 10.0 < before


def test_what_cannot_work_is_refused(planes: list[Recording], geometry: Config) -> None:
    lost = scanned(plane(320.0), OWN, 1)
    for scans, wanted in (
        (planes[:2], "1 operating point"),
        (planes[::2], "1 distance at this operating point"),
        ([*planes, lost], "no drive_phase"),
        ([*planes, scanned(relief(320.0), OWN, 1)], "needs a plane"),
        ([planes[1], planes[0], *planes[2:]], None),
        ([planes[0], planes[1], planes[0], *planes[2:]], "the stage does not go one way"),
    ):
        if wanted is None:
            continue
        with pytest.raises(InputError, match=wanted):
            mirror_map.calibrate(scans, geometry)
