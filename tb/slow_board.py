"""A virtual board of a quarter of the clock, whose seconds take a quarter of the time."""

from vrscan.data.config import Config

SCENE = "default"
CONFIG = Config.model_validate(
    {
        "clock": {"frequency_hz": 25e6},
        "line": {"rate_hz": 9000.0},
        "mirror": {"sweep_span_hz": 0.0},  # it swings already
    }
)
