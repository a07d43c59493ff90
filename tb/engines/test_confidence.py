"""C_obj against the truth of scenes: among points of C_obj c, a share c keeps the tolerance."""

from dataclasses import dataclass

import numpy as np
import pytest
from harness import EACH_VOLUME, generator, in_volume
from scanners import EACH_SCANNER, SCANNERS

from vrscan.data.config import Config
from vrscan.data.lines import Truth
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.scene.description import Description, load, shipped
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate

# The spot that a mirror shows, or onto which it throws the beam, is as good a spot as any. Where it
# is the brighter one the line cannot tell, but for its rival, and the glint of a beam that comes
# back from two mirrors, which is saturated.
MIRRORS = {"shiny-corner", "turned-metal"}
# Nor can it tell a ghost, which stands where it stands all the time.
NO_DETECTOR_KNOWS = {"window-ghost"} | MIRRORS
# Nor by how much light from beneath a surface has moved the spot.
FROM_BENEATH = {"plastic"}
FEWEST_RATIOS = 20  # points whose errors are judged: their rms is known to 16 %
FEWEST = 120  # points of a tenth of C_obj that are judged: their share is known to 0.045
DOUBTFUL = ("SATURATED", "RIVAL", "AT_EDGE")


@dataclass(frozen=True)
class Kept:
    """What a scanner keeps; the default scanner keeps what stands here.

    A preset falls short of it where another number is given, and what one seed tells of it is known
    to two standard deviations only: see Neighbours in docs/design.md.
    """

    told: float = 0.9  # share of the points far off
    again: float = 1.0  # times that each of them comes in the test's lines
    ghosts: float = 0.95  # share of those on the ghosts of window-ghost
    mirrored: float = 0.8  # share of those on other spots where there are mirrors
    careful: float = 0.1  # by which C_obj may be below the share that keeps the tolerance
    least: float = 0.8  # error over sigma
    within: float = 0.985  # largest share within 2 sigma
    lit: float | None = None  # error over sigma of window-ghost's points without a flag
    preset: bool = True


KEPT = {
    "default": Kept(preset=False),
    # Line k + 1025 meets an edge where line k does. A ghost stands beside another twice as often as
    # the default's; plane and dark, where C_obj is too careful, weigh more in the short run.
    "polygon": Kept(again=2.0, ghosts=0.85, careful=0.15, lit=2.6),
    # Its lines are twice as far apart against its spots' widths. A ghost stands beside another as
    # often as the polygon's, and of turned-metal's glints a half is saturated and not 7/8. Sigma is
    # too large: with what grains add, and in relief with the doubt.
    "metre": Kept(told=0.85, ghosts=0.75, mirrored=0.55, careful=0.15, least=0.7, within=0.99),
}


def kept_by(config: Config) -> Kept:
    """Return what a shipped scanner keeps; a new one has to keep what the default does."""
    name = next(name for name, each in SCANNERS.items() if each is config)
    return KEPT.get(name, Kept())


def fitting(config: Config) -> Config:
    """Return a scanner that fits a Gaussian, without which there are no neighbours."""
    return config.model_copy(update={"peak": config.peak.model_copy(update={"window": "fit"})})


def exposed(described: Description, config: Config) -> Description:
    """Return a scene that gives a pixel as much light as it gives one of the default scanner.

    The power of a shipped scene suits the default's pixels, and so does the time of its lines in
    the sun. A scanner whose pixels have four times the area would have most spots saturated, which
    tells of them without any rule.
    """
    default = SCANNERS["default"]
    share = (default.geometry.pitch_mm / config.geometry.pitch_mm) ** 2
    if share == 1.0:
        return described
    laser = described.laser.model_copy(update={"power_mw": share * described.laser.power_mw})
    exposure_us = share * 1e6 / default.line.rate_hz
    return described.model_copy(update={"laser": laser, "exposure_us": exposure_us})


def scanned(config: Config, scene: str, seed: int, count: int) -> tuple[Table, Truth]:
    """Return the points of a scene with a seed of its own, and the truth."""
    return points_of(config, load(scene).model_copy(update={"seed": seed}), count)


def points_of(config: Config, described: Description, count: int) -> tuple[Table, Truth]:
    """Return the points of a scene, exposed for a scanner, and the truth."""
    described = exposed(described, config)
    config = fitting(config)
    lines = simulate(Light(described, config), count, frozenset(present(described))).lines
    assert lines.truth is not None
    return run(Engine.FIXED, lines, config), lines.truth


def scene_of_chance(number: int) -> Description:
    """Return a wall with two to five boxes, cylinders and spheres before it."""
    draw = generator(number)
    wall = draw.uniform(450, 650)
    targets: list[dict[str, object]] = [
        {
            "kind": "plane",
            "position_mm": [0, 0, wall],
            "rotation_deg": [0, draw.uniform(-25, 25), 0],
        }
    ]
    for _ in range(draw.integers(2, 6)):
        size = draw.uniform(10, 40)
        shapes: list[dict[str, object]] = [
            {
                "kind": "box",
                "size_mm": [size, 80, size],
                "rotation_deg": [0, draw.uniform(-40, 40), 0],
            },
            {"kind": "cylinder", "radius_mm": size / 2, "length_mm": 100},
            {"kind": "sphere", "radius_mm": size},
        ]
        place = [draw.uniform(-100, 100), 0, draw.uniform(300, wall - 20)]
        targets.append({"position_mm": place} | shapes[draw.integers(3)])
    for k, target in enumerate(targets):
        target |= {"name": f"target {k}", "material": f"m{k and draw.integers(3)}"}
    return Description.model_validate(
        {
            "title": f"scene of chance {number}",
            "seed": number,
            "lens": {"focus_mm": 0.85 * wall},
            "laser": {"power_mw": 10},
            "material": {f"m{k}": {"reflectance": draw.uniform(0.1, 0.8)} for k in range(3)},
            "target": targets,
        }
    )


def against_truth(points: Table, truth: Truth) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the positions' errors, which points are far off, and which have a flag.

    A point is far off by more than 5 sigma and 0.5 mm, or where the beam's axis meets nothing that
    the camera sees.
    """
    error = points.position_px - truth.position_px
    beyond = np.abs(error) > 5 * points.sigma_px
    beyond &= np.abs(points.z_mm - truth.z_mm) > 0.5
    flagged = np.any([points.flags[name] for name in (*DOUBTFUL, "MIXED")], axis=0)
    return error, points.located & (beyond | np.isnan(error)), flagged


def judged(config: Config, scene: str, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return C_obj of a scene's points without a flag, and which keep the tolerance."""
    points, truth = scanned(config, scene, seed, count)
    plain = points.located & ~np.any([points.flags[name] for name in DOUBTFUL], axis=0)
    # What has no truth is no surface that the beam meets: that point is wrong.
    error = np.abs(points.z_mm - np.nan_to_num(truth.z_mm, nan=-1e9))
    kept = error < config.geometry.tolerance * points.z_mm
    return points.c_obj[plain], kept[plain]


@pytest.mark.parametrize(
    "scenes",
    [
        ("far", "plane", "dark", "glossy", "sunlit"),
        in_volume(
            tuple(name for name in shipped() if name not in NO_DETECTOR_KNOWS | FROM_BENEATH)
        ),
    ],
    ids=len,
)
@EACH_SCANNER
def test_a_confidence_is_a_share(config: Config, scenes: tuple[str, ...]) -> None:
    found = [judged(config, scene, 31, 3000) for scene in scenes]
    c_obj = np.concatenate([each for each, _ in found])
    kept = np.concatenate([each for _, each in found])
    tenth = np.minimum((c_obj * 10).astype(np.int64), 9)
    bins = [k for k in range(10) if np.sum(tenth == k) >= FEWEST]
    shares = [(float(c_obj[tenth == k].mean()), float(kept[tenth == k].mean())) for k in bins]
    spread = [float(np.std(kept[tenth == k]) / np.sqrt(np.sum(tenth == k))) for k in bins]
    print("; ".join(f"c_obj {c:.2f}: {share:.2f} keep it" for c, share in shares))
    assert len(bins) >= 5
    careful = kept_by(config).careful
    assert all(
        -careful - error <= c - share <= 0.1 + error
        for (c, share), error in zip(shares, spread, strict=True)
    )


@pytest.mark.parametrize("engine", [Engine.IDEAL, Engine.FIXED])
def test_a_confidence_as_printed_is_a_share_of_the_snr(engine: Engine) -> None:
    geometry = Config().geometry.model_copy(update={"confidence": "printed", "snr_max": 200.0})
    config = Config(geometry=geometry)
    described = load("step")
    lines = simulate(Light(described, config), 600, frozenset(present(described))).lines
    found = run(engine, lines, config)
    there, mixed = found.located, found.located & found.flags["MIXED"]
    want = np.minimum(found.snr / 200.0, 1.0)
    assert mixed.sum() > 2 and np.mean(want[there] < 1.0) > 0.01
    assert np.abs(found.c_obj - want)[there].max() < 0.51 / 255 and not found.c_obj[~there].any()


# The bolt's thread is finer than the spot: a point follows it by a part only, and no line tells.
FINER_THAN_THE_SPOT = {"bolt"}


@pytest.mark.parametrize(
    "scenes",
    [
        ("default", "near", "step", "glossy", "two-surfaces", "shiny-corner"),
        in_volume(
            tuple(name for name in shipped() if name not in FINER_THAN_THE_SPOT | FROM_BENEATH)
        ),
    ],
    ids=len,
)
@EACH_SCANNER
def test_errors_are_as_large_as_sigma_and_what_is_no_surface_is_told(
    config: Config,
    scenes: tuple[str, ...],
) -> None:
    """Against the truth of the light: positions over sigma, and points far off that have a flag.

    The share of those with a flag, and of the others that are MIXED or RIVAL, are counted
    over all scenes but window-ghost, whose ghosts are spots like any, and those with mirrors: there
    error over sigma is of the points that are not far off, and the others with a flag are counted
    by themselves. Of window-ghost nearly every point has a flag; the 10 to 25 that have none are
    light of a bright band from beams whose axis is on a dark one, and err by 2 to 4 sigma; only
    the polygon has enough of them to be judged, and KEPT says by how much they err. Error
    over sigma of a preset is of the points that are not far off, too: those without a flag are
    counted already.
    """
    ours = kept_by(config)
    told, far, mixed, rival, good = 0, 0, 0, 0, 0
    for scene in scenes:
        points, truth = scanned(config, scene, 31, 2000)
        error, off, flagged = against_truth(points, truth)
        kept = points.located & ~flagged & np.isfinite(error)
        if scene in NO_DETECTOR_KNOWS:
            kept &= ~off
            print(f"{scene}: {np.sum(off & flagged)} of {np.sum(off)} on another spot are told")
            least = ours.mirrored if scene in MIRRORS else ours.ghosts
            assert np.sum(off) > 60 and np.sum(off & flagged) > least * np.sum(off)
            if np.sum(kept) < FEWEST_RATIOS:
                continue
        if ours.preset:
            kept &= ~off
        ratio = error[kept] / points.sigma_px[kept]
        rms, within = float(np.sqrt(np.mean(ratio**2))), float(np.mean(np.abs(ratio) < 2.0))
        print(f"{scene}: error/sigma {rms:.2f}, {100 * within:.1f} % within 2 sigma")
        if scene == "window-ghost" and ours.lit is not None:
            assert rms < ours.lit
            continue
        unsure = 2 / np.sqrt(len(ratio)) if ours.preset else 0.0
        assert ours.least <= rms <= 1.25 + unsure * np.sqrt(0.5)
        assert 0.9 - unsure * 0.3 <= within <= ours.within
        if scene not in NO_DETECTOR_KNOWS:
            told, far = told + np.sum(off & flagged), far + np.sum(off)
            sound = points.located & ~off
            mixed, good = mixed + np.sum(sound & points.flags["MIXED"]), good + np.sum(sound)
            rival += np.sum(sound & points.flags["RIVAL"])
    print(f"{told} of {far} told; {100 * mixed / good:.2f} % of the others are MIXED and "
          f"{100 * rival / good:.2f} % RIVAL")  # fmt: skip
    # One seed has some 350 such points, whose share is known to 1.6 % (one standard deviation).
    assert told + 2 * np.sqrt(0.09 * far * ours.again) > ours.told * far
    # Asked of all scenes; those of the short run are the ones with the most edges.
    unsure = 2 * np.sqrt(mixed) if ours.preset else 0.0
    assert mixed - unsure < (0.01 if len(scenes) > 6 else 0.015) * good
    assert rival < 0.01 * good


@EACH_VOLUME
@EACH_SCANNER
def test_what_is_no_surface_is_told_in_scenes_of_chance(config: Config, volume: str) -> None:
    """Scenes on which no rule was tried: they have three times as many edges as the shipped ones.

    So there are more points of parts of a spot, right ones too; those between two lines on the same
    surface keep what is asked of all scenes. Of the few that are far off without a flag one in a
    scene is enough for any error over sigma; that is of the others.
    """
    told, far, mixed, good, alone, within = 0, 0, 0, 0, 0, 0
    squares: list[float] = []
    for number in range(80 if volume == "long" else 16):
        points, truth = points_of(config, scene_of_chance(number), 1024)
        error, off, flagged = against_truth(points, truth)
        sound = points.located & ~off
        told, far = told + np.sum(off & flagged), far + np.sum(off)
        mixed, good = mixed + np.sum(sound & points.flags["MIXED"]), good + np.sum(sound)
        same = truth.surface[1:] == truth.surface[:-1]
        inside = sound & np.append(False, same) & np.append(same, False)
        alone, within = alone + np.sum(inside & points.flags["MIXED"]), within + np.sum(inside)
        plain = sound & ~flagged
        ratio = error[plain] / points.sigma_px[plain]
        squares.append(float(np.mean(ratio**2)))
    ratios = np.sqrt(squares)
    print(f"{told} of {far} told; {100 * mixed / good:.1f} % of the others are MIXED, between "
          f"lines on their surface {100 * alone / within:.2f} %; error/sigma "
          f"{ratios.min():.2f} to {ratios.max():.2f}, median {np.median(ratios):.2f}")  # fmt: skip
    assert told + 2 * np.sqrt(0.09 * far) > kept_by(config).told * far
    assert mixed < 0.05 * good and alone < 0.01 * within
    assert 0.8 <= np.median(ratios) <= 1.25 and ratios.min() >= 0.6 and ratios.max() <= 1.5
