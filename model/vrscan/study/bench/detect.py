"""The work of the detector sweeps: detectors on the lines of one kind of spot."""

import json
import zlib
from dataclasses import asdict
from typing import Any

import numpy as np

from vrscan.detectors.catalogue import detector, detectors
from vrscan.detectors.patch import REACH
from vrscan.ideal.statistics import statistics
from vrscan.study.bench.cells import Figures, configuration
from vrscan.study.report.spot_lines import Spot, score, take

WORK = "vrscan.study.bench.detect:spots"
_MAX_WINDOW = 2 * REACH + 1


def source(parameters: dict[str, Any], seed: int) -> np.random.Generator:
    """Return the random numbers of a cell, which no other parameters and no other seed have."""
    text = json.dumps({k: v for k, v in parameters.items() if k != "config"}, sort_keys=True)
    return np.random.default_rng([seed, zlib.crc32(text.encode())])


def spots(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the errors of detectors on spots of one kind.

    Args:
        parameters: ``config``, ``lines``, the fields of ``Spot`` that differ from the defaults, and
            ``detectors``, the short names of the detectors; without it all of ``detectors()``.
        seed: Seed of the random numbers.

    Returns:
        ``bound_px`` without speckle, ``speckled_px``, the bound with it, ``lines``, and by each
        detector's short name rms, bias, spread and lost.
    """
    config, count = configuration(parameters), int(parameters["lines"])
    taken = take(Spot.of(parameters), count, config, source(parameters, seed))
    row = statistics(taken.lines, max_window=_MAX_WINDOW)
    errors = {}
    keys = parameters.get("detectors")
    for each in detectors() if keys is None else map(detector, keys):
        found = each.locate(taken.lines, row.background, row.noise, config)
        errors[each.key] = asdict(score(found, taken.true))
    bound, speckled = (float(np.sqrt(each.mean())) for each in (taken.bound, taken.speckled))
    return {"bound_px": bound, "speckled_px": speckled, "lines": count, "errors": errors}
