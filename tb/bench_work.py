"""Work for the tests of the benchmark's runner, in a module that a new process imports fast."""

import time
from pathlib import Path
from typing import Any

READS: tuple[str, ...] = ()


def noted(parameters: dict[str, Any], seed: int) -> dict[str, Any]:
    """Leave a mark each time it is done, and fail where it is told to."""
    if "fails" in parameters and Path(parameters["fails"]).exists():
        raise RuntimeError("told to")
    time.sleep(parameters.get("seconds", 0.0))
    with Path(parameters["marks"]).open("a") as file:
        file.write(f"{parameters['number']} {seed}\n")
    return {"square": parameters["number"] ** 2, "seed": seed}
