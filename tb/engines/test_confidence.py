"""C_obj against the truth of scenes: among points of C_obj c, a share c keeps the tolerance."""

import numpy as np
import pytest
from harness import in_volume

from vrscan.data.config import Config, Peak
from vrscan.data.lines import Truth
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.scene.description import load, shipped
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate

CONFIG = Config(peak=Peak(window="fit"))
# The spot that a mirror shows, or onto which it throws the beam, is as good a spot as any. Where it
# is the brighter one the line cannot tell, but for its rival, and the glint of a beam that comes
# back from two mirrors, which is saturated.
MIRRORS = {"shiny-corner", "turned-metal"}
# Nor can it tell a ghost, which stands where it stands all the time.
NO_DETECTOR_KNOWS = {"window-ghost"} | MIRRORS
FEWEST = 120  # points of a tenth of C_obj that are judged: their share is known to 0.045
DOUBTFUL = ("SATURATED", "RIVAL", "AT_EDGE")


# Out of focus speckle has coarse grains, which third differences do not see: what sigma promises
# holds for speckle as in focus, and ``test_coarse_grains_are_more_than_sigma`` says how far beyond.
IN_FOCUS = frozenset({"grain"})


def scanned(
    scene: str, seed: int, count: int, without: frozenset[str] = IN_FOCUS
) -> tuple[Table, Truth]:
    """Return the points of a scene with a seed of its own, and the truth."""
    described = load(scene).model_copy(update={"seed": seed})
    active = frozenset(present(described)) - without
    lines = simulate(Light(described, CONFIG), count, active).lines
    assert lines.truth is not None
    return run(Engine.FIXED, lines, CONFIG), lines.truth


def judged(scene: str, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return C_obj of a scene's points without a flag, and which keep the tolerance."""
    points, truth = scanned(scene, seed, count)
    plain = points.located & ~np.any([points.flags[name] for name in DOUBTFUL], axis=0)
    # What has no truth is no surface that the beam meets: that point is wrong.
    error = np.abs(points.z_mm - np.nan_to_num(truth.z_mm, nan=-1e9))
    kept = error < CONFIG.geometry.tolerance * points.z_mm
    return points.c_obj[plain], kept[plain]


@pytest.mark.parametrize(
    "scenes",
    [
        ("far", "plane", "dark", "glossy", "sunlit"),
        in_volume(tuple(name for name in shipped() if name not in NO_DETECTOR_KNOWS)),
    ],
    ids=len,
)
def test_a_confidence_is_a_share(scenes: tuple[str, ...]) -> None:
    found = [judged(scene, 31, 3000) for scene in scenes]
    c_obj = np.concatenate([each for each, _ in found])
    kept = np.concatenate([each for _, each in found])
    tenth = np.minimum((c_obj * 10).astype(np.int64), 9)
    bins = [k for k in range(10) if np.sum(tenth == k) >= FEWEST]
    shares = [(float(c_obj[tenth == k].mean()), float(kept[tenth == k].mean())) for k in bins]
    spread = [float(np.std(kept[tenth == k]) / np.sqrt(np.sum(tenth == k))) for k in bins]
    print("; ".join(f"c_obj {c:.2f}: {share:.2f} keep it" for c, share in shares))
    assert len(bins) >= 5
    assert all(
        abs(c - share) <= 0.1 + error for (c, share), error in zip(shares, spread, strict=True)
    )


# The bolt's thread is finer than the spot: a point follows it by a part only, and no line tells.
FINER_THAN_THE_SPOT = {"bolt"}


@pytest.mark.parametrize(
    "scenes",
    [
        ("default", "near", "step", "glossy", "two-surfaces", "shiny-corner"),
        in_volume(tuple(name for name in shipped() if name not in FINER_THAN_THE_SPOT)),
    ],
    ids=len,
)
def test_errors_are_as_large_as_sigma_and_what_is_no_surface_is_told(
    scenes: tuple[str, ...],
) -> None:
    """Against the truth of the light: positions over sigma, and points far off that have a flag.

    A point is far off by more than 5 sigma and 0.5 mm, or where the beam's axis meets nothing that
    the camera sees. The share of those with a flag, and of the others that are MIXED, are counted
    over all scenes but window-ghost, whose ghosts are spots like any, and those with mirrors: there
    error over sigma is of the points that are not far off, and the others with a flag are counted
    by themselves.
    """
    told, far, mixed, good = 0, 0, 0, 0
    for scene in scenes:
        points, truth = scanned(scene, 31, 2000)
        error = points.position_px - truth.position_px
        beyond = np.abs(error) > 5 * points.sigma_px
        beyond &= np.abs(points.z_mm - truth.z_mm) > 0.5
        off = points.located & (beyond | np.isnan(error))
        flagged = np.any([points.flags[name] for name in (*DOUBTFUL, "MIXED")], axis=0)
        kept = points.located & ~flagged & np.isfinite(error)
        if scene in MIRRORS:
            kept &= ~off
            print(f"{scene}: {np.sum(off & flagged)} of {np.sum(off)} on another spot are told")
            assert np.sum(off) > 60 and np.sum(off & flagged) > 0.8 * np.sum(off)
        ratio = error[kept] / points.sigma_px[kept]
        rms, within = float(np.sqrt(np.mean(ratio**2))), float(np.mean(np.abs(ratio) < 2.0))
        print(f"{scene}: error/sigma {rms:.2f}, {100 * within:.1f} % within 2 sigma")
        # Of window-ghost some 150 points have no flag, and a handful of them are of the ghost.
        assert 0.8 <= rms <= (2.0 if scene in NO_DETECTOR_KNOWS else 1.25)
        assert 0.9 <= within <= 0.985
        if scene not in NO_DETECTOR_KNOWS:
            told, far = told + np.sum(off & flagged), far + np.sum(off)
            sound = points.located & ~off
            mixed, good = mixed + np.sum(sound & points.flags["MIXED"]), good + np.sum(sound)
    print(f"{told} of {far} told; {100 * mixed / good:.2f} % of the others are MIXED")
    assert told > 0.9 * far
    # Asked of all scenes; those of the short run are the ones with the most edges.
    assert mixed < (0.01 if len(scenes) > 6 else 0.015) * good


@pytest.mark.parametrize(
    ("scene", "grain", "most"),
    [
        ("default", False, 1.25),
        ("default", True, 1.9),
        *(in_volume(name, True, 2.4) for name in shipped() if name not in MIRRORS | {"bolt"}),
    ],
)
def test_coarse_grains_are_more_than_sigma(scene: str, grain: bool, most: float) -> None:
    """Error over sigma with all that the light has, out of focus too: it is larger than 1.25."""
    points, truth = scanned(scene, 47, 2000, frozenset() if grain else IN_FOCUS)
    doubtful = np.any([points.flags[name] for name in (*DOUBTFUL, "MIXED")], axis=0)
    error = points.position_px - truth.position_px
    kept = points.located & ~doubtful & (np.abs(error) < 10.0)
    ratio = error[kept] / points.sigma_px[kept]
    rms, within = float(np.sqrt(np.mean(ratio**2))), float(np.mean(np.abs(ratio) < 2.0))
    print(f"{scene}: error/sigma {rms:.2f}, {100 * within:.1f} % within 2 sigma")
    assert 0.75 < rms < most
    assert within > (0.7 if grain else 0.9)
