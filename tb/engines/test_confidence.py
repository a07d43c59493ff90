"""C_obj against the truth of scenes: among points of C_obj c, a share c keeps the tolerance."""

import numpy as np
import pytest
from harness import in_volume

from vrscan.data.config import Config, Peak
from vrscan.engines.engine import Engine, run
from vrscan.scene.description import load, shipped
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate

CONFIG = Config(peak=Peak(window="fit"))
# A ghost stands where it stands all the time, and is as good a spot as any.
NO_DETECTOR_KNOWS = {"window-ghost"}
FEWEST = 120  # points of a tenth of C_obj that are judged: their share is known to 0.045
DOUBTFUL = ("SATURATED", "RIVAL", "AT_EDGE")


def judged(scene: str, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return C_obj of a scene's points without a flag, and which keep the tolerance."""
    described = load(scene).model_copy(update={"seed": seed})
    lines = simulate(Light(described, CONFIG), count, frozenset(present(described))).lines
    assert lines.truth is not None
    points = run(Engine.FIXED, lines, CONFIG)
    plain = points.located & ~np.any([points.flags[name] for name in DOUBTFUL], axis=0)
    # What has no truth is no surface that the beam meets: that point is wrong.
    error = np.abs(points.z_mm - np.nan_to_num(lines.truth.z_mm, nan=-1e9))
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
    print("; ".join(f"c_obj {c:.2f}: {share:.2f} keep it" for c, share in shares))
    assert len(bins) >= 5
    assert all(abs(c - share) <= 0.1 for c, share in shares)
