"""Ghosts against hand-derived geometry, real rays, and the light that surfaces share out."""

import math
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from split_light import identify

from vrscan.data.arrays import Floats
from vrscan.data.errors import InputError
from vrscan.scene.ghosts import Ghosts, Stack, ghosts, stack
from vrscan.scene.stray import Cover, Filter, Lens, Plate, Stray, Window

PITCH_MM = 0.007
FAR = np.array(np.inf)


def _thin(**parts: Plate) -> Stack:
    """A thin lens of 25 mm, f/3, with the stop at it, and the parts named."""
    values = {"enabled": [*parts, "sensor"], "lens": Lens(kind="thin"), **parts}
    return stack(Stray.model_validate(values))


def _row(found: Ghosts, name: str) -> int:
    return found.names.index(name)


def _real(
    built: Stack, route: list[tuple[int, int]], y: float, slope: float, travel: float
) -> Floats:
    """Trace a real ray in the meridian, exact spheres and Snell's law; y where it meets each.

    Tilted faces turn about their vertices.
    """
    place = np.cumsum([0.0] + [surface.gap_mm for surface in built.surfaces[:-1]])
    place[built.moving + 1 :] += travel
    z, met = 0.0, []
    for index, way in route:
        face = built.surfaces[index]
        # In the frame of the face: z' along its axis, which leans by its tilt.
        turn = face.tilt_rad
        cosine, sine = math.cos(turn), math.sin(turn)
        dy, dz = y, z - place[index]
        local_y, local_z = dy * cosine + dz * sine, dz * cosine - dy * sine
        angle = math.atan(slope) + turn
        local_slope = math.tan(angle)
        for _ in range(30):
            height = local_y - local_slope * local_z
            bend = face.curvature
            sag = bend * local_y**2 / (1.0 + math.sqrt(1.0 - (bend * local_y) ** 2))
            local_z, local_y = sag, height + local_slope * sag
        lean = math.asin(bend * local_y)  # of the normal towards -y
        incidence = angle + lean
        if way == 0:
            angle = -incidence - lean
        else:
            ratio = face.before / face.after if way > 0 else face.after / face.before
            angle = math.asin(ratio * math.sin(incidence)) - lean
        y = local_y * cosine - local_z * sine
        z = place[index] + local_z * cosine + local_y * sine
        met.append(y)
        slope = math.tan(angle - turn)
    return np.array(met)


def _route(built: Stack, near: int, far: int) -> list[tuple[int, int]]:
    back = [(k, -1) for k in range(far - 1, near, -1)]
    on = [(k, 1) for k in range(near + 1, len(built.surfaces))]
    return [(k, 1) for k in range(far)] + [(far, 0), *back, (near, 0), *on]


def test_ghosts_of_the_cover_lie_where_the_plate_puts_them() -> None:
    cover = Cover(thickness_mm=0.8, index=1.6, gap_mm=1.2)
    field = np.linspace(-7.0, 7.0, 15)
    found = ghosts(_thin(cover=cover), FAR, FAR, field)
    paths = {
        "cover 2 + sensor": 2.0 * 1.2,
        "cover 1 + sensor": 2.0 * (1.2 + 0.8 / 1.6),
        "cover 1 + cover 2": 2.0 * 0.8 / 1.6,
    }
    assert set(found.names) == set(paths)
    for name, path in paths.items():
        row = _row(found, name)
        offset = path * field / 25.0 / PITCH_MM
        radius = path / (2.0 * 3.0) / PITCH_MM
        print(f"{name}: {found.offset_px[row, -1]:.3f} px of {offset[-1]:.3f}")
        assert found.offset_px[row] == pytest.approx(offset, abs=1e-8)
        assert found.blur_px[row] == pytest.approx(np.full(15, radius), rel=1e-9)
        assert np.abs(found.across_px[row]).max() == 0.0


def test_a_tilted_cover_throws_its_ghosts_aside() -> None:
    tilt, across = math.radians(0.8), math.radians(-0.3)
    cover = Cover(thickness_mm=0.8, index=1.6, gap_mm=1.2, tilt_deg=0.8, across_deg=-0.3)
    field = np.array([-3.0, 0.0, 3.0])
    found = ghosts(_thin(cover=cover), FAR, FAR, field)
    row = _row(found, "cover 2 + sensor")
    slope = (field - 0.8 * (1.0 / 1.6 - 1.0) * tilt) / 25.0  # the plate shifts the image, too
    offset = (2.0 * slope - 2.0 * tilt) * 1.2 / PITCH_MM
    assert found.offset_px[row] == pytest.approx(offset, abs=1e-8)
    slope_across = -0.8 * (1.0 / 1.6 - 1.0) * across / 25.0
    expected = (2.0 * slope_across - 2.0 * across) * 1.2 / PITCH_MM
    assert found.across_px[row] == pytest.approx(np.full(3, expected), abs=1e-8)
    # Two faces that are parallel send light on in its direction.
    row = _row(found, "cover 1 + cover 2")
    inside = slope / 1.6 + (1.0 / 1.6 - 1.0) * tilt
    assert found.offset_px[row] == pytest.approx(2.0 * 0.8 * (inside + tilt) / PITCH_MM, abs=1e-8)


def test_a_wedged_filter_throws_its_ghost_by_twice_index_and_wedge() -> None:
    built = _thin(filter=Filter(tilt_deg=0.0, wedge_deg=0.1))
    found = ghosts(built, FAR, FAR, np.array([0.0]))
    row = _row(found, "filter 1 + filter 2")
    predicted = 2.0 * 1.5143 * math.radians(0.1) * 25.0 / PITCH_MM
    print(f"{found.offset_px[row, 0]:.3f} px of {predicted:.3f}")
    assert abs(found.offset_px[row, 0]) == pytest.approx(predicted, rel=1e-6)
    assert found.blur_px[row, 0] < 1e-6


def test_the_stop_clips_what_returns_to_it() -> None:
    built = _thin(window=Window(gap_mm=6.0, back_reflectance=0.0))
    field = np.linspace(-5.0, 5.0, 41)
    found = ghosts(built, FAR, FAR, field)
    row = _row(found, "window 1 + sensor")
    radius = 25.0 / 6.0
    # Light that u on the sensor sends back meets the stop around 2 u; on its way from the window to
    # the sensor it is nearer to the axis, and the stop takes no more of it.
    lost = np.minimum(np.abs(2.0 * field) / (2.0 * radius), 1.0)
    common = 2.0 / math.pi * (np.arccos(lost) - lost * np.sqrt(1.0 - lost**2))
    bare = 0.005 * 0.2
    assert found.power[row] == pytest.approx(bare * common, abs=1e-12)
    assert common.min() == 0.0 and common.max() == 1.0


PAIRS = [
    ("lens 2", "lens 4"),
    ("lens 1", "lens 6"),
    ("lens 6", "sensor"),
    ("filter 1", "cover 2"),
    ("window 2", "sensor"),
    ("lens 3", "lens 5"),
    ("window 1", "window 2"),
]


@pytest.mark.parametrize("distance", [300.0, 1000.0])
def test_ghosts_of_the_lens_agree_with_real_rays_at_small_angles(distance: float) -> None:
    built = stack(
        Stray(
            filter=Filter(tilt_deg=0.01, wedge_deg=0.004),
            cover=Cover(tilt_deg=-0.008),
            least_density=0.0,
        )
    )
    focus, field = np.array(500.0), np.array(0.02)
    travel = float(built.travel(focus))
    found = ghosts(built, focus, np.array(distance), field)
    names = [surface.name for surface in built.surfaces]
    straight = [(k, 1) for k in range(len(names))]
    step = 1e-4

    def linear(route: list[tuple[int, int]], at: int) -> Floats:
        """Return A, B, C of y at a step of the route by real rays."""
        rest = _real(built, route, 0.0, 0.0, travel)[at]
        by_y = (
            _real(built, route, step, 0.0, travel)[at] - _real(built, route, -step, 0.0, travel)[at]
        )
        by_slope = (
            _real(built, route, 0.0, step, travel)[at] - _real(built, route, 0.0, -step, travel)[at]
        )
        return np.array([by_y / (2.0 * step), by_slope / (2.0 * step), rest])

    stop, end = linear(straight, built.stop), linear(straight, -1)
    chief = np.linalg.solve([stop[:2], end[:2]], [-stop[2], float(field) - end[2]])
    pupil = stop[1] / stop[0]
    edge = stop[0] * 25.0 / 6.0  # height in the stop of a ray at the rim of the pupil, at infinity
    slope = edge / (stop[0] * distance)
    rim = np.array([(distance - pupil) * slope, slope])
    for pair in PAIRS:
        ghost = linear(_route(built, names.index(pair[0]), names.index(pair[1])), -1)
        offset = (ghost[:2] @ chief + ghost[2] - float(field)) / PITCH_MM
        blur = abs(ghost[:2] @ rim) / PITCH_MM
        row = _row(found, " + ".join(pair))
        got = float(found.offset_px[row]), float(found.blur_px[row])
        print(f"{pair}: {got[0]:.4f} px of {offset:.4f}, disc {got[1]:.4f} of {blur:.4f}")
        assert got[0] == pytest.approx(offset, rel=2e-3, abs=2e-3)
        assert got[1] == pytest.approx(blur, rel=1e-4, abs=1e-4)


def test_the_lens_has_its_focal_length_and_a_spot_worth_the_name() -> None:
    built = stack(Stray(enabled=["lens"]))
    straight = [(k, 1) for k in range(len(built.surfaces))]
    travel = float(built.travel(FAR))
    assert travel == pytest.approx(0.0, abs=1e-9)
    image = _real(built, straight, -1e-4 * built.pupil_mm, 1e-4, travel)[-1]
    assert image / 1e-4 == pytest.approx(25.0, rel=1e-5)
    # On axis, f/3, real rays in the meridian, each weighted by its ring of the pupil.
    heights = np.sqrt((np.arange(20) + 0.5) / 20.0) * 25.0 / 6.0
    best = math.inf
    for shift in np.linspace(-0.4, 0.1, 51):
        landed = [_real(built, straight, height, 0.0, shift)[-1] for height in heights]
        best = min(best, math.sqrt(float(np.mean(np.square(landed)))))
    print(f"spot on axis: {1e3 * best:.1f} um rms")
    assert best < 0.006


def test_focus_is_where_the_direct_image_is_sharp() -> None:
    built = _thin()
    distance = np.array([200.0, 400.0, 1000.0])
    assert built.travel(distance) == pytest.approx(25.0**2 / (distance - 25.0), rel=1e-9)
    triplet = stack(Stray())
    straight = [(k, 1) for k in range(len(triplet.surfaces))]
    for far in distance:
        travel = float(triplet.travel(np.array(far)))
        slope = 1e-3 / far
        y = (far - triplet.pupil_mm) * slope  # from a point on the axis
        assert abs(_real(triplet, straight, y, slope, travel)[-1]) < 1e-11


def test_plates_share_out_all_the_light() -> None:
    cover = Cover(front_reflectance=0.3, back_reflectance=0.4)
    built = stack(
        Stray(
            enabled=["cover"],
            lens=Lens(kind="thin", reflectance=0.0),
            cover=cover,
            least_power=1e-12,
        )
    )
    found = identify(built, focus_mm=400.0, distance_mm=400.0, field_mm=2.0, least_power=1e-10)
    # 1 + r + r^2 .. of the direct light, r = 0.12, in images of 2, 4, 6 .. reflections.
    total = sum(ghost.power for ghost in found)
    assert total == pytest.approx(0.12 / 0.88, rel=1e-9)
    assert built.total == pytest.approx(0.12 / 0.88, rel=1e-12)
    assert found[0].name == "cover 1 + cover 2"
    assert [ghost.times for ghost in found[:4]] == [(1, 1), (2, 2), (3, 3), (4, 4)]
    assert found[1].name == "cover 1 x2 + cover 2 x2"


def test_powers_are_products_of_the_reflectances() -> None:
    built = stack(Stray())
    found = ghosts(built, FAR, FAR, np.array([0.0]))
    kept = {surface.name: 1.0 - surface.reflectance for surface in built.surfaces}
    row = _row(found, "filter 1 + cover 2")
    between = [name for name in kept if name in ("filter 2", "cover 1") or name.startswith("lens")]
    assert len(between) == 8
    bare = 0.05 * 0.01 * math.prod(kept[name] for name in between) ** 2
    assert built.bare[built.paths.index(((2, 11),))] == pytest.approx(bare, rel=1e-12)
    assert found.power[row, 0] <= bare
    assert found.power[_row(found, "cover 2 + sensor"), 0] == pytest.approx(0.01 * 0.2, rel=1e-12)
    # All that is brought back to the sensor is less than what the first reflections took.
    assert built.total < sum(surface.reflectance for surface in built.surfaces)


def test_taking_surfaces_out_one_at_a_time_finds_the_pairs() -> None:
    built = stack(Stray(enabled=["window", "filter", "cover", "sensor"]))
    least, spot = 1e-6, {"focus_mm": 400.0, "distance_mm": 350.0, "field_mm": 0.3}
    found = identify(built, **spot, least_power=least)
    array = ghosts(built, *(np.array(spot[key]) for key in spot))
    twofold = {ghost.name: ghost for ghost in found if sum(ghost.times) == 2}
    listed = {
        name: k
        for k, name in enumerate(array.names)
        if float(array.power[k]) >= least and ", " not in name and not name.endswith(" x2")
    }
    assert set(twofold) == set(listed)
    assert len(listed) >= 15
    for name, k in listed.items():
        ghost = twofold[name]
        # Weaker ones of four reflections fall on some: the same two ways through the cover in turn.
        assert ghost.power == pytest.approx(float(array.power[k]), rel=2e-3)
        assert ghost.offset_px == pytest.approx(float(array.offset_px[k]), abs=1e-6)
        assert ghost.blur_px == pytest.approx(float(array.blur_px[k]), abs=1e-6)
    assert any(sum(ghost.times) == 4 for ghost in found)


def test_every_order_of_reflections_is_counted() -> None:
    """All ways of light, walked surface by surface, against the paths and their powers."""
    built = stack(Stray(enabled=["window", "filter", "cover", "sensor"], least_power=1e-7))
    kept = [1.0 - surface.reflectance for surface in built.surfaces]
    active = [k for k, surface in enumerate(built.surfaces) if surface.reflectance > 0.0]
    straight = math.prod(kept[:-1])
    counted = {}
    for length in (2, 4):
        for turns in product(active, repeat=length):
            stops = [-1, *turns, len(kept) - 1]
            ways = [b - a for a, b in pairwise(stops)]
            if any(way * (-1) ** k <= 0 for k, way in enumerate(ways[:-1])) or ways[-1] < 0:
                continue
            if turns[-1] == len(kept) - 1:  # the sensor is where the light ends
                continue
            power = math.prod(built.surfaces[k].reflectance for k in turns)
            for a, b in pairwise(stops):
                power *= math.prod(kept[min(a, b) + 1 : max(a, b)])
            doubles = tuple(zip(turns[1::2], turns[::2], strict=True))
            if power / straight >= 1e-7:
                counted[doubles] = power / straight
    known = {p: b for p, b in zip(built.paths, built.bare, strict=True) if len(p) < 3}
    print(f"{len(counted)} ways of 2 and 4 reflections, {len(built.paths)} in all")
    assert len(counted) > 100 and max(map(len, built.paths)) == 3
    assert set(known) == set(counted)
    assert all(known[p] == pytest.approx(counted[p], rel=1e-12) for p in known)
    # And all of them, followed until the light is gone, bring what the series has.
    weak = replace(built, least_power=1e-11)
    assert weak.bare.sum() == pytest.approx(built.total, rel=1e-5)
    assert weak.bare.sum() < built.total


def test_ghosts_of_four_reflections_lie_where_split_light_finds_them() -> None:
    built = stack(
        Stray(
            enabled=["filter", "cover", "sensor"],
            filter=Filter(tilt_deg=0.4, wedge_deg=0.05),
            cover=Cover(tilt_deg=0.1),
            least_power=1e-8,
            least_density=0.0,
        )
    )
    spot = {"focus_mm": 400.0, "distance_mm": 350.0, "field_mm": 0.3}
    found = identify(built, **spot, least_power=1e-7)
    array = ghosts(built, *(np.array(spot[key]) for key in spot))
    fourfold = [ghost for ghost in found if sum(ghost.times) == 4 and ghost.power > 1e-6]
    seen = 0
    for ghost in fourfold:
        near = np.abs(array.offset_px - ghost.offset_px) < 1e-3
        near &= np.abs(array.blur_px - ghost.blur_px) < 1e-3
        near &= np.abs(array.across_px - ghost.across_px) < 1e-3
        if abs(ghost.offset_px) < 800.0:
            seen += 1
            assert array.power[near].sum() == pytest.approx(ghost.power, rel=2e-2), ghost.name
    print(f"{seen} ghosts of four reflections on the sensor")
    assert seen >= 5
    assert any(", " in name for name in array.names)
    assert any(name.endswith(" x2") for name in array.names)


def test_an_array_is_the_same_as_one_spot_at_a_time() -> None:
    built = stack(
        Stray(window=Window(tilt_deg=1.0, across_deg=0.02), least_power=1e-5, least_density=0.0)
    )
    focus = np.array([300.0, 500.0])[:, None, None]
    distance = np.array([250.0, 400.0, 1000.0])[:, None]
    field = np.array([-6.0, -0.5, 0.0, 2.0])
    cube = ghosts(built, focus, distance, field)
    assert cube.power.shape == (len(cube.names), 2, 3, 4)
    assert cube.dropped.shape == (2, 3, 4)
    for i, j, k in ((0, 0, 0), (1, 2, 3), (0, 1, 2), (1, 0, 1)):
        one = ghosts(built, focus[i, 0, 0], distance[j, 0], field[k])
        for row, name in enumerate(cube.names):
            if name not in one.names:
                assert cube.power[row, i, j, k] == 0.0
                continue
            at = _row(one, name)
            for attribute in ("offset_px", "across_px", "blur_px", "power"):
                whole, single = getattr(cube, attribute), getattr(one, attribute)
                assert float(single[at]) == pytest.approx(whole[row, i, j, k], rel=1e-9, abs=1e-9)
        assert float(one.dropped) == pytest.approx(cube.dropped[i, j, k], rel=1e-9, abs=1e-15)


def test_what_is_dropped_is_counted() -> None:
    field = np.array([0.0, 3.0])
    whole = ghosts(stack(Stray(least_power=0.0, least_density=0.0)), FAR, np.array(400.0), field)
    built = stack(Stray(least_power=1e-4, least_density=0.0))
    few = ghosts(built, FAR, np.array(400.0), field)
    assert 0 < len(few.names) < len(whole.names)
    assert set(few.names) < set(whole.names)
    weak = built.total - built.bare[built.bare >= 1e-4].sum()
    # What misses the sensor is dropped in both, and so is what the threshold takes.
    assert (few.dropped >= weak * (1.0 - 1e-12)).all()
    assert (few.power.sum(axis=0) + few.dropped <= built.total * (1.0 + 1e-12)).all()
    # By default the wide discs of the lens go too, which together would add less than this a pixel.
    default = ghosts(stack(Stray()), FAR, np.array(400.0), field)
    thin = [k for k, name in enumerate(whole.names) if name not in default.names]
    density = whole.power[thin] / (math.pi * np.maximum(np.square(whole.blur_px[thin]), 1.0))
    print(f"{len(thin)} of {len(whole.names)} dropped: {density.sum(axis=0).max():.1e} a pixel")
    assert len(thin) > 40
    assert density.sum(axis=0).max() < 1e-8
    aside = stack(Stray(enabled=["window"], window=Window(wedge_deg=5.0)))
    away = ghosts(aside, FAR, FAR, np.array([0.0])).offset_px[0, 0]
    gone = ghosts(aside, FAR, FAR, np.array([math.copysign(6.0, away)]))
    assert gone.names == () and gone.power.shape == (0, 1)
    assert gone.dropped[0] == pytest.approx(aside.total, rel=1e-12)


def test_spots_that_are_not_there_have_dark_finite_ghosts() -> None:
    built = stack(Stray())
    field = np.array([0.0, np.nan, 1.0, 1.0, 1.0, 500.0])
    distance = np.array([400.0, 400.0, -5.0, np.nan, 0.0, 400.0])
    found = ghosts(built, np.full(6, 400.0), distance, field)
    for values in (found.offset_px, found.across_px, found.blur_px, found.power, found.dropped):
        assert np.isfinite(values).all()
    assert found.power[:, 0].sum() > 0.0
    assert (found.power[:, 1:5] == 0.0).all()
    without = ghosts(stack(Stray(enabled=[])), FAR, FAR, np.zeros(3))
    assert without.names == () and without.power.shape == (0, 3)


def test_the_cover_must_fit_behind_the_lens() -> None:
    with pytest.raises(InputError, match=r"^stray\.cover: needs .* mm more than"):
        stack(Stray(cover=Cover(gap_mm=40.0)))
    with pytest.raises(InputError, match=r"^stray\.lens: "):
        stack(Stray(lens=Lens(radii_mm=[-9.0, 9.0], spacing_mm=[2.0], index=[1.5], stop=1)))


def test_a_longer_focal_length_scales_the_lens() -> None:
    only = Stray(enabled=["lens"], least_density=0.0)
    short, long = stack(only), stack(only, focal_mm=50.0)
    assert long.stop_mm == pytest.approx(2.0 * short.stop_mm, rel=1e-9)
    field = np.array([1.0])
    near, wide = ghosts(short, FAR, FAR, field), ghosts(long, FAR, FAR, 2.0 * field)
    row = _row(near, "lens 4 + lens 5")
    other = _row(wide, "lens 4 + lens 5")
    assert wide.offset_px[other] == pytest.approx(2.0 * near.offset_px[row], rel=1e-9)
    assert wide.blur_px[other] == pytest.approx(2.0 * near.blur_px[row], rel=1e-9)
    slow = ghosts(stack(only, f_number=6.0), FAR, FAR, field)
    assert slow.blur_px[row] == pytest.approx(0.5 * near.blur_px[row], rel=1e-9)
