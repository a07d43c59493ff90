"""The tables of a laser against the sun: every figure is that of its outlook."""

import csv
import io
import re

import pytest
from PIL import Image
from rich.console import Console

from vrscan.data.errors import InputError
from vrscan.scene.site import Moment, Outlook, Site, eye_limits_w, load
from vrscan.scene.sun import Sun
from vrscan.study.report import detectability_report as report


def shown(found: list[Outlook]) -> str:
    console = Console(width=120, file=io.StringIO())
    console.print(report.report(found))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_paper_is_shown_beside_its_own_errors() -> None:
    found = report.outlooks(load(None))
    text = shown(found)
    assert "…" not in text
    for words in ("14.0 % at 12:30", "13.6 % at 14:30", "-26.7 %", "-56.9 %", "58.5 %", "39.5 %"):
        assert words in text
    # The paper prints no measurement: what its errors say is not shown as one.
    assert "inferred" in text and "measured" not in text
    rows = [
        line
        for line in text.splitlines()
        if re.match(r"2015-06-24 \d\d:\d\d, in \w+( sun)?  ", line)
    ]
    assert len(rows) == 2 + 6
    for k, line in enumerate(rows[2:]):
        outlook, index = found[k // 3], k % 3
        numbers = [float(word) for word in re.findall(r"[-+]?\d+(?:\.\d+)?", line)[5:]]
        model, reference = outlook.model[index], outlook.reference[index]
        want = [
            outlook.site.range_mm[index], outlook.laser_w_m2[index], model,
            outlook.direct_sun[index], reference, 100.0 * (model / reference - 1.0),
            100.0 * (outlook.direct_sun[index] / reference - 1.0),
            1e3 * outlook.least_w[index], 1e3 * outlook.printed_least_w[index],
        ]  # fmt: skip
        assert numbers == pytest.approx(want, rel=5e-3, abs=0.06)
    near = eye_limits_w(load(None).laser, 500.0, 10.0)
    (line,) = (line for line in text.splitlines() if line.strip().startswith("10 "))
    assert [float(word) for word in line.split()[1:3]] == pytest.approx(
        [1e3 * each for each in near], abs=0.06
    )


def test_file_holds_every_time_and_range() -> None:
    found = report.outlooks(load(None))
    rows = list(csv.DictReader(io.StringIO(report.csv_file(found).decode())))
    assert len(rows) == 6
    for k, row in enumerate(rows):
        outlook, index = found[k // 3], k % 3
        assert row["time"] == outlook.moment.time.isoformat()
        parts = sum(float(row[f"{name}_w_m2"]) for name in ("direct", "sky", "ground", "facades"))
        assert parts == pytest.approx(float(row["sun_w_m2"]), rel=1e-4)
        assert float(row["ratio"]) == pytest.approx(outlook.model[index], rel=1e-5)
        assert float(row["least_as_printed_w"]) == pytest.approx(
            outlook.printed_least_w[index], rel=1e-5
        )
        assert float(row["eye_10s_w"]) == pytest.approx(0.0896, rel=1e-3)


def spot(**tables: object) -> Site:
    values = {
        "laser": {"wavelength_nm": 658, "power_mw": 50, "diameter_mm": 1, "divergence_mrad": 1}
    }
    return Site.model_validate(values | tables)


def test_spot_without_a_measurement_has_neither_errors_nor_a_limit() -> None:
    site = spot(moment=[Moment(time=load(None).sun.time)])
    found = report.outlooks(site)
    text = shown(found)
    assert "there is no limit for a spot" in text
    assert "measured" not in text and "inferred" not in text
    assert b"eye" not in report.csv_file(found).splitlines()[0]


def test_own_measurement_is_shown_as_one() -> None:
    time = load(None).sun.time
    text = shown(report.outlooks(Site(moment=[Moment(time=time, measured_w_m2=480.0)])))
    assert "measured" in text and "inferred" not in text and "480" in text
    with pytest.raises(ValueError, match="one of the two"):
        Moment(time=time, measured_w_m2=480.0, inferred_w_m2=459.0)


def test_line_of_visible_light_says_why_it_has_no_limit() -> None:
    site = Site(laser=load(None).laser.model_copy(update={"wavelength_nm": 658.0}))
    assert "wavelength_nm = 658: (5) is for 700 to 1050 nm" in shown(report.outlooks(site))


def test_night_is_refused() -> None:
    night = Moment.model_validate({"time": "2015-06-24T23:00:00+08:00"})
    with pytest.raises(InputError, match="below the horizon"):
        report.outlooks(Site(moment=[night]))


@pytest.mark.parametrize("sky", ["clear", "given"])
def test_picture_has_a_panel_for_each_time(sky: str) -> None:
    given = {"sky": "given", "ghi_w_m2": 700.0, "dhi_w_m2": 300.0} if sky == "given" else {}
    sun = Sun.model_validate({"skyline_deg": 20.0, **given})
    times = list(load(None).moments) * 2
    widths = []
    for count in (1, 3):
        file = io.BytesIO()
        report.picture(report.outlooks(Site(sun=sun, moment=times[:count])), file)
        picture = Image.open(file)
        assert picture.format == "PNG"
        widths.append(picture.width)
    assert widths[1] - widths[0] == 2 * 390
